"""Models of gymnasium and example-robot-data, imported with limits and contacts: what each keeps and loses."""

import warnings
from importlib.metadata import PackageNotFoundError, files
from importlib.util import find_spec
from pathlib import Path

import ephs

__all__ = ["table"]

HEAD = (
    "model", "bodies", "DoF", "actuators", "dry friction", "armatures", "ratios", "surfaces", "contacts",
    "not modelled",
)  # fmt: skip
LOST = "not modelled: "


def models() -> list[Path]:
    """MJCF of gymnasium; URDF and SDF of example-robot-data where it is installed, `pip install ephs[real]`."""
    spec = find_spec("gymnasium")
    folders = [] if spec is None else list(spec.submodule_search_locations or [])
    found = [path for folder in folders for path in sorted(Path(folder, "envs/mujoco/assets").glob("*.xml"))]
    try:
        robots = files("example-robot-data") or []
    except PackageNotFoundError:
        robots = []
    return found + sorted(Path(str(file.locate())) for file in robots if file.name.endswith((".urdf", ".sdf")))


def row(path: Path) -> tuple[str, ...]:
    """Counts of what a model keeps, and of what it loses by kind."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            scene = ephs.load(path, contact=True)
        except ephs.SceneError as error:
            return path.name, *[""] * (len(HEAD) - 2), f"refused: {str(error).splitlines()[-1].strip()}"
    lines = [line for each in said if isinstance(each.message, ephs.ModelWarning) for line in each.message.lines]
    lost = [line.removeprefix(LOST) for line in lines if line.startswith(LOST)]
    joints = [joint for _, joint in scene.all_joints()]
    counts = (
        len(scene.bodies), sum(j.dim for j in joints), len(scene.actuators), sum(j.dry is not None for j in joints),
        sum(j.armature > 0.0 for j in joints), len(scene.gears), len(scene.surfaces),
        len(scene.contacts),
    )  # fmt: skip
    told = ", ".join(f"{line.count(',') + 1} {_kind(line)}" for line in lost)
    return path.name, *(str(count or "") for count in counts), told


def _kind(line: str) -> str:
    return line.partition(":")[0].partition(" that ")[0].removesuffix(" of")


def table() -> str:
    """A row a model, as Markdown."""
    rows = [HEAD, ("---",) * len(HEAD), *map(row, models())]
    return "\n".join(f"| {' | '.join(each)} |" for each in rows)
