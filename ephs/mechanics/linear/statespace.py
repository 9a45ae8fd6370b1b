"""A model linearised about a state, as a value."""

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Number
from pathlib import Path as File
from typing import TYPE_CHECKING, Any, final

import numpy as np

from ephs.mechanics.linear.modes import Complex, Mode, modes_of
from ephs.mechanics.linear.structure import MeasuredLaw, PortHamiltonian, Sizes, laws_of
from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import OptionError

if TYPE_CHECKING:
    from ephs.solve.result.solution import Solution


@final
@dataclass(frozen=True, slots=True, eq=False)
class StateSpace:
    """ẋ = A x + B u, y = C x + D u: small changes x of the independent states, u of the inputs, y of the outputs.

    Parameters
    ----------
    name
        The model's.
    A, B, C, D
        (n, n), (n, m), (p, n), (p, m).
    states, inputs, outputs
        Names of the entries: a state's path, with its number in brackets where it has several.
    structure
        The port-Hamiltonian structure; None where the state is no equilibrium that stores exergy.
    reason
        Why there is no structure; empty where there is.
    shapes
        Name -> (d, n): what the states do to joints, bodies, or states of a system.
    about
        Path -> value of the system's states where it was linearised.
    play
        Makes a `Solution` that moves along some displacement of the states, see `film`; None where that cannot be.
    sizes
        What B, C and D were solved together with.
    """

    name: str
    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    structure: PortHamiltonian | None
    reason: str
    shapes: Mapping[str, Array]
    about: Mapping[str, Array]
    play: Any
    sizes: Sizes

    def _repr_html_(self) -> str:  # pyright: ignore[reportUnusedFunction] - notebooks call it
        from ephs.show.notebook import state_space_html

        return state_space_html(self)

    @property
    def J(self) -> Array | None:
        """(n, n) skew, of the structure."""
        return None if self.structure is None else self.structure.J

    @property
    def R(self) -> Array | None:
        """(n, n) symmetric, not negative, of the structure."""
        return None if self.structure is None else self.structure.R

    @property
    def Q(self) -> Array | None:
        """(n, n) the Hessian of the exergy, of the structure."""
        return None if self.structure is None else self.structure.Q

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes, slowest first; one for each conjugate pair."""
        return modes_of(self.A, self.shapes)

    @property
    def eigenvalues(self) -> Complex:
        """(n,) in 1/s, in the order of the modes."""
        found: list[complex] = []
        for mode in self.modes:
            found += (
                [mode.eigenvalue] if mode.eigenvalue.imag == 0.0 else [mode.eigenvalue, mode.eigenvalue.conjugate()]
            )
        return np.array(found, dtype=complex)

    @property
    def stable(self) -> bool:
        """Whether no mode grows."""
        return all(mode.stable for mode in self.modes)

    @property
    def laws(self) -> tuple[MeasuredLaw, ...]:
        """The laws of the structure; none where there is no structure."""
        if self.structure is None:
            return ()
        return laws_of(
            self.A, self.B, self.C, self.D, self.structure, self.sizes, conjugate=self.inputs == self.outputs
        )

    def transfer(self, s: complex) -> Complex:
        """(p, m) the transfer matrix C (s − A)⁻¹ B + D at a complex frequency in 1/s.

        Raises
        ------
        OptionError
            It is an eigenvalue, or no finite number.
        """
        if not isinstance(s, Number) or isinstance(s, bool) or not np.isfinite(s):
            raise OptionError("s", s, "one complex number in 1/s")
        try:
            through = np.linalg.solve(s * np.eye(len(self.A)) - self.A, self.B)
        except np.linalg.LinAlgError:
            raise OptionError("s", s, "a number beside the eigenvalues, at which the response is infinite") from None
        return np.asarray(self.C @ through + self.D, dtype=complex)

    def film(
        self, mode: Mode | int, *, amplitude: float = 0.3, periods: float = 1.0, frames: int = 61, decay: bool = False
    ) -> "Solution":
        """A mode superposed on the state, as a `Solution` that `ephs.show.animate` plays.

        Parameters
        ----------
        mode
            A mode, or its number.
        amplitude
            Of the joint (or state) that moves most: rad, m, or its unit.
        periods
            How long: periods of the oscillation, time constants of what only decays or grows, seconds else.
        frames
            Instants.
        decay
            Whether it decays or grows as it does; else it swings on.

        Raises
        ------
        OptionError
            There is no such mode, or an option is no number.
        """
        from ephs.mechanics.linear.film import film

        return film(self, mode, amplitude, periods, frames, decay)

    def save(self, path: "str | File") -> None:
        """Write the matrices: a file .json, .npz or .nc.

        Raises
        ------
        OptionError
            The ending is another one.
        """
        from ephs.mechanics.linear.file import save

        save(self, File(path))

    def __str__(self) -> str:
        lines = [f"{self.name}: {len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"]
        lines.append(f"  states: {', '.join(self.states) or 'none'}")
        lines.append(f"  inputs: {', '.join(self.inputs) or 'none'}")
        lines.append("  structure: ẋ = (J − R) Q x + B u" if self.structure else f"  structure: none, {self.reason}")
        lines.append(f"  {'eigenvalue 1/s':>26}{'Hz':>12}{'damping':>10}  moves most")
        for mode in self.modes:
            value = mode.eigenvalue
            text = f"{value.real:.6g}" + (f" ± {value.imag:.6g}i" if value.imag else "")
            most = ", ".join(f"{name} {share:.2f}" for name, share in mode.largest())
            ratio = "" if np.isnan(mode.damping) else f"{mode.damping:.4f}"
            lines.append(f"  {text:>26}{mode.frequency:>12.6g}{ratio:>10}  {most}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"StateSpace({self.name!r}: {len(self.states)} states, {len(self.inputs)} inputs)"
