"""Suggestions of the command line: an example of every command, the nearest spelling, next steps after a run."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ephs.cli.input import BadInput
from ephs.cli.nearest import nearest

EXAMPLES: Mapping[str, tuple[str, ...]] = {
    "new": ("ephs new my-pendulum", "ephs new engine --like slider-crank"),
    "run": (
        "ephs run scenes/slider-crank.toml --until 5",
        "ephs run scenes/heavy-top.toml --until 1 --method natural --step 1e-3",
        "ephs run out/heavy-top --resume",
        "ephs run examples/oscillator.py:damped_oscillator --until 10 --initial osc.pe.q=1.0",
    ),
    "check": (
        "ephs check scenes/four-bar.toml",
        "ephs check examples/physics.py:cylinder --initial gas1.v=0.1 --initial gas2.v=0.9",
    ),
    "draw": ("ephs draw scenes/slider-crank.toml -o pattern.svg", "ephs draw scenes/mbs.toml --flat -o flat.tex"),
    "equations": ("ephs equations scenes/mbs.toml", "ephs equations scenes/mbs.toml --form descriptor --latex"),
    "reduce": ("ephs reduce scenes/four-bar.toml",),
    "info": ("ephs info scenes/slider-crank.toml",),
    "plot": ("ephs plot out/slider-crank joints.bearing.rate energy", "ephs plot out/slider-crank"),
    "view": ("ephs view scenes/four-bar.toml", "ephs view robot.urdf"),
    "animate": ("ephs animate out/slider-crank -o slider-crank.html",),
    "sweep": ("ephs sweep scenes/heavy-top.toml --vary bodies.top.mass=5:25:9 --until 1 -o out/sweep",),
    "equilibrium": ("ephs equilibrium scenes/four-bar.toml --out out/rest",),
    "export": ("ephs export scenes/slider-crank.toml -o crank.c --inputs joints.bearing",),
    "fmu": ("ephs fmu scenes/slider-crank.toml -o crank.fmu --inputs joints.bearing --outputs joints",),
    "linearize": ("ephs linearize scenes/four-bar.toml --at equilibrium",),
    "convert": ("ephs convert examples/arm.urdf -o arm.toml",),
    "chart": (
        "ephs chart stability spin -o out/charts",
        "ephs chart work-precision scenes/four-bar.toml -o out/charts",
    ),
    "chart stability": ("ephs chart stability spin slender -o out/charts",),
    "chart work-precision": ("ephs chart work-precision scenes/four-bar.toml --until 1 -o out/charts",),
}
"""Command: examples that run in a clone; ``ephs`` alone shows the first."""

_TEXTS = {
    "command": "ephs {found}: no such command; did you mean ephs {near}? ephs alone lists them",
    "no command": "ephs {found}: no such command; expected one of {known}",
    "scene": "ephs {found}: found no command before the file; expected one, as in ephs run {found} --until 5",
}


def commands(app: Any) -> list[str]:
    """Names of the commands of an app, in the order of `EXAMPLES`."""
    known = [name for name in app if not name.startswith("-")]
    order = [name for name in EXAMPLES if name in known]
    return order + [name for name in known if name not in order]


def welcome(app: Any) -> str:
    """An example and a description of every command."""
    lines = [
        "Multibody dynamics and exergetic port-Hamiltonian systems: compose, simulate, check both laws.",
        "Start with ephs new my-pendulum, then ephs run my-pendulum.toml --until 5.",
        "",
    ]
    for name in commands(app):
        example = EXAMPLES.get(name, (f"ephs {name}",))[0]
        about = str(app[name].help or "").strip().partition("\n")[0].rstrip(".")
        lines += [f"  {example}", f"      {about}"]
    return "\n".join([
        *lines,
        "",
        "SCENE is a scene file (.toml), a model (URDF, MJCF, SDF: .urdf, .xml, .sdf), or FILE.py:NAME: a System",
        "or Scene in a Python file.",
        "ephs COMMAND --help explains a command; ephs --install-completion completes them in your shell.",
    ])  # fmt: skip


def with_examples(app: Any, prefix: str = "") -> None:
    """Append examples to the help of every command of an app."""
    for name in commands(app):
        full = f"{prefix} {name}".strip()
        if full in EXAMPLES:
            head = "Example:" if len(EXAMPLES[full]) == 1 else "Examples:"
            app[name].help_epilogue = "\n".join([head, *(f"  {line}" for line in EXAMPLES[full])])
        if list(app[name]) and not prefix:
            with_examples(app[name], full)


def known_command(app: Any, words: Sequence[str]) -> None:
    """Refuse arguments without a command of an app.

    Raises
    ------
    BadInput
        With the nearest command.
    """
    for level, name in ((app, ""), *((app[w], w) for w in words[:1] if w in list(app))):
        rest = words[1:] if name else words
        known = commands(level)
        if not rest or rest[0].startswith("-") or rest[0] in known or not known:
            continue
        found = f"{name} {rest[0]}".strip()
        if Path(rest[0]).suffix or Path(rest[0]).is_file():
            raise BadInput(_TEXTS["scene"].format(found=found))
        near = nearest(rest[0], known)
        if near is None:
            raise BadInput(_TEXTS["no command"].format(found=found, known=", ".join(known)))
        raise BadInput(_TEXTS["command"].format(found=found, near=f"{name} {near}".strip()))


def after(folder: Path, *, moves: bool, report: bool) -> list[str]:
    """Suggested commands after a run, for its result folder."""
    lines: list[str] = []
    if report:
        lines.append(f"{folder / 'report.html'}: animation, plots, balances; open it in a browser")
    if moves:
        lines.append(f"ephs animate {folder} -o {folder.name}.html: the animation alone, as a page")
    lines.append(f"ephs plot {folder}: names of the signals; ephs plot {folder} SIGNAL …: their plot")
    lines.append(f'sol = ephs.load_solution("{folder / "solution.nc"}"): all results in Python')
    return lines
