"""Input and output of the command line: files to models, user errors to clear texts, results."""

import math
import runpy
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, final

from cyclopts import Parameter

from ephs.cli.nearest import MODELS, did_you_mean

if TYPE_CHECKING:
    from ephs import Pattern, Scene, Solution, System

TEXTS = {
    "initial": "--initial {found}: expected PATH=NUMBER or PATH=NUMBER,NUMBER,..., as in osc.pe.q=1.0",
    "jumps": "--jumps {found}: expected TIME,TIME,... in seconds, as in 0.1,0.25",
    "suffix": "{found}: found the ending {ending}, expected one of {expected}; choose another file name",
    "no-file": "{found}: no such file; expected a scene file (.toml), a model (.urdf, .xml, .sdf) or FILE.py:NAME",
    "no-result": "{found}: found no solution.nc in it, expected a result folder of ephs run or a saved solution (.nc)",
    "not-a-result": "{found}: found a model, expected a result folder of ephs run or a saved solution (.nc); "
    "run it first: ephs run {found} --until 5",
    "no-scene": "{found}: found a System, expected a scene or a model, whose bodies have shapes to show",
    "no-name": "{file}: found no {or_} {name} in it, expected one of {found}",
    "nameless": "{file}: found no NAME after the file; it holds {found}; give one as {file}:{example}",
    "no-model": "{file}: found no {no} in it; bind one to a name at the top level of the file",
    "not-a-model": "{file}: {name} is a {found}, expected a {or_}; {others}",
    "no-parts": "--flat: {found} is a Pattern, expected a System or a Scene, whose boxes hold patterns",
    "user-code": "{file}: line {line}: {found}; correct the file, then run again",
    "extra": "{file}: the module {found} is not installed; python -m pip install 'ephs[{extra}]'",
    "no-report": "report.html was not written: the module {found} is not installed; the solution is saved; "
    "python -m pip install 'ephs[{extra}]' and run again, or give --no-report",
    "out": "{file}: {found}; choose another folder or file",
    "failed": "{file}: the run failed: {found}",
    "audit": "{file}: {found}",
    "interrupted": "{file}: interrupted{at}",
}
EXTRAS = {"matplotlib": "viz", "viser": "viz", "mujoco": "models", "distributed": "cluster"}


class BadInput(Exception):
    """Invalid input; the text is for the user."""


@Parameter(name="*")
@final
@dataclass(frozen=True, slots=True)
class LoadOptions:
    """Options for reading files as scenes.

    Parameters
    ----------
    base
        Root of a URDF: fixed to the ground, or free.
    adjust
        Move bodies so that joints close, where the given poses leave gaps.
    inertia
        Treatment of an inertia that no distribution of mass has: strict refuses it, warn keeps it, nearest replaces it
        by the nearest physical one. Default: the scene file's own key; warn for other formats.
    contact
        Import joint limits and contacts of models in other formats.
    """

    base: Literal["fixed", "free"] = "fixed"
    adjust: bool = False
    inertia: Literal["strict", "warn", "nearest"] | None = None
    contact: bool = False


AS_GIVEN = LoadOptions()


def positive(_type: object, value: float | None) -> None:
    """Validator of options: None or a number above 0.

    Raises
    ------
    ValueError
        It is another number.
    """
    if value is not None and not (value > 0 and math.isfinite(value)):
        raise ValueError(f"found {value:g}, expected a positive finite number")


Positive = Annotated[float | None, Parameter(validator=positive)]


@Parameter(name="*")
@final
@dataclass(frozen=True, slots=True)
class Stepping:
    """Options of time stepping.

    Parameters
    ----------
    method
        Integration method, for example natural. Default: auto.
    rtol
        Relative tolerance of methods with step-size control.
    atol
        Absolute tolerance of methods with step-size control.
    step
        Constant step size in seconds.
    form
        Form of the equations: paper (maximal coordinates, as flattened), folded, or reduced (joint coordinates).
        Default: that of the method.
    jumps
        Times in seconds of discontinuous inputs, TIME,TIME,...; steps end there.
    """

    method: str | None = None
    rtol: Positive = None
    atol: Positive = None
    step: Positive = None
    form: Literal["paper", "folded", "reduced"] | None = None
    jumps: str | None = None

    def options(self) -> dict[str, Any]:
        """Specified options as keywords of ``simulate``.

        Raises
        ------
        BadInput
            A time is no number.
        """
        values = ((field.name, getattr(self, field.name)) for field in fields(self))
        found = {name: value for name, value in values if value is not None}
        if self.jumps is not None:
            try:
                found["jumps"] = [float(time) for time in self.jumps.split(",")]
            except ValueError as error:
                raise BadInput(TEXTS["jumps"].format(found=self.jumps)) from error
        return found


AS_CHOSEN = Stepping()


def require_ending(file: Path, endings: Sequence[str], hint: str = "") -> None:
    """Refuse a file to write with another ending than these.

    Raises
    ------
    BadInput
        It says which endings there are.
    """
    if file.suffix not in endings:
        found = TEXTS["suffix"].format(found=file, ending=file.suffix or "none", expected=", ".join(endings))
        raise BadInput(found + hint)


def load_drawable(scene: str, loading: LoadOptions = AS_GIVEN) -> "Scene | System | Pattern":
    """As `load_model`; NAME may be that of a Pattern, too."""
    from ephs import Pattern

    file, separator, name = scene.rpartition(":")
    if separator and file.endswith(".py"):
        return _from_python(Path(file), name, Pattern)
    return _from_python(Path(scene), "", Pattern) if scene.endswith(".py") else load_model(scene, loading)


def load_model(scene: str, loading: LoadOptions = AS_GIVEN) -> "Scene | System":
    """A scene file, a model in another format, or FILE.py:NAME, as a model.

    Raises
    ------
    BadInput
        There is no such file or name, or it is faulty.
    """
    import ephs

    file, separator, name = scene.rpartition(":")
    if separator and file.endswith(".py"):
        return _from_python(Path(file), name)
    if scene.endswith(".py"):
        return _from_python(Path(scene), "")
    if not Path(scene).is_file():
        raise BadInput(TEXTS["no-file"].format(found=scene) + _beside(Path(scene)))
    options: dict[str, Any] = {"base": loading.base, "adjust": loading.adjust}
    if loading.contact:
        options["contact"] = True
    if loading.inertia is not None:
        options["inertia"] = loading.inertia
    with addressed(scene), heard():
        return ephs.load(scene, **options)


def _from_python(file: Path, name: str, *more: type) -> Any:
    import ephs

    if not file.is_file():
        raise BadInput(TEXTS["no-file"].format(found=file) + _beside(file))
    sys.path.insert(0, str(file.parent.resolve()))  # as `python FILE.py` does, for modules beside the file
    try:
        names = runpy.run_path(str(file), run_name="__ephs__")
    except (Exception, SystemExit) as error:
        found = f"{type(error).__name__}: {error}"
        raise BadInput(TEXTS["user-code"].format(file=file, line=_line(error, file), found=found)) from error
    finally:
        sys.path.remove(str(file.parent.resolve()))
    models = [key for key, value in names.items() if isinstance(value, (ephs.System, ephs.Scene, *more))]
    kinds = ["System", "Scene", *(kind.__name__ for kind in more)]
    or_ = " or a ".join(kinds)
    if name in names and name not in models:
        others = f"the file holds {', '.join(models)}" if models else "the file holds none"
        raise BadInput(
            TEXTS["not-a-model"].format(file=file, name=name, found=type(names[name]).__name__, others=others, or_=or_)
        )
    if not models:
        raise BadInput(TEXTS["no-model"].format(file=file, no=" and no ".join(kinds)))
    if name not in names:
        case = "no-name" if name else "nameless"
        told = TEXTS[case].format(
            file=file, name=name, or_=" or ".join(kinds), found=", ".join(models), example=models[0]
        )
        raise BadInput(told + did_you_mean(name, models))
    return names[name]


def _beside(file: Path) -> str:
    from ephs.mechanics.scene.text import nearest_file

    near = nearest_file(file, MODELS)
    return f'; did you mean "{near}"?' if near else ""


def solution_of(folder: Path) -> "Solution":
    """Solution in a result folder, or in the file of `Solution.save`.

    Raises
    ------
    BadInput
        There is none, or its file is damaged.
    """
    import ephs

    file = folder if folder.suffix == ".nc" else folder / "solution.nc"
    if not file.is_file():
        model = folder.is_file() and folder.suffix in MODELS
        raise BadInput(TEXTS["not-a-result" if model else "no-result"].format(found=folder))
    try:
        return ephs.load_solution(file)
    except ValueError as error:
        raise BadInput(str(error)) from error


def _line(error: BaseException, file: Path) -> int | str:
    """Return the innermost line of the user's own file in the traceback."""
    if isinstance(error, SyntaxError) and error.filename == str(file) and error.lineno:
        return error.lineno
    line: int | str = "?"
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(file):
            line = trace.tb_lineno
        trace = trace.tb_next
    return line


@contextmanager
def addressed(scene: str, target: Path | None = None) -> Iterator[None]:
    """Convert errors of user input to ``BadInput`` with the file's name."""
    import ephs

    try:
        yield
    except (BadInput, ephs.SimulationError):
        raise
    except ModuleNotFoundError as error:
        module = (error.name or "").partition(".")[0]
        if module not in EXTRAS:
            raise
        raise BadInput(TEXTS["extra"].format(file=scene, found=module, extra=EXTRAS[module])) from error
    except OSError as error:
        where = error.filename or target or scene
        raise BadInput(TEXTS["out"].format(file=where, found=error.strerror or error)) from error
    except Exception as error:
        # The exception classes of this package are addressed to the user; all others are defects.
        if type(error).__module__.partition(".")[0] != "ephs":
            raise
        raise BadInput(naming(scene, str(error))) from error


@contextmanager
def noted(say: Callable[[str], None]) -> Iterator[None]:
    """Print this package's warnings as lines of the command line."""
    with warnings.catch_warnings():
        otherwise = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *rest: Any) -> None:
            if category.__module__.partition(".")[0] == "ephs":
                say(str(message))
            else:
                otherwise(message, category, *rest)

        warnings.showwarning = show
        yield


@contextmanager
def heard() -> Iterator[None]:
    """Show every warning about models and scenes, against the user's filters."""
    import ephs

    with warnings.catch_warnings():
        for kind in (ephs.ModelWarning, ephs.SceneWarning):
            warnings.simplefilter("always", kind)
        yield


def initial_values(entries: Sequence[str]) -> dict[str, list[float]] | None:
    """Values of PATH=NUMBER,NUMBER,...; None where none are given.

    Raises
    ------
    BadInput
        An entry is not of that form.
    """
    values: dict[str, list[float]] = {}
    for entry in entries:
        path, _, numbers = entry.partition("=")
        try:
            values[path] = [float(number) for number in numbers.split(",")]
        except ValueError as error:
            raise BadInput(TEXTS["initial"].format(found=entry)) from error
    return values or None


def naming(scene: str, message: str) -> str:
    """A message with the file's name, once."""
    return message if str(Path(scene)) in message else f"{scene}: {message}"


def say(*lines: str) -> None:
    """Print results, those after the first line indented."""
    _print(lines, errors=False)


def complain(*lines: str) -> None:
    """Print errors and warnings to stderr."""
    _print(lines, errors=True)


def _print(lines: Sequence[str], *, errors: bool) -> None:
    from rich.console import Console

    Console(stderr=errors, soft_wrap=True, highlight=False, markup=False, emoji=False).print("\n  ".join(lines))
