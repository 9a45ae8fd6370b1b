"""Contacts of a solution: their gaps, forces and totals, as panels of curves and as a table."""

import html
from typing import Any

import numpy as np

from ephs.mechanics.scene.build import component_path
from ephs.show.plots.panels import Curve, Panel
from ephs.show.shared.page import wide_table
from ephs.show.shared.palette import CYCLE

_HEAD = (
    "contact", "least gap [m]", "largest force [N]", "largest slip [m/s]", "most energy stored [J]",
    "energy at the end [J]", "exergy destroyed [J]",
)  # fmt: skip


def _names(sol: Any) -> list[str]:
    return [] if sol.scene is None else [name for name, _ in sol.scene.all_contacts()]


def contact_panels(sol: Any) -> list[Panel]:
    """Gaps, sizes of forces, slips, and totals of all contacts of a scene."""
    curves: dict[str, list[Curve]] = {}
    for k, name in enumerate(_names(sol)):
        motion, book = sol.contact(name), sol.ledger(component_path("contacts", name))
        for title, values in (
            ("gap [m]", motion.gap),
            ("force [N]", np.linalg.norm(motion.force, axis=1)),
            ("slip [m/s]", motion.slip),
            ("energy of contacts [J]", book.exergy),
            ("exergy destroyed [J]", book.destroyed),
        ):
            curves.setdefault(title, []).append(Curve(name, np.asarray(values), CYCLE[k % len(CYCLE)]))
    return [Panel(title, tuple(lines)) for title, lines in curves.items()]


def contact_table(sol: Any) -> str:
    """Summary of each contact over a run as HTML, empty without contacts."""
    names = _names(sol)
    if not names or not len(sol.t):
        return ""
    rows, apart, shared = list[list[str]](), 0, list[str]()
    for name in names:
        motion, book = sol.contact(name), sol.ledger(component_path("contacts", name))
        force = np.linalg.norm(motion.force, axis=1)
        if not (book.destroyed[-1] or force.any()):
            apart += 1
            continue
        shared += [name] if motion.mask.any() else []
        numbers = (
            motion.gap.min(), force.max(), motion.slip.max(), book.exergy.max(), book.exergy[-1], book.destroyed[-1],
        )  # fmt: skip
        rows.append([html.escape(name), *(f"{value:.4g}" for value in numbers)])
    loose = html.escape(", ".join(shared))
    share = f" Contacts that share a load have indeterminate forces, of which those of least norm are listed: {loose}."
    others = f" {apart} other pairs never touched." if rows and apart else ""
    if not rows:
        return f"<h2>Contacts</h2><p>None of {apart} pairs touched.</p>"
    return (
        "<h2>Contacts</h2><p>Gaps, forces and slips are the largest at kept instants. Destroyed exergy is the heat that"
        f" the environment took; each step is in it.{others}{share if shared else ''}</p>"
        f"{wide_table(_HEAD, rows)}"
    )
