"""`ephs new`: a first file, commented, that runs."""

import json
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from ephs.cli.input import BadInput, addressed, say

__all__ = ["TEMPLATES", "news"]

TEMPLATES = {
    "pendulum": ("pendulum.toml", "a rod on a pin with friction, a bearing that warms up; every line explained"),
    "double-pendulum": ("double-pendulum.toml", "two rods, two pins, chaos"),
    "spinning-body": ("spinning-body.toml", "a free body that turns over"),
    "four-bar": ("four-bar.toml", "a loop of four bars, closed for you when lengths change"),
    "slider-crank": ("slider-crank.toml", "a small engine with friction and heat"),
    "oscillator": ("oscillator.py", "a System in Python: a spring, a mass and a damper, by a pattern"),
}
_TEXTS = {
    "taken": "{file}: it exists; choose another name, or move it away",
    "suffix": "{file}: found the ending {found}, expected {expected}, or none: --like {like} writes such a file",
    "name": "ephs new {file}: expected a name, as in ephs new my-pendulum",
}
Like = Literal["pendulum", "double-pendulum", "spinning-body", "four-bar", "slider-crank", "oscillator"]

news = App(name="new", help="Write a commented scene that runs, to change into your own.")


@news.default
def new(name: str, /, *, like: Annotated[Like, Parameter(name=["--like", "-l"])] = "pendulum") -> int:
    """Write a commented scene that runs, to change into your own.

    A file that exists is never written over.

    Parameters
    ----------
    name
        Name of the scene, or of the file: my-pendulum writes my-pendulum.toml.
    like
        What it starts from: pendulum, of which every line is explained; double-pendulum; spinning-body; four-bar;
        slider-crank; oscillator, a System in Python.
    """
    template, about = TEMPLATES[like]
    expected = Path(template).suffix
    target = Path(name)
    if not target.name:
        raise BadInput(_TEXTS["name"].format(file=name))
    if target.suffix not in ("", expected):
        found = _TEXTS["suffix"].format(file=name, found=target.suffix, expected=expected, like=like)
        raise BadInput(found)
    target = target.with_suffix(expected)
    text = (files("ephs") / "templates" / template).read_text(encoding="utf-8")
    text = text.replace('name = "NAME"', f"name = {json.dumps(target.stem, ensure_ascii=False)}")
    text = text.replace(f"NAME{expected}", str(target)).replace("NAME", target.stem)
    with addressed(str(target), target):
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            with target.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError as error:
            raise BadInput(_TEXTS["taken"].format(file=target)) from error
    model = f"{target}:{like}" if expected == ".py" else str(target)
    start = " --initial spring.q=1.0" if expected == ".py" else ""
    say(
        f"{target}: {about}; next:",
        f"ephs check {model}",
        f"ephs run {model} --until 5{start}",
        f"ephs draw {model} -o {target.with_suffix('.svg')}",
    )
    return 0
