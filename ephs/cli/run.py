"""`ephs run`: simulate a scene into a result folder, or continue an interrupted run."""

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from ephs.cli.input import (
    AS_CHOSEN,
    AS_GIVEN,
    TEXTS,
    BadInput,
    LoadOptions,
    Positive,
    Stepping,
    addressed,
    complain,
    initial_values,
    load_model,
    naming,
    say,
)
from ephs.cli.next import after
from ephs.cli.progress import progress_bar
from ephs.cli.results import write_results

if TYPE_CHECKING:
    from ephs import Scene, Solution, System

JOURNAL = "run.journal"
RUN = "run.json"
"""Request of a run, stored beside the results of a complete run."""
RESULTS = ("solution.nc", "summary.json", "report.html", JOURNAL, RUN)
"""Files of a result folder, of which any says that it is taken."""
KEPT = 500
"""Default number of output intervals with step-size control."""
_TEXTS = {
    "live": "--live: {found}: expected a scene",
    "until": "--until is missing; expected the end of the simulated time in seconds, as in ephs run {file} --until 5",
    "no-journal": f"{{file}}: no {JOURNAL} in it; expected the result folder of a run that was interrupted",
    "own": "{file}: its model is {scene}; Python files run only when named on the command line: "
    "ephs run {scene} --until {until!r} --out {file} --resume",
    "kept": f"{{found}} holds an unfinished run; it is kept as {JOURNAL}.old (--resume would have continued it)",
    "numbered": "{folder} has the results of a run; this one goes to {found} (--replace writes over them)",
    "numbered-journal": "{folder} has an unfinished run; this one goes to {found} (--resume continues that one, "
    "--replace begins anew there)",
    "both": "--resume and --replace: found both, expected one of them",
    "ended": "{folder}: that run has reached its end already",
    "other": "{folder}: found results of another run with {key} = {found}, expected {wanted}; "
    "give another --out, or --replace in place of --resume",
    "again": "continue with: ephs run {folder} --resume",
}


def run(
    scene: str,
    /,
    *,
    until: Positive = None,
    stepping: Stepping = AS_CHOSEN,
    keep: Annotated[int | None, Parameter(validator=lambda _, n: _counted(n))] = None,
    initial: list[str] | None = None,
    out: Annotated[Path | None, Parameter(name=["--out", "-o"])] = None,
    report: bool = True,
    live: bool = False,
    resume: bool = False,
    replace: bool = False,
    audit: Literal["fail", "warn", "off"] = "fail",
    loading: LoadOptions = AS_GIVEN,
) -> int:
    """Simulate a scene and write its result folder.

    Parameters
    ----------
    scene
        Scene file (.toml), model (.urdf, .xml, .sdf), or FILE.py:NAME; with --resume also the result folder of an
        interrupted run.
    until
        End of the simulated time in seconds.
    keep
        Number of equal intervals at whose ends results are kept. Default: 500; every step with --step.
    initial
        Initial value of a state, PATH=NUMBER or PATH=NUMBER,NUMBER,...; may be given several times.
    out
        Result folder. Default: out/NAME. One with results is kept as it is, and NAME-2, NAME-3, ... is written.
    report
        Write report.html into the result folder.
    live
        Write live.html, too: a page that simulates the scene while its sliders for masses, stiffnesses and frictions
        move.
    resume
        Continue an interrupted run in its result folder.
    replace
        Write over the results in the result folder.
    audit
        Treatment of audit findings: fail ends with exit code 4, warn prints them, off records them in the summary.
    """
    import ephs

    if resume and replace:
        raise BadInput(_TEXTS["both"])
    if resume and Path(scene).is_dir():
        return _run_on(Path(scene), audit, report=report)
    if until is None:
        raise BadInput(_TEXTS["until"].format(file=scene))
    model = load_model(scene, loading)
    if isinstance(model, ephs.Scene):
        from ephs.mechanics.constraints.plausible import doubts

        for doubt in doubts(model):
            complain(f"{scene}: {doubt}")
    if live:
        _require_live(model, scene)
    name = model.name if isinstance(model, ephs.Scene) else scene.rpartition(":")[2]
    folder = out or Path("out", name)
    if not (resume or replace):
        folder = _free(folder)
    with addressed(scene, folder):
        folder.mkdir(parents=True, exist_ok=True)
    asked: dict[str, Any] = {"until": until, **stepping.options()}
    if initial:
        asked["initial"] = initial_values(initial)
    if stepping.step is None or keep is not None:  # controlled steps may be too long for smooth pictures
        asked["keep"] = keep or KEPT
    if resume and not (folder / JOURNAL).exists() and _ended(folder, _identity(model, scene, asked)):
        say(_TEXTS["ended"].format(folder=folder))
        return 0
    if replace and (folder / JOURNAL).exists():
        with addressed(scene, folder):
            os.replace(folder / JOURNAL, folder / f"{JOURNAL}.old")
        complain(_TEXTS["kept"].format(found=folder / JOURNAL))
    code = _simulate(model, scene, folder, asked, audit, report=report)
    if live:
        _write_live(model, scene, folder / "live.html", until)
    return code


def _free(folder: Path) -> Path:
    """The folder itself, or the first of FOLDER-2, FOLDER-3, … that has no results."""
    found, number = folder, 1
    while any((found / name).exists() for name in RESULTS):
        number += 1
        found = folder.with_name(f"{folder.name}-{number}")
    if number > 1:
        case = "numbered-journal" if (folder / JOURNAL).exists() else "numbered"
        complain(_TEXTS[case].format(folder=folder, found=found))
    return found


def _require_live(model: "Scene | System", scene: str) -> None:
    """Refuse, before the run, what no page that simulates can be made of, and without its compiler."""
    import ephs
    from ephs.exporting.linking import require_tools

    if not isinstance(model, ephs.Scene):
        raise BadInput(_TEXTS["live"].format(found=scene))
    with addressed(scene):
        require_tools("WebAssembly")


def _write_live(model: Any, scene: str, page: Path, until: float) -> None:
    """Write a page that simulates."""
    import ephs

    with addressed(scene, page):
        ephs.live_page(model, until=until).save(page)
    say(f"live: {page}")


def _run_on(folder: Path, audit: str, *, report: bool) -> int:
    """Continue the interrupted run of a result folder; its model is in the journal."""
    from ephs.mechanics.runs.system_text import is_system_text
    from ephs.mechanics.scene.document import scene_from_text
    from ephs.solve.running.journal import read_journal

    file = folder / JOURNAL
    if not file.is_file() and (folder / "solution.nc").is_file():
        say(_TEXTS["ended"].format(folder=folder))
        return 0
    if not file.is_file():
        raise BadInput(_TEXTS["no-journal"].format(file=folder))
    with addressed(str(file)):
        heading = read_journal(file).heading
    note = heading["note"]
    if not heading["model"] or is_system_text(heading["model"]):
        raise BadInput(_TEXTS["own"].format(file=folder, scene=note["scene"], until=note["asked"]["until"]))
    return _simulate(scene_from_text(heading["model"]), note["scene"], folder, note["asked"], audit, report=report)


def _simulate(
    model: "Scene | System", scene: str, folder: Path, asked: Mapping[str, Any], audit: str, *, report: bool
) -> int:
    """Simulate with a journal, write the results; the exit code."""
    import ephs
    from ephs.solve.running.journal import Journal

    options = dict(asked)
    until, parts = options.pop("until"), options.pop("keep", None)
    if parts is not None:
        options["save_at"] = [until * k / parts for k in range(parts + 1)]
    journal = Journal(folder / JOURNAL, {"scene": scene, "asked": asked})
    name = model.name if isinstance(model, ephs.Scene) else scene.rpartition(":")[2]
    try:
        with addressed(scene, folder), progress_bar(name) as progress:
            solution = ephs.simulate(model, until, progress=progress, journal=journal, audit="off", **options)
    except ephs.SimulationError as error:
        if error.partial is None:
            raise BadInput(naming(scene, str(error))) from error
        stopped, begun = isinstance(error, ephs.Interrupted), len(error.partial.t) > 0
        if stopped:
            at = f" at t = {error.partial.t[-1]:.6g} s" if begun else ""
            complain(TEXTS["interrupted"].format(file=scene, at=at))
        else:
            complain(TEXTS["failed"].format(file=scene, found=error))
        if not begun:  # the initial state already failed
            return 130 if stopped else 3
        with addressed(scene, folder):
            _write(error.partial, folder, report=report)
        complain(f"saved what was computed: {folder}")
        if stopped:
            complain(_TEXTS["again"].format(folder=folder))
        return 130 if stopped else 3
    with addressed(scene, folder):
        _write(solution, folder, report=report)
        whole = json.dumps(_identity(model, scene, asked), indent=1)
        (folder / RUN).write_text(f"{whole}\n", encoding="utf-8")
        (folder / JOURNAL).unlink(missing_ok=True)
    findings = solution.audit.findings if audit != "off" else ()
    for finding in findings:
        complain(TEXTS["audit"].format(file=scene, found=finding))
    return 4 if findings and audit == "fail" else 0


def _identity(model: "Scene | System", scene: str, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Identity of a run; of code the name only."""
    import ephs
    from ephs.mechanics.scene.document import scene_to_text

    text = scene_to_text(model) if isinstance(model, ephs.Scene) else scene
    return json.loads(json.dumps({**asked, "model": hashlib.blake2b(text.encode(), digest_size=16).hexdigest()}))


def _ended(folder: Path, wanted: Mapping[str, Any]) -> bool:
    """Whether a folder contains complete results of this run.

    Raises
    ------
    BadInput
        They are those of another run.
    """
    try:
        found = json.loads((folder / RUN).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    if not isinstance(found, dict):
        return False
    for key in (*wanted, *found):
        if found.get(key) != wanted.get(key):
            told = {"folder": folder, "key": key, "found": found.get(key), "wanted": wanted.get(key)}
            raise BadInput(_TEXTS["other"].format(**told))
    return True


def _write(solution: "Solution", folder: Path, *, report: bool) -> None:
    """Write the result folder and suggest next commands."""
    written = write_results(solution, folder, report=report)
    if len(solution.t) > 1:  # else nothing moved
        say("next:", *after(folder, moves=solution.outline is not None, report=written))


def _counted(parts: int | None) -> None:
    if parts is not None and parts < 1:
        raise ValueError(f"found {parts}, expected a number of parts, at least 1")
