"""Rewrites of a scene's model, each with its condition, its strength and its reason in words."""
