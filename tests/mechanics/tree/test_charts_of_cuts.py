"""Records of cut joints."""

from ephs.mechanics.tree import cuts, loops


def test_the_width_of_charts_is_that_of_their_record():
    assert loops.CHART == cuts.Chart.integer_width
