"""A scene in words, and as tables for notebooks."""

from collections.abc import Iterator
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ephs.mechanics.scene.model import Scene


def scene_text(scene: "Scene") -> str:
    """Contents of a scene, a line each."""
    lines = [f"scene {scene.name}" + (f" ({scene.source})" if scene.source else "")]
    g, w = scene.world.gravity, scene.world
    lines.append(f"  world: gravity [{g[0]:g}, {g[1]:g}, {g[2]:g}] m/s², {w.temperature:g} K, {w.pressure:g} Pa")
    for kind, name, what in _things(scene):
        lines.append(f"  {kind} {name}: {what}")
    if scene.adjusted is not None:
        lines += ["  " + line for line in str(scene.adjusted).splitlines()]
    return "\n".join(lines)


def scene_html(scene: "Scene") -> str:
    """The same as a table, with the picture of its pattern above."""
    from ephs.show import draw

    rows = "".join(
        f'<tr><td>{kind}</td><th style="text-align:left">{escape(name)}</th><td style="text-align:left">{escape(what)}'
        "</td></tr>"
        for kind, name, what in _things(scene)
    )
    table = f"<table><caption>scene {escape(scene.name)}</caption><tbody>{rows}</tbody></table>"
    picture = draw(scene.system()).svg
    return f'<div style="max-width:40rem">{picture[picture.index("<svg") :]}</div>{table}'


def _things(scene: "Scene") -> list[tuple[str, str, str]]:
    """Kind, name and value of all elements of a scene."""
    return [
        *(("body", name, f"{body.mass:g} kg") for name, body in scene.all_bodies()),
        *(("joint", name, f"{j.kind}, {j.body1} – {j.body2}") for name, j in scene.all_joints()),
        *_told(scene, "springs", "contacts"),
        *(("beam", name, f"{beam.elements} elements, {' – '.join(beam.ends)}") for name, beam in scene.all_beams()),
        *_told(scene, "shells", "tendons", "loads"),
        *((section.removesuffix("s").replace("_", " "), name, str(x)) for section, name, x in scene.all_attachments()),
        *(("thermal", name, f"{n.capacity:g} J/K at {n.temperature:g} K") for name, n in scene.all_thermal()),
        *_told(scene, "conduction"),
        *((section.removesuffix("s").replace("_", " "), name, str(x)) for section, name, x in scene.all_elements()),
    ]


def _told(scene: "Scene", *sections: str) -> Iterator[tuple[str, str, str]]:
    """The same of elements that say it themselves."""
    return ((section.removesuffix("s"), name, str(x)) for section in sections for name, x in scene.every(section))
