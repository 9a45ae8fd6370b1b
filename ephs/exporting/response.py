"""Readings of a motion as a function of a model's numbers, with exact derivatives: for PyTorch and for JAX."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.exporting.errors import ExportError
from ephs.mechanics.scene.model import Scene
from ephs.mechanics.scene.parameters import read, varied
from ephs.mechanics.sensitivity.readings import reading_of
from ephs.mechanics.sensitivity.sensitivity import Sensitivity, sensitivity
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.systems.system import System

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@final
@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """Readings of a motion at some times as a function of numbers of its model.

    Parameters
    ----------
    model
        The scene or the system.
    parameters
        Paths of the numbers, p of them.
    outputs
        Names of the readings.
    until
        The end of the motion in s.
    options
        Further arguments of `ephs.sensitivity`; readings are taken at the times of ``save_at``.
    start
        (p,) the model's own numbers.
    size
        How many readings there are: in the order of the outputs, of the times, of the components.
    """

    model: Scene | System
    parameters: tuple[str, ...]
    outputs: tuple[str, ...]
    until: float
    options: Mapping[str, Any]
    start: Array
    size: int

    def __call__(self, values: "ArrayLike") -> Array:
        """(size,) the readings where the numbers are ``values`` (p,)."""
        return self.linearised(values)[0]

    def linearised(self, values: "ArrayLike") -> tuple[Array, Array]:
        """(size,) the readings and (size, p) their derivatives where the numbers are ``values`` (p,).

        Raises
        ------
        ExportError
            There are not p numbers.
        SceneError, SimulationError
            A number is out of its range; the run failed.
        """
        given = np.asarray(values, dtype=float)
        if given.shape != self.start.shape:
            raise ExportError("values", found=given.shape, expected=self.start.shape)
        model: Any = self.model
        model = varied(model, dict(zip(self.parameters, given.tolist(), strict=True)))
        return _readings(sensitivity(model, self.parameters, self.until, **self.options), self.outputs)


def response(
    model: Scene | System,
    parameters: Sequence[str],
    outputs: Sequence[str],
    until: float,
    *,
    save_at: "ArrayLike | None" = None,
    **options: Any,
) -> Response:
    """Readings of a motion as a function of numbers of its model, evaluated once at the model's own numbers.

    Parameters
    ----------
    parameters, outputs
        Paths as `ephs.sensitivity` takes them, and names of readings as it gives them: ``joints.pin.coordinate``.
    save_at
        Times of the readings in s; left out, the end.
    options
        Further arguments of `ephs.sensitivity`, such as ``method`` and ``step``. With chosen steps their lengths change
        with the numbers: a derivative is exact for those of its own run, and differences see the tolerance.

    Raises
    ------
    OptionError, SimulationError
        As `ephs.sensitivity`.
    """
    options = {**options, "save_at": [until] if save_at is None else save_at}
    found, _ = _readings(sensitivity(model, parameters, until, **options), outputs)
    start = np.array([read(model, path) for path in parameters])
    return Response(model, tuple(parameters), tuple(outputs), until, options, start, found.size)


def _readings(found: Sensitivity, outputs: Sequence[str]) -> tuple[Array, Array]:
    """(m,) readings and (m, p) their derivatives."""
    values = [np.asarray(reading_of(found.model, name)(found.solution)).ravel() for name in outputs]
    slopes = [found[name].reshape(-1, len(found.paths)) for name in outputs]
    return np.concatenate(values), np.concatenate(slopes)


def torch_function(of: Response) -> Callable[[Any], Any]:
    """The response as a function of a PyTorch tensor (p,) of double precision, which `torch.autograd` differentiates.

    One run gives values and derivatives; second derivatives are refused by PyTorch.

    Raises
    ------
    ExportError
        PyTorch is not installed; where it is called, the tensor is of another precision.
    """
    try:
        import torch  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ExportError("tool", what="torch_function", tool="PyTorch", package="torch") from None
    from torch.autograd.function import once_differentiable  # pyright: ignore[reportMissingImports]

    torch: Any = torch

    class Differentiable(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, values: Any) -> Any:
            if values.dtype != torch.float64:
                raise ExportError("double", where="torch_function", found=values.dtype)
            found, slope = of.linearised(values.detach().cpu().numpy())
            ctx.save_for_backward(torch.from_numpy(slope).to(values.device))
            return torch.from_numpy(found).to(values.device)

        @staticmethod
        @once_differentiable
        def backward(ctx: Any, cotangent: Any) -> Any:
            (slope,) = ctx.saved_tensors
            return cotangent @ slope

    return Differentiable.apply


def jax_function(of: Response) -> Callable[[Any], Any]:
    """The response as a function of a JAX array (p,) of double precision, for `jax.jit`, `jax.jvp` and `jax.grad`.

    Values and derivatives come from a run in Python each time that they are asked for; `jax.vmap` runs one after the
    other. Second derivatives are refused by JAX.

    Raises
    ------
    ExportError
        JAX is not installed, or its arrays are of single precision.
    """
    try:
        import jax  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise ExportError("tool", what="jax_function", tool="JAX", package="jax") from None
    jax: Any = jax
    if not jax.config.jax_enable_x64:
        raise ExportError(
            "double", where="jax_function", found='float32: call jax.config.update("jax_enable_x64", True)'
        )
    readings = jax.ShapeDtypeStruct((of.size,), np.float64)
    slopes = jax.ShapeDtypeStruct((of.size, of.start.size), np.float64)

    def run(values: Any) -> tuple[Array, Array]:
        return of.linearised(np.asarray(values))

    @jax.custom_jvp
    def function(values: Any) -> Any:
        return jax.pure_callback(lambda x: run(x)[0], readings, values, vmap_method="sequential")

    @function.defjvp
    def _(primals: tuple[Any, ...], tangents: tuple[Any, ...]) -> tuple[Any, Any]:
        found, slope = jax.pure_callback(run, (readings, slopes), primals[0], vmap_method="sequential")
        return found, slope @ tangents[0]

    return function
