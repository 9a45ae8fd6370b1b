"""Mechanisms in space: schematics, animations, videos, and a viewer in the browser.

In comes a scene, or a solution of a mechanism; out go figures and pages. `motion` holds poses as arrays, `stage` all
that is shown: start there.
"""
