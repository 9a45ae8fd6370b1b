"""A mechanism linearised in joint coordinates.

Small motions about a state are η, increments of a choice of independent degrees of freedom, and ρ, of their rates: the
tree's joints move by δq = Z η (left-trivialised) and change their rates by δr = Z ρ + Y η, so that loops stay closed
and prescribed joints follow their motion. Degrees of freedom are chosen so that Z, the identity on them, is small: by
pivots of the constraints' rows in the mass metric. With δq' = δr − ad_r δq the derivatives of `Dynamics` give A.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import final

import numpy as np

from ephs.mechanics.dynamics import Derivatives, Dynamics, State
from ephs.mechanics.linear.freedoms import freedoms_of, unbalanced
from ephs.mechanics.linear.ports import Ports
from ephs.mechanics.linear.statespace import StateSpace
from ephs.mechanics.linear.structure import PortHamiltonian, Sizes
from ephs.mechanics.scene.errors import did_you_mean, listing
from ephs.operad import Path
from ephs.semantics.bundles.bundle import Array
from ephs.semantics.spaces.decompositions import least_squares, symmetric_eigenvalues
from ephs.semantics.spaces.rank import ELIMINATION
from ephs.semantics.spaces.rotations import hat
from ephs.solve.equations.heats import exponential_law
from ephs.solve.equations.model import model_of
from ephs.solve.methods.stored import StoredEnergies
from ephs.solve.posing.errors import OptionError
from ephs.solve.result.replay import replay
from ephs.solve.result.solution import Solution
from ephs.solve.running.stepping import Row

BALANCED = 1e-7
"""Largest unbalanced fraction of the applied forces at an equilibrium."""
ROUNDED = 1e-9
"""Relative asymmetry allowed in a stiffness: rounding of chains of differentiated poses."""


def linear_mechanism(
    model: Dynamics,
    state: State,
    inputs: Sequence[str] | None,
    outputs: Sequence[str] | None,
    points: Mapping[str, tuple[str, Array]] | None,
) -> StateSpace:
    """See `ephs.linearize`.

    Parameters
    ----------
    points
        Names of points of bodies, each with its body and place there; None where the ports and states of the system
        are meant, too, and inputs are these ports by default.
    """
    return _LinearisedMotion(model, state, inputs, outputs, points).whole()


@final
@dataclass(frozen=True, slots=True, eq=False)
class _PortRates:
    """A port: (d, n) its rates by the tree's, (d, n) their derivatives by the configuration at the state's rates, and
    whether its place is meant, not its rate.
    """

    jacobian: Array
    turning: Array
    of_place: bool


@final
class _LinearisedMotion:
    """Data shared by the parts of one linearisation."""

    def __init__(
        self,
        model: Dynamics,
        state: State,
        inputs: Sequence[str] | None,
        outputs: Sequence[str] | None,
        points: Mapping[str, tuple[str, Array]] | None,
    ) -> None:
        self.model, self.state = model, state
        self.free = freedoms_of(model, state)
        self.k, self.n = self.free.which.size, model.layout.n
        _, self.r, _ = _split(model, state)
        self.moving = bool(np.any(self.r))
        self.velocities = model.velocity_derivatives(self.state)
        self.motors = model.layout.attached
        d = model.problem.descriptor
        stores = {state.path: storage for slot, storage in d.storages for state in slot.reads}
        self.stores = [stores[path] for path in model.layout.entropies]
        self.nodes = [i for i, store in enumerate(self.stores) if i in self.motors or not store.environment]
        self.ad = self._ad()
        self.turned = self._turned()
        self.points, self.bodies = points or {}, tuple(model.bodies(state))
        prescribed = {name for name, of in model.layout.edges.items() if any(edge.motion for _, edge in of)}
        default = tuple(f"joints.{name}" for name in model.joints if name not in prescribed and self._dim(name))
        self.system: Ports | None = None
        self.pushed: dict[str, tuple[str, slice]] = {}
        if points is None:
            edges = [(name, edge) for name, of in model.layout.edges.items() for _, edge in of if edge.port is not None]
            moved = frozenset(edge.port for _, edge in edges if edge.port is not None and edge.motion is not None)
            self.system = Ports(model.problem, d.pack(model.states(state)), self._embedded(), moved)
            self.pushed = {str(edge.port): (name, edge.freedoms) for name, edge in edges if edge.port not in moved}
            default = self.system.names
        self.inputs = default if inputs is None else tuple(inputs)
        self.outputs = self.inputs if outputs is None else tuple(outputs)

    # ---- the states --------------------------------------------------------------------------------------------

    def _dim(self, joint: str) -> int:
        return int(self.model.layout.freedoms[joint].size)

    def _ad(self) -> Array:
        """(n, n) ad_r, joint by joint."""
        out = np.zeros((self.n, self.n))
        for name, parts in self.model.layout.edges.items():
            where, at = self.model.layout.freedoms[name], 0
            for _, edge in parts:
                own = where[at : at + edge.pair.dim]
                at += edge.pair.dim
                if own.size and own[0] < self.n:
                    out[np.ix_(own, own)] = edge.pair.manifold.ad(self.r[own])
        return out

    def _embedded(self) -> dict[Path, Array]:
        """State of the system -> (d, states) what the states do to it."""
        still = len(self.nodes)
        out = {
            path: np.hstack(
                [by_place @ self.free.Z + by_rate @ self.turned, by_rate @ self.free.Z, np.zeros((len(by_rate), still))]
            )
            for path, (by_place, by_rate) in self.model.state_derivatives(self.state).items()
        }
        warm = np.eye(2 * self.k + still)[2 * self.k :]
        return out | {self.model.layout.entropies[i]: warm[j : j + 1] for j, i in enumerate(self.nodes)}

    def _turned(self) -> Array:
        """(n, k) Y: how the dependent rates change with the configuration while the independent ones do not."""
        out = np.zeros((self.n, self.k))
        found = self.model.constraints(self.state)
        if not (self.moving and found.rank):
            return out
        dependent = np.setdiff1d(np.arange(self.n), self.free.which)
        change = self.velocities.rows @ self.free.Z
        out[dependent] = -least_squares(found.rows[:, dependent], change, part=ELIMINATION)
        return out

    # ---- the matrices ------------------------------------------------------------------------------------------

    def whole(self) -> StateSpace:
        """The linear system."""
        Z, Y, E = self.free.Z, self.turned, self.free.which
        by = self.model.derivatives(self.state)
        A = np.zeros((2 * self.k + len(self.nodes),) * 2)
        place, rate, warm = slice(0, self.k), slice(self.k, 2 * self.k), slice(2 * self.k, None)
        A[place, place] = -(self.ad @ Z)[E]
        A[place, rate] = np.eye(self.k)
        A[rate, place] = (by.acceleration_q @ Z + by.acceleration_r @ Y)[E]
        A[rate, rate] = (by.acceleration_r @ Z)[E]
        A[rate, warm] = by.acceleration_s[E][:, self.nodes]
        A[warm, place] = (by.entropy_q @ Z + by.entropy_r @ Y)[self.nodes]
        A[warm, rate] = (by.entropy_r @ Z)[self.nodes]
        A[warm, warm] = by.entropy_s[np.ix_(self.nodes, self.nodes)]
        B, names_in = self._driven(by.acceleration_force)
        C, D, names_out = self._outputs(B.shape[1])
        structure, reason, A = self._structure(A, by)
        return StateSpace(
            self.model.name, A, B, C, D, self._names(), names_in, names_out,
            structure, reason, MappingProxyType(self._shapes()),
            MappingProxyType({str(path): value for path, value in self.model.states(self.state).items()}),
            partial(_play, self), Sizes.of(B, C, D),
        )  # fmt: skip

    def _driven(self, by_force: Array) -> tuple[Array, tuple[str, ...]]:
        """B, and the names of its columns."""
        columns, names = [np.zeros((2 * self.k + len(self.nodes), 0))], list[str]()
        for name in self.inputs:
            if (system := self._attached(name)) is not None:
                columns.append(system.given(name))
            else:
                port = self._port(name)
                if port.of_place:
                    raise OptionError("inputs", name, "a joint, a body or a marker")
                force = by_force @ port.jacobian.T
                still = np.zeros((self.k, force.shape[1])), np.zeros((len(self.nodes), force.shape[1]))
                columns.append(np.vstack([still[0], force[self.free.which], still[1]]))
            names += _numbered(name, columns[-1].shape[1])
        return np.hstack(columns), tuple(names)

    def _outputs(self, width: int) -> tuple[Array, Array, tuple[str, ...]]:
        """C, D, and the names of their rows."""
        rows, through, names = [np.zeros((0, 2 * self.k + len(self.nodes)))], [np.zeros((0, width))], list[str]()
        for name in self.outputs:
            known = {} if self.system is None else self.system.states
            if (system := self._attached(name)) is not None:
                rows.append(system.seen(name))
                through.append(self._through(system, name, width))
            else:
                rows.append(known[name] if name in known else self._seen(self._port(name)))
                through.append(np.zeros((len(rows[-1]), width)))
            names += _numbered(name, len(rows[-1]))
        return np.vstack(rows), np.vstack(through), tuple(names)

    def _attached(self, name: str) -> Ports | None:
        """The ports of the system where a name is one of them, and none of a joint."""
        own = self.system
        return own if own is not None and name in own.names and name not in self.pushed else None

    def _through(self, system: Ports, seen: str, width: int) -> Array:
        """(d, width) the power conjugate at a port by all inputs: forces change no rate at once."""
        out, at = np.zeros((len(system.seen(seen)), width)), 0
        for name in self.inputs:
            if self._attached(name) is not None:
                here = system.through(seen, name)
                out[:, at : at + here.shape[1]] = here
                at += here.shape[1]
            else:
                at += len(self._port(name).jacobian)
        return out

    def _seen(self, port: "_PortRates") -> Array:
        """Rows of C of a displacement, or of a rate."""
        here, warm = port.jacobian, np.zeros((port.jacobian.shape[0], len(self.nodes)))
        if port.of_place:
            return np.hstack([here @ self.free.Z, np.zeros((here.shape[0], self.k)), warm])
        return np.hstack([here @ self.turned + port.turning @ self.free.Z, here @ self.free.Z, warm])

    def _port(self, name: str) -> "_PortRates":
        """A port by its name."""
        if name in self.pushed:
            joint, part = self.pushed[name]
            whole = self._port(f"joints.{joint}")
            return _PortRates(whole.jacobian[part], whole.turning[part], of_place=False)
        kind, _, rest = name.partition(".")
        words = {"joints": ".coordinate", "bodies": ".position", "markers": ".position"}
        model = self.model
        known = {
            "joints": [n for n in model.joints if self._dim(n)],
            "bodies": self.bodies,
            "markers": tuple(self.points),
        }
        for suffix in ("", words.get(kind, "")):
            own = rest.removesuffix(suffix) if rest.endswith(suffix) else rest
            if own in known.get(kind, ()) and (own + suffix == rest):
                if kind == "joints":
                    jacobian = self._joint(own)
                    turning = self.velocities.joints.get(own, np.zeros_like(jacobian))
                    return _PortRates(jacobian, turning, bool(suffix))
                if kind == "markers":
                    return self._point(*self.points[own], of_place=bool(suffix))
                if suffix:
                    return self._point(own, np.zeros(3), of_place=True)
                return _PortRates(model.jacobian(self.state, own), self.velocities.bodies[own], of_place=False)
        every = [f"{key}.{n}" for key, found in known.items() for n in found]
        every += [] if self.system is None else [*self.system.names, *self.system.states]
        hint = did_you_mean(name, every, f"such as {listing(every)}")
        raise OptionError("port", name, f"the name of a joint, body or marker with a quantity; {hint}")

    def _joint(self, name: str) -> Array:
        """(d, n) a joint's rates by the tree's: some of them, or of a joint that closes a loop what they do to it."""
        where = self.model.layout.freedoms[name]
        if name not in self.model.cut or where[0] < self.n:
            return np.eye(self.n)[where]
        q, _, s = _split(self.model, self.state)
        columns = [self.model.unpack(np.concatenate([q, unit, s])).rates[name] for unit in np.eye(self.n)]
        return np.array(columns).T

    def _point(self, body: str, at: Array, *, of_place: bool) -> "_PortRates":
        """A point of a body: its velocity R (v + ω × at) in the world."""
        jacobian, by_twist = self.model.jacobian(self.state, body, at), self.model.jacobian(self.state, body)
        turn = self.model.bodies(self.state)[body].rotation
        (w, v), (dw, dv) = np.split(by_twist @ self.r, 2), np.split(self.velocities.bodies[body], 2)
        change = dv - hat(at) @ dw - hat(v + np.cross(w, at)) @ by_twist[:3]
        return _PortRates(jacobian, turn @ change, of_place)

    # ---- energy and dissipation --------------------------------------------------------------------------------

    def _structure(self, A: Array, by: Derivatives) -> tuple[PortHamiltonian | None, str, Array]:
        """The structure, or why there is none; and A, which with a structure is (J − R) Q to rounding."""
        if self.moving:
            return None, "the mechanism moves in this state", A
        if self.motors:
            return None, "motors give power in this state", A
        off = unbalanced(self.model, self.state, self.free, by.force_q)
        if off > BALANCED:
            return None, f"{off:.1e} of the forces is not balanced in this state", A
        k = self.k
        place, rate, warm = slice(0, k), slice(k, 2 * k), slice(2 * k, None)
        M = self.free.Z.T @ by.force_a @ self.free.Z
        K, still = -M @ A[rate, place], np.linalg.inv(M)
        if np.abs(K - K.T).max(initial=0.0) > ROUNDED * np.abs(K).max(initial=0.0):
            return None, "the forces in this state have no potential", A
        if np.abs(A[warm, place]).max(initial=0.0) > 0.0 or np.abs(A[rate, warm]).max(initial=0.0) > 0.0:
            return None, "heat acts on the motion in this state", A
        Q, J, R = np.zeros_like(A), np.zeros_like(A), np.zeros_like(A)
        Q[place, place], Q[rate, rate] = 0.5 * (K + K.T), M
        J[place, rate], J[rate, place] = still, -still
        drag = A[rate, rate] @ still
        J[rate, rate], R[rate, rate] = 0.5 * (drag - drag.T), -0.5 * (drag + drag.T)
        if self.nodes:
            heat = np.array([self._warming(i) for i in self.nodes])
            Q[warm, warm] = np.diag(heat)
            flow = -A[warm, warm] / heat
            if np.abs(flow - flow.T).max() > ROUNDED * np.abs(flow).max():
                return None, "the thermal nodes are not in equilibrium", A
            R[warm, warm] = 0.5 * (flow + flow.T)
        least = symmetric_eigenvalues(R).min(initial=0.0)
        if least < -ROUNDED * np.abs(R).max(initial=0.0):
            return None, "what dissipates in this state is not a friction", A
        return PortHamiltonian(J, R, Q), "", (J - R) @ Q

    def _warming(self, entropy: int) -> float:
        """dθ/ds of a thermal node in K²/J."""
        law = exponential_law(self.stores[entropy])
        assert law is not None
        c1, c2 = law
        return c1 / c2**2 * float(np.exp(_split(self.model, self.state)[2][entropy] / c2))

    # ---- names and shapes --------------------------------------------------------------------------------------

    def _names(self) -> tuple[str, ...]:
        """The names of the states: coordinates, rates, entropies."""
        of: dict[int, tuple[str, str]] = {}
        for name, where in self.model.layout.freedoms.items():
            for i, at in enumerate(where.tolist()):
                of[at] = name, f"[{i}]" if where.size > 1 else ""
        chosen = [of[int(i)] for i in self.free.which]
        return tuple(
            [f"joints.{name}.{key}{number}" for key in ("coordinate", "rate") for name, number in chosen]
            + [str(self.model.layout.entropies[i]) for i in self.nodes]
        )

    def _shapes(self) -> Mapping[str, Array]:
        """Derivatives of the places of joints and bodies by the states."""
        rest = np.zeros((self.n, self.k + len(self.nodes)))
        whole = np.hstack([self.free.Z, rest])
        model = self.model
        out = {f"joints.{name}": self._joint(name) @ whole for name in model.joints if self._dim(name)}
        out |= {f"bodies.{name}": model.jacobian(self.state, name) @ whole for name in model.bodies(self.state)}
        warm = np.eye(2 * self.k + len(self.nodes))[2 * self.k :]
        return out | {str(model.layout.entropies[i]): warm[j : j + 1] for j, i in enumerate(self.nodes)}


def _split(model: Dynamics, state: State) -> tuple[Array, Array, Array]:
    return model.layout.split(state.array)


def _numbered(name: str, count: int) -> list[str]:
    return [f"{name}[{i}]" for i in range(count)] if count > 1 else [name]


def _play(linear: _LinearisedMotion, t: Array, moved: Array) -> Solution:
    """The mechanism along some displacements (frames, states) of the state."""
    problem = linear.model.problem
    model = model_of(problem, 0.0)
    stored, rows = StoredEnergies(model), list[Row]()
    for row in moved:
        at = linear.model.moved(linear.state, linear.free.Z @ row[: linear.k])
        q, _, s = _split(linear.model, at)
        at = linear.model.unpack(np.concatenate([q, linear.free.Z @ row[linear.k : 2 * linear.k], s]))
        x = problem.descriptor.pack(linear.model.states(linear.model.closed(at)))
        rows.append(Row(x, stored.energies(x), np.zeros(4)))
    return replay(problem, t, rows, "mode")
