"""`export`: a model as a program without Python, in one file or two."""

from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path

from ephs.exporting.errors import ExportError
from ephs.exporting.image import image_of
from ephs.exporting.linking import webassembly
from ephs.exporting.module import Exported, exported
from ephs.mechanics.scene.model import Scene
from ephs.semantics.stage.ctext import c_text
from ephs.semantics.stage.llvm import compile_text
from ephs.semantics.stage.objects import TARGETS, emitted
from ephs.semantics.systems.system import System
from ephs.solve.result.durable import durable
from ephs.solve.running.control import ATOL, RTOL


def export(
    model: Scene | System,
    file: str | PathLike[str],
    *,
    name: str | None = None,
    inputs: Sequence[str] = (),
    parameters: Sequence[str] = (),
    method: str = "rk87",
    rtol: float = RTOL,
    atol: float = ATOL,
    step: float | None = None,
    until: float = 10.0,
    target: str | None = None,
) -> Exported:
    """Write a mechanism as a program that needs no Python: its motion from its initial state, bit for bit.

    Parameters
    ----------
    file
        ``.c``: C text; ``.o``: object code; both with a header ``.h`` beside it, which lists inputs and outputs.
        ``.wasm``: WebAssembly, whose functions are those of the header.
    name
        Prefix of the names of its functions; default: the file's name.
    inputs
        Joints, as ``joints.pin``, with inputs: forces in N or N m on their free coordinates; actuators of the scene, as
        ``actuators.servo``, with their controls.
    parameters
        Paths of numbers that can be changed at the start, as ``bodies.rod.mass``. The program's numbers must be
        polynomials of degree 2 in them, so that nothing is approximated.
    method, rtol, atol, step
        As for `ephs.simulate`: rk54 or rk87.
    until
        Time in s over which the error should stay within the tolerances; the program can run longer.
    target
        Machine of object code, of `ephs.semantics.stage.objects.TARGETS`; default: this one.

    Returns
    -------
    Exported
        Names, places and units of inputs and outputs, and the module's text.

    Raises
    ------
    ExportError
        The model, the name of the file or an option does not allow it.
    """
    path = Path(file)
    writers: dict[str, Callable[[Exported], bytes]] = {
        ".c": lambda made: c_text(made.text).encode(),
        ".o": lambda made: emitted(made.text, target) if target else compile_text(made.text),
        ".wasm": webassembly,
    }
    if path.suffix not in writers:
        raise ExportError("suffix", found=path.name, expected=", ".join(writers))
    if target is not None and (path.suffix != ".o" or target not in TARGETS):
        raise ExportError("target", found=target, expected=", ".join(TARGETS) + ", with a file .o")
    image = image_of(
        model, inputs=inputs, parameters=parameters, method=method, rtol=rtol, atol=atol, step=step, until=until
    )
    made = exported(image, name or path.stem.replace("-", "_"))
    with durable(path) as temporary:
        temporary.write_bytes(writers[path.suffix](made))
    if path.suffix != ".wasm":
        with durable(path.with_suffix(".h")) as temporary:
            temporary.write_text(made.header(), encoding="utf-8")
    return made
