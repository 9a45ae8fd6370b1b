"""`export_fmu`: a mechanism as a unit of FMI 3.0 for co-simulation, for several machines at once, without Python."""

import hashlib
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from importlib.resources import files
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final
from xml.etree import ElementTree
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from ephs.exporting.errors import ExportError
from ephs.exporting.image import ImageNumber, image_of
from ephs.exporting.linking import tool
from ephs.exporting.module import Exported, exported
from ephs.mechanics.scene.model import Scene
from ephs.semantics.stage.objects import emitted
from ephs.semantics.systems.system import System
from ephs.solve.result.durable import durable
from ephs.solve.running.control import ATOL, RTOL

PLATFORMS: Final[Mapping[str, tuple[str, str, str]]] = {
    "x86_64-linux": ("linux-x86-64-v2", "x86_64-linux-gnu", ".so"),
    "aarch64-linux": ("linux-arm64", "aarch64-linux-gnu", ".so"),
    "x86_64-windows": ("windows-x86-64", "x86_64-windows-gnu", ".dll"),
    "x86_64-darwin": ("macos-x86-64", "x86_64-macos", ".dylib"),
    "aarch64-darwin": ("macos-arm64", "aarch64-macos", ".dylib"),
}
"""Platforms by their names in FMI: target of object code, name for the linker, suffix of libraries."""
_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
"""Time stamp of all files in a unit, for reproducible bytes."""


def export_fmu(
    model: Scene | System,
    file: str | PathLike[str],
    *,
    inputs: Sequence[str] = (),
    parameters: Sequence[str] = (),
    outputs: Sequence[str] = (),
    method: str = "rk87",
    rtol: float = RTOL,
    atol: float = ATOL,
    step: float | None = None,
    until: float = 10.0,
    platforms: Sequence[str] = tuple(PLATFORMS),
) -> Exported:
    """Write a mechanism as a unit of FMI 3.0 for co-simulation.

    Parameters
    ----------
    file
        A name that ends in ``.fmu``.
    inputs, parameters, method, rtol, atol, step, until
        As of `ephs.export`.
    outputs
        Names of outputs, or beginnings of such, as ``joints.bearing``; left out, all.
    platforms
        Machines, of `PLATFORMS`.

    Raises
    ------
    ExportError
        The model or an option does not allow it, or there is no linker.
    """
    path = Path(file)
    if path.suffix != ".fmu":
        raise ExportError("suffix", found=path.name, expected=".fmu")
    for platform in platforms:
        if platform not in PLATFORMS:
            raise ExportError("target", found=platform, expected=", ".join(PLATFORMS))
    image = image_of(
        model, inputs=inputs, parameters=parameters, method=method, rtol=rtol, atol=atol, step=step, until=until
    )
    made = exported(image, path.stem.replace("-", "_"))
    shown = made.chosen(outputs) if outputs else made.outputs
    token = f"{{{hashlib.sha256(made.text.encode()).hexdigest()[:32]}}}"
    description = _description(made, shown, token, (until, rtol))
    libraries = {platform: _library(made, token, *PLATFORMS[platform]) for platform in platforms}
    with durable(path) as temporary, ZipFile(temporary, "w", ZIP_DEFLATED) as unit:
        unit.writestr(_file("modelDescription.xml"), description)
        unit.writestr(_file("documentation/diagnostics.txt"), made.header())
        for platform, code in libraries.items():
            unit.writestr(_file(f"binaries/{platform}/{made.name}{PLATFORMS[platform][2]}"), code)
    return made


def _file(name: str) -> ZipInfo:
    found = ZipInfo(name, _EPOCH)
    found.compress_type = ZIP_DEFLATED
    return found


def _description(made: Exported, shown: Sequence[ImageNumber], token: str, experiment: tuple[float, float]) -> bytes:
    root = ElementTree.Element(
        "fmiModelDescription", fmiVersion="3.0", modelName=made.name, instantiationToken=token,
        generationTool=f"ephs {version('ephs')}", variableNamingConvention="flat",
    )  # fmt: skip
    ElementTree.SubElement(
        root, "CoSimulation", modelIdentifier=made.name, canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUState="true", canSerializeFMUState="true",
    )  # fmt: skip
    units = ElementTree.SubElement(root, "UnitDefinitions")
    bases: dict[str, dict[str, str]] = {"m": {"m": "1"}, "J": {"kg": "1", "m": "2", "s": "-2"}}
    for unit, base in bases.items():
        ElementTree.SubElement(ElementTree.SubElement(units, "Unit", {"name": unit}), "BaseUnit", base)
    until, rtol = experiment
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stopTime=repr(until), tolerance=repr(rtol))
    variables = ElementTree.SubElement(root, "ModelVariables")
    structure = ElementTree.SubElement(root, "ModelStructure")

    def add(name: str, reference: int, **more: str) -> None:
        ElementTree.SubElement(variables, "Float64", {"name": name, "valueReference": str(reference), **more})

    add("time", 0, causality="independent", variability="continuous")
    for k, each in enumerate(made.inputs):
        add(each.name, 1 + k, causality="input", variability="continuous", start=repr(each.start))
    for k, each in enumerate(made.parameters):
        place = 1 + len(made.inputs) + k
        add(each.name, place, causality="parameter", variability="fixed", start=repr(each.start))
    first = 1 + len(made.inputs) + len(made.parameters)
    for each in shown:
        told = {"unit": each.unit} if each.unit else {}
        add(each.name, first + each.place, causality="output", variability="continuous", **told)
    for each in shown:  # of the state alone, never of the inputs at the same instant
        ElementTree.SubElement(structure, "Output", valueReference=str(first + each.place), dependencies="")
    for each in shown:
        ElementTree.SubElement(structure, "InitialUnknown", valueReference=str(first + each.place))
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def _library(made: Exported, token: str, target: str, triple: str, suffix: str) -> bytes:
    """Object code and its FMI wrapper, as a shared library for a machine."""

    def listed(values: Sequence[float]) -> str:
        return "".join(f"{value!r}," for value in values)

    defined = {
        "MODEL": made.name, "TOKEN": f'"{token}"', "BYTES": made.bytes, "INPUTS": len(made.inputs),
        "PARAMETERS": len(made.parameters), "OUTPUTS": len(made.outputs),
        "INPUT_STARTS": listed([each.start for each in made.inputs]),
        "PARAMETER_STARTS": listed([each.start for each in made.parameters]),
        "FUNCTIONS": listed(made.functions),
    }  # fmt: skip
    with TemporaryDirectory() as name:
        folder = Path(name)
        shell, code, library = folder / "unit.c", folder / "model.o", folder / f"{made.name}{suffix}"
        head = "".join(f"#define {key} {value}\n" for key, value in defined.items())
        shell.write_text(head + files("ephs.exporting").joinpath("assets", "fmi3.c").read_text(encoding="utf-8"))
        code.write_bytes(emitted(made.text, target))
        tool("an FMU", "cc", "-target", triple, "-shared", "-O2", "-g0", "-s", "-w", shell, code, "-o", library)
        return library.read_bytes()
