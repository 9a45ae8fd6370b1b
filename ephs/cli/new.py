"""`ephs new`: a commented scene file to start from."""

import json
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from ephs.cli.input import BadInput, addressed, say

TEMPLATES = {
    "pendulum": ("pendulum.toml", "a rod on a pin with friction, which warms the bearing; every line explained"),
    "double-pendulum": ("double-pendulum.toml", "two rods on two pins: chaotic motion"),
    "spinning-body": ("spinning-body.toml", "a free rigid body that spins about its middle axis"),
    "four-bar": ("four-bar.toml", "a closed loop of four bars, assembled anew when lengths change"),
    "slider-crank": ("slider-crank.toml", "a small engine with friction and heat"),
    "oscillator": ("oscillator.py", "a System in Python: spring, mass and damper, composed by a pattern"),
}
_TEXTS = {
    "taken": "{file}: the file exists; choose another name, or move the file",
    "suffix": "{file}: found the ending {found}, expected {expected} or none for --like {like}",
    "name": "ephs new {file}: expected a name, as in ephs new my-pendulum",
}
Like = Literal["pendulum", "double-pendulum", "spinning-body", "four-bar", "slider-crank", "oscillator"]

news = App(name="new", help="Write a commented scene file to start from.")


@news.default
def new(name: str, /, *, like: Annotated[Like, Parameter(name=["--like", "-l"])] = "pendulum") -> int:
    """Write a commented scene file to start from.

    Existing files are never overwritten.

    Parameters
    ----------
    name
        Name of the scene, or of the file: my-pendulum writes my-pendulum.toml.
    like
        Example to copy: pendulum explains every line; oscillator is a System in Python.
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
