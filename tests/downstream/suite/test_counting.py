import counting
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ephs.testing import (
    check_algebra,
    check_algebra_map,
    check_entropy_production,
    check_functoriality,
    check_natural,
    check_operad_laws,
    check_power_balance,
    interfaces,
    mechanisms,
    nestings,
    patterns,
    quantities,
    systems,
)

settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")


@given(nestings(max_depth=2))
def test_power_ports_are_those_of_the_boxes_that_are_left(nesting):
    whole = nesting.flatten()
    filled = nesting.children
    left = [content for box, content in nesting.pattern.boxes.items() if box not in filled]
    open_ports = sum(port.power for content in left for port in content.ports.values())
    assert counting.power_ports(whole) == open_ports + sum(
        counting.power_ports(child.flatten()) for child in filled.values()
    )


@given(patterns(min_boxes=1, max_boxes=2))
def test_bounds_are_kept(pattern):
    assert 1 <= counting.boxes(pattern) <= 2


@given(systems())
def test_flattening_keeps_the_dissipators(system):
    assert counting.dissipators(system.flatten()) == counting.dissipators(system)


@settings(max_examples=10)
@given(mechanisms(max_bodies=2))
def test_mechanisms_have_mass(scene):
    assert counting.mass(scene) >= 0.0


@given(interfaces(max_ports=2), quantities())
def test_interfaces_and_quantities(interface, quantity):
    assert len(interface) <= 2 and quantity.matches(quantity)


def types():
    from ephs import Pattern, Quantity, System

    return Pattern, Quantity, System


@settings(max_examples=20)
@given(st.data())
def test_registered_types(data):
    for kind in types():
        assert isinstance(data.draw(st.from_type(kind)), kind)


@settings(max_examples=20)
@given(systems())
def test_the_laws_of_systems(system):
    check_functoriality(system)
    check_power_balance(system)
    check_entropy_production(system)


@settings(max_examples=3)
@given(systems(max_depth=1))
def test_the_discrete_functor(system):
    check_natural(system)


def test_the_laws_of_patterns():
    check_operad_laws(max_examples=5)


def test_an_algebra_and_a_map_of_ones_own():
    def leaf(interface):
        return st.integers(0, 3).map(lambda count: counting.Boxes(interface, count))

    check_algebra(counting.BOXES, leaf, max_examples=5)
    check_algebra_map(counting.TWICE, leaf, max_examples=5)
