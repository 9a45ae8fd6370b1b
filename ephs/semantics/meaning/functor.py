"""The functor F: the relation of a pattern, and gluing by it. This is the definition of composition, and the only one.

F(f) is a relation between variables at the ports of the boxes and at the outer ports of f. To fill boxes is

    (F(f) ∩ ⊕ parts) projected to what is not inside,

whether the parts are relations of components, of systems or of patterns. Hence one formula composes systems,
substitutes patterns, F(f ∘ g) = F(f) ∘ F(g), and takes a step of time. A table says what a pattern says of each kind of
variable, so that the formula serves other numbers at ports, too.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias, final

from ephs.operad import Path, Pattern, PortType
from ephs.semantics.meaning.fields import Field, Row
from ephs.semantics.meaning.linear import LinearRelation
from ephs.semantics.meaning.variables import RelationVariable, Role, at_port, into

_Port: TypeAlias = tuple[float, Path | None, Path, PortType]
"""Sign of its flow in the balance, box or None at the interface, port and what it is."""


@final
@dataclass(frozen=True, slots=True)
class Theory:
    """Junction rules by kind of variable: balance or equality.

    Parameters
    ----------
    balanced
        Kinds whose variables add up to zero, the outer one counting negative.
    shared
        Kinds of which there is one variable.
    states
        Whether all ports that show one state are together; else the power ports on one junction.
    """

    balanced: tuple[str, ...]
    shared: tuple[str, ...]
    states: bool = False


POWER = Theory(("flow",), ("effort",))


def relation_of_pattern(
    field: Field[Any], pattern: Pattern, inside: Role = "inner", theory: Theory = POWER
) -> LinearRelation:
    """F(f): at each junction flows balance and efforts are shared, or what another theory says.

    Parameters
    ----------
    inside
        The role of variables at boxes: ``"met"`` of boxes that are being filled.
    """
    ports: list[tuple[Path, bool, _Port]] = [
        (wire.junction, wire.power, (1.0, box, port, content.interface[port]))
        for box, content in pattern.boxes.items()
        for port, wire in content.ports.items()
    ]
    ports += [(port, described.power, (-1.0, None, port, described)) for port, described in pattern.interface.items()]
    together: dict[Path, list[_Port]] = {}
    for junction, power, port in ports:
        if theory.states or power:
            place = min(pattern.state_class(junction)) if theory.states else junction
            together.setdefault(place, []).append(port)
    variables: list[RelationVariable] = []
    rows: list[Row[Any]] = []
    for group in together.values():
        signs = [sign for sign, *_ in group]
        for kind in (*theory.balanced, *theory.shared):
            balanced = kind in theory.balanced
            # by places of the vector
            for each in zip(*(_variables_at(inside, kind, where) for where in group), strict=True):
                variables += each
                if balanced:
                    rows.append(field.exact(dict(zip(each, signs, strict=True))))
                else:
                    rows += [field.exact({each[0]: 1.0, other: -1.0}) for other in each[1:]]
    return LinearRelation.of(field, variables, rows)


def _variables_at(inside: Role, kind: str, where: _Port) -> list[RelationVariable]:
    _, box, port, described = where
    if box is None:
        return at_port("outer", kind, port, described.quantity)
    return at_port(inside, kind, port, described.quantity, box)


def filled(whole: LinearRelation, parts: Mapping[Path, LinearRelation]) -> LinearRelation:
    """Put relations into boxes: (whole ∩ ⊕ parts), without what lies at the filled boxes."""
    return _composed(
        whole.renamed(lambda v: v._replace(role="met") if v.role == "inner" and v.box in parts else v), parts
    )


def _composed(whole: LinearRelation, parts: Mapping[Path, LinearRelation]) -> LinearRelation:
    """(whole ∩ ⊕ parts), without the variables at which they met."""
    inside = [part.renamed(lambda v, box=box: into(box, v)) for box, part in parts.items()]
    joined = whole.join(*inside)
    return joined.without(v for v in joined.variables if v.role == "met")


def glued(
    field: Field[Any], pattern: Pattern, parts: Mapping[Path, LinearRelation], theory: Theory = POWER
) -> LinearRelation:
    """(F(f) ∩ ⊕ parts) projected to the outer ports."""
    return _composed(relation_of_pattern(field, pattern, "met", theory), parts)


def power(relation: LinearRelation) -> dict[RelationVariable, tuple[RelationVariable, int]]:
    """The form Σ e f over inner ports less outer ports: each variable's partner and sign."""
    other = {"flow": "effort", "effort": "flow"}
    return {v: (v._replace(kind=other[v.kind]), -1 if v.role == "outer" else 1) for v in relation.variables}


def is_dirac(relation: LinearRelation) -> bool:
    """Whether a relation of flows and efforts is its own orthogonal: it makes and loses no power, and is maximal."""
    return relation.same(relation.orthogonal(power(relation)))
