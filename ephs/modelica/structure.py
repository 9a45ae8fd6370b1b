"""The structure of a linear relation: f = (S + A) e + Cᵀλ, 0 = C e, with S ⪰ 0 and A skew, in exactly one way.

A relation on which the power e·f is never negative, of half the dimension, is of that form [1]_: the efforts are those
of a subspace, whose annihilator is what flows may have besides, and the rest is a bilinear form on it. S is an Onsager
structure, A and C are a Dirac structure.

References
----------
.. [1] A. van der Schaft, D. Jeltsema, Port-Hamiltonian Systems Theory: An Introductory Overview, 2014, chapter 4.
"""

from dataclasses import dataclass
from typing import final

from ephs.modelica.errors import ModelicaError
from ephs.modelica.expressions import Expr, Matrix, Symbol, sp
from ephs.modelica.relation import PortRelation
from ephs.semantics.spaces.decompositions import symmetric_eigen


@final
@dataclass(frozen=True, slots=True)
class PortStructure:
    """S (N, N) symmetric and non-negative, A (N, N) skew, C (r, N), of N ports and storages."""

    loss: Matrix
    skew: Matrix
    constraint: Matrix


def power_of(relation: PortRelation, hessian: Matrix) -> Matrix:
    """The quadratic form of the dissipated power e·f − xᵀH ẋ."""
    form = relation.efforts.T * relation.flows - relation.values.T * hessian * relation.rates
    return ((form + form.T) / 2).applyfunc(sp.cancel)


def stored_energy(name: str, relation: PortRelation, warm: dict[Symbol, Expr]) -> Matrix:
    """H (k, k) of the energy ½ xᵀHx for which the remaining power has one sign.

    Where states rest, or are zero, the power does not depend on H; what is zero there for every value of another
    variable is so for all: a non-negative form whose value at a vector is zero has no products with it.

    Raises
    ------
    ModelicaError
        There is none, or more than one.
    """
    k, states = len(relation.states), ", ".join(each.symbol.name for each in relation.states)
    unknown = {(i, j): sp.Symbol(f"H{i}{j}") for i in range(k) for j in range(i, k)}
    hessian = sp.Matrix(k, k, lambda i, j: unknown[min(i, j), max(i, j)])
    if not k:
        return hessian
    for still in (relation.values, relation.rates):
        form = power_of(relation, hessian)
        inside = _kernel(still)
        if not inside.shape[1]:
            continue
        within = (inside.T * form * inside).applyfunc(sp.cancel)
        lossless = inside * _kernel(within.subs(warm))
        conditions = [entry for entry in (form * lossless).applyfunc(sp.cancel) if entry != 0]
        left = sorted(hessian.free_symbols, key=str)
        found = sp.linsolve(conditions, *left) if conditions and left else {tuple(left)}
        if not found or (conditions and not left):
            raise ModelicaError("stored", where=name, states=states, equation=relation.laws)
        (solution,) = found
        hessian = hessian.subs(dict(zip(left, solution, strict=True)))
    if hessian.free_symbols:
        raise ModelicaError("undetermined", where=name, states=states)
    if not hessian.is_positive_definite:
        raise ModelicaError("unstable", where=name, states=states, found=hessian.tolist())
    return hessian


def structure_of(name: str, relation: PortRelation, hessian: Matrix, warm: dict[Symbol, Expr]) -> PortStructure:
    """S, A and C over the ports, then the storages.

    Raises
    ------
    ModelicaError
        The component makes energy.
    """
    form = power_of(relation, hessian)
    if not form.subs(warm).is_positive_semidefinite:
        raise ModelicaError("power", where=name, equation=relation.laws, **_witness(relation, form.subs(warm)))
    values, rates = [], []
    stored = hessian * relation.values, hessian * relation.rates
    for row, state in enumerate(relation.states):
        values.append(relation.values[row, :] if state.effort else stored[0][row, :])
        rates.append(-stored[1][row, :] if state.effort else -relation.rates[row, :])
    efforts = sp.Matrix.vstack(relation.efforts, *values)
    flows = sp.Matrix.vstack(relation.flows, *rates)
    size = efforts.rows
    _, pivots = efforts.rref()
    span, beside = efforts[:, list(pivots)], flows[:, list(pivots)]
    inverse = span * (span.T * span).inv() if pivots else sp.zeros(size, 0)
    form = (inverse * (span.T * beside) * inverse.T).applyfunc(sp.cancel)
    constraint = _kernel(span.T).T if pivots else sp.eye(size)
    loss = ((form + form.T) / 2).applyfunc(sp.cancel)
    return PortStructure(loss, ((form - form.T) / 2).applyfunc(sp.cancel), constraint)


def _kernel(matrix: Matrix) -> Matrix:
    """Columns that span the null space of a matrix."""
    found = matrix.nullspace() if matrix.rows else [*sp.eye(matrix.cols).columnspace()]
    return sp.Matrix.hstack(sp.zeros(matrix.cols, 0), *found)


def _witness(relation: PortRelation, form: Matrix) -> dict[str, object]:
    """A positive power, and a point (values of ports and states) at which it occurs."""
    import numpy as np

    _, vectors = symmetric_eigen(np.array(form.tolist(), dtype=float))
    least = sp.Matrix(vectors[:, 0] / np.abs(vectors[:, 0]).max())
    rows = [(port.potential, port.domain.position, relation.efforts[row, :]) for row, port in enumerate(relation.ports)]
    said = [f"{'der(' * at}{symbol}{')' * at} = {float((row * least)[0]):.4g}" for symbol, at, row in rows]
    said += [f"{p.flow} = {float((relation.flows[row, :] * least)[0]):.4g}" for row, p in enumerate(relation.ports)]
    return {"found": -float((least.T * form * least)[0]), "witness": ", ".join(said)}
