"""Units are products of powers: their dimensions add up, whatever the spelling."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.operad import PatternError, quantity
from ephs.operad.units import dimension, effort_unit, flow_unit

POWERS = st.dictionaries(st.sampled_from(["kg", "m", "s", "A", "K", "mol", "bit"]), st.integers(-4, 4), max_size=5)
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def spelled(powers, style, split):
    """The product, with what is negative behind a stroke if so asked."""

    def factor(base, power):
        return f"{base}{str(power).translate(RAISED) if style else f'^{power}'}"

    above = " ".join(factor(b, p) for b, p in powers.items() if p > 0 or not split) or "1"
    below = " ".join(factor(b, -p) for b, p in powers.items() if p < 0)
    return f"{above}/({below})" if split and below else above


@given(POWERS, st.booleans(), st.booleans())
def test_a_product_is_read_as_it_was_meant(powers, style, split):
    assert dict(dimension(spelled(powers, style, split))) == {base: power for base, power in powers.items() if power}


@given(POWERS, POWERS)
def test_dimensions_are_a_group(one, other):
    first, second = spelled(one, True, True), spelled(other, False, False)
    product, quotient = dict(dimension(f"({first})·({second})")), dict(dimension(f"({first})/({second})"))
    for base in {*one, *other}:
        assert product.get(base, 0) == one.get(base, 0) + other.get(base, 0)
        assert quotient.get(base, 0) == one.get(base, 0) - other.get(base, 0)


@pytest.mark.parametrize(
    ("derived", "base"),
    [("W", "J/s"), ("J", "N m"), ("N", "kg m/s²"), ("Pa", "N/m²"), ("V", "W/A"), ("Wb", "V s"), ("C", "A s"),
     ("F", "C/V"), ("H", "Wb/A"), ("Ω", "V/A"), ("S", "1/Ω"), ("T", "Wb/m²"), ("Hz", "1/s"), ("rad", "1"), ("", "1"),
     ("m3", "m³")],
)  # fmt: skip
def test_derived_units_are_what_they_are_derived_from(derived, base):
    assert dimension(derived) == dimension(base)


@pytest.mark.parametrize("q", [getattr(quantity, word) for word in quantity.__dataclass_fields__], ids=str)
def test_flow_times_effort_is_a_power(q):
    if q.unit:
        assert dimension(f"({flow_unit(q.unit)}) ({effort_unit(q.unit)})") == dimension("W")
        assert dimension(f"({flow_unit(q.unit)}) s") == dimension(q.unit)
    assert quantity.pose.unit == "" == flow_unit("") == effort_unit("")


def test_known_products_have_their_names():
    found = {unit: (flow_unit(unit), effort_unit(unit)) for unit in ("m", "C", "m³", "Pa s", "mol", "bit/m")}
    assert found == {
        "m": ("m/s", "N"),
        "C": ("A", "V"),
        "m³": ("m³/s", "Pa"),
        "Pa s": ("Pa", "m³/s"),
        "mol": ("mol/s", "J/mol"),
        "bit/m": ("(bit/m)/s", "J/(bit/m)"),
    }


@pytest.mark.parametrize("text", ["/s", "kg/", "(m", "m)", "m**", "m·", "2 m", "m^", "kg//s", "()/", "€", "m ^2"])
def test_what_is_no_product_is_refused(text):
    with pytest.raises(PatternError, match="product of powers"):
        dimension(text)
