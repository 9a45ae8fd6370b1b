"""Proofs of structures: evidence that is found by expansion or with SymPy, and kept on disk; replay decides on it."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from ephs.semantics.derive.recording import Untraceable
from ephs.semantics.stage.known import known
from ephs.semantics.symbols.bounds import signs
from ephs.semantics.symbols.terms import Term
from ephs.semantics.verdicts.checks import STATEMENTS
from ephs.semantics.verdicts.claims import Claim, claim_of
from ephs.semantics.verdicts.replay import EXPANSION, Replay, replayed
from ephs.semantics.verdicts.sums import Unexpandable
from ephs.semantics.verdicts.verdict import OPEN, Condition, Evidence, as_evidence, plain

if TYPE_CHECKING:
    from ephs.semantics.primitives.primitives import Primitive
    from ephs.semantics.symbols.signs import Signs


def conditions_of(primitive: "Primitive") -> tuple[Condition, ...]:
    """The conditions on a primitive that has a formula, each with its proof or without one.

    Proofs hold for all numbers of the same signs. Those of formulas of this package are kept on disk by formula, ports
    and signs of the parameters; formulas of users are proved anew in each process.
    """
    formula = primitive.formula
    assert formula is not None
    ports = (primitive.kind, dict(primitive.interface.items()), primitive.reads, primitive.domain)

    def prove() -> dict[str, list[Any]]:
        try:
            return {statement: plain(each) for statement, each in evidence_of(claimed(primitive)).items()}
        except (Untraceable, Unexpandable):
            return {}

    found = known(("proofs", ports, formula, signs_of(primitive)), prove)
    return tuple(
        Condition(statement, statement in found, as_evidence(found.get(statement, OPEN)))
        for statement in STATEMENTS[primitive.kind]
    )


def proof_of(primitive: "Primitive") -> dict[str, Any]:
    """What proves the conditions on a primitive, as data that `replay` checks: statement -> evidence of lists."""
    known = {"expansion", "signs", "squares", "rounding"}
    return {c.statement: plain(c.how) for c in primitive.verdict.conditions if c.proved and c.how[0] in known}


def replay(primitive: "Primitive", proof: Mapping[str, object]) -> frozenset[str]:
    """The statements that a proof shows of a primitive, by expansion and signs alone; nothing is searched.

    Parameters
    ----------
    proof
        As of `proof_of`: of a structure without states, of its numbers; else of its formula, for all numbers with the
        signs of its parameters.
    """
    from ephs.semantics.verdicts.constant import numbers_of

    if primitive.kind == "reversible" and not primitive.reads:
        claim = numbers_of(primitive)
    elif primitive.formula is None:
        return frozenset()
    else:
        try:
            claim = claimed(primitive)
        except Untraceable:
            return frozenset()
    return replayed(claim, {statement: as_evidence(each) for statement, each in proof.items()})


def signs_of(primitive: "Primitive") -> dict[str, int]:
    """The sign of each parameter of a formula."""
    given = dict(primitive.parameters)
    names = primitive.formula.parameters if primitive.formula is not None else ()
    return {name: int(np.sign(float(str(given[name])))) for name in names}


def claimed(primitive: "Primitive") -> Claim:
    """What is proved: of all numbers with the signs of the parameters."""
    return claim_of(primitive, signs_of(primitive))


def evidence_of(claim: Claim) -> dict[str, Evidence]:
    """Statement -> what proves it, where that is found.

    Raises
    ------
    Unexpandable
        The formulas have no expansion.
    """
    on = Replay(claim)
    search = {("storage", 3): _warm, ("irreversible", 1): _squares}
    found: dict[str, Evidence] = {}
    for place, statement in enumerate(STATEMENTS[claim.kind]):
        tried = search.get((claim.kind, place), _expanded)(on)
        with suppress(Unexpandable):
            for evidence in tried:
                if on.proves(statement, evidence[0], evidence[1:]):
                    found[statement] = evidence
                    break
    return found


def _expanded(_: Replay) -> Iterator[Evidence]:
    yield EXPANSION


def _warm(on: Replay) -> Iterator[Evidence]:
    """Terms that show that temperatures are positive: as given, expanded, or rewritten by SymPy."""
    claim = on.claim
    hot = [place for place, hot in enumerate(claim.hot) if hot]
    if claim.gradient is not None:
        yield ("signs", tuple(claim.gradient[place] for place in hot))
    slopes = on.derivative()
    terms = tuple(on.term(slopes[place]) for place in hot)
    yield ("signs", terms)
    rewritten = [_signs(claim).shown(term, strict=True) for term in terms]
    if all(term is not None for term in rewritten):
        yield ("signs", tuple(rewritten))


def _squares(on: Replay) -> Iterator[Evidence]:
    """M = Σ d v vᵀ by elimination along the diagonal: of formulas as written or expanded, or with SymPy."""
    n = len(on.claim.parity)
    rest, left, found = on.rows, list(range(n)), list[tuple[Term, tuple[Term, ...]]]()
    written: tuple[Term, ...] = on.claim.outputs
    while left:
        for pivot in left:
            place = pivot * n + pivot
            shown = next((d for d in (written[place], on.term(rest[place])) if _not_negative(d, on.claim)), None)
            if shown is not None and rest[place]:
                vector, rest = on.eliminated(rest, pivot)
                found.append((shown, tuple(map(on.term, vector))))
                left.remove(pivot)
                written = tuple(map(on.term, rest))
                break
        else:
            break
    if not any(rest):
        yield ("squares", tuple(found))
    squares = _signs(on.claim).squares(on.claim.outputs)
    if squares is not None:
        yield ("squares", squares)


def _not_negative(term: Term, claim: Claim) -> bool:
    return -1 not in signs(term, claim.bounds)


def _signs(claim: Claim) -> "Signs":
    from ephs.semantics.symbols.signs import Signs

    return Signs(claim.bounds)
