"""Systems that are rewritten, and what a rewrite keeps."""

from hypothesis import strategies as st

import ephs
from ephs import Pattern, junction, library, quantity
from ephs.mechanics.elements import components
from ephs.mechanics.rewrite.rewrite import sites_of
from ephs.semantics.systems.laws import random_probe
from tests.numerics import generators

__all__ = ["in_order", "lever_networks", "levers", "same_relation"]


def same_relation(before, after, seed):
    """Equal relations at a random state, within the error bounds."""
    probe = random_probe(before, seed)
    state = {str(path): value for path, value in probe.state.items()}
    # the arguments of an Onsager matrix whose ports were folded would be others: there they are zero
    kept = dict(after.leaves())
    efforts = {
        path: probe.efforts[path] for path, part in before.leaves() if kept.get(path) is part and path in probe.efforts
    }
    one, other = (system.relation(probe.reference).at(state, efforts=efforts) for system in (before, after))
    assert one.same(other)


def in_order(system, rules, rng):
    """Rewritten site by site in a random order until none is left."""
    done = system.flatten()
    while sites := [site for rule in rules for site in sites_of(done, rule) if not site.refusal]:
        done = sites[int(rng.integers(len(sites)))].apply(done).system
    return done


@st.composite
def lever_networks(draw, loops=False):
    """Levers and friction between junctions, some of which store momentum or are outer ports, one may stand still."""
    rng = draw(generators)
    count = draw(st.integers(2, 6))
    roles = [draw(st.sampled_from(["plain", "plain", "stored", "open"])) for _ in range(count)]
    junctions = {f"j{i}": junction(quantity.momentum, exposed=role == "open") for i, role in enumerate(roles)}
    boxes, parts = {}, {}
    for i, role in enumerate(roles):
        if role == "stored":
            boxes[f"mass{i}"], parts[f"mass{i}"] = {"p": f"j{i}"}, library.point_mass(m=float(rng.uniform(0.5, 2.0)))
        if draw(st.booleans()):
            junctions[f"s{i}"] = junction(quantity.entropy)
            boxes[f"rub{i}"], parts[f"rub{i}"] = (
                {"p": f"j{i}", "s": f"s{i}"},
                library.friction(d=float(rng.uniform(0.1, 1.0))),
            )
            boxes[f"env{i}"], parts[f"env{i}"] = {"s": f"s{i}"}, library.environment()
    for k in range(draw(st.integers(count, count + 2)) if loops else count - 1):
        a = draw(st.integers(0, count - 1)) if k >= count - 1 else k + 1
        b = draw(st.integers(0, count - 1)) if k >= count - 1 else draw(st.integers(0, k))
        boxes[f"lever{k}"] = {"x": f"j{a}", "y": f"j{b}"}
        parts[f"lever{k}"] = lever(float(rng.choice([1.0, rng.uniform(0.5, 2.0)])))
    if draw(st.booleans()):
        boxes["still"], parts["still"] = {"p": "j0"}, components.ground(quantity.momentum)
    return Pattern(junctions=junctions, boxes=boxes)(parts)


def lever(ratio):
    return ephs.transformer({"x": quantity.momentum, "y": quantity.momentum}, [[ratio]])


def levers(more="", said="", **parts):
    """A mass, a lever of 3, a junction b with what a test puts on it, and a lever of 1/2 to friction."""
    text = f"a: momentum; b: momentum{said}; c: momentum; s: entropy; mass(p=a); first(x=a, y=b); second(x=b, y=c); "
    made = {"mass": library.point_mass(m=2.0), "first": lever(3.0), "second": lever(0.5)}
    made |= {"rub": library.friction(d=0.4), "env": library.environment()}
    return Pattern.from_text(f"{text}rub(p=c, s); env(s){more}")(made | parts)
