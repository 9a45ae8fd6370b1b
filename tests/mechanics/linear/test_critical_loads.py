"""Critical loads of chains and trusses in closed form, whatever the load that ends the path."""

import numpy as np
import pytest

import ephs

HEAD = "format = 1\n[world]\ngravity = [0.0, 0.0, 0.0]\n"
LINK = """
[bodies.link{i}]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
position = [0.0, 0.0, {top}]
[joints.hinge{i}]
type = "revolute"
bodies = [{below}, "link{i}"]
at = [0.0, 0.0, {i}]
axis = [0.0, 1.0, 0.0]
stiffness = {stiffness}
"""
BARS = """
[bodies.hinge]
mass = 1.0
inertia = [0.01, 0.01, 0.01]
position = [0.0, 0.0, {height}]
[joints.up]
type = "prismatic"
bodies = ["ground", "hinge"]
at = [0.0, 0.0, {height}]
axis = [0.0, 0.0, 1.0]
"""
BAR = """
[springs.bar{side}]
bodies = ["ground", "hinge"]
at1 = [{side}, 0.0, 0.0]
at2 = [0.0, 0.0, 0.0]
stiffness = {stiffness}
length = {length!r}
"""
COLUMN = """
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [1.0, 0.0, 0.0]
up = [0.0, 0.0, 1.0]
elements = {elements}
section = {{ EA = 1e7, GA = [4e6, 4e6], GJ = 80.0, EI = {bending}, rhoA = 1.0, rhoI = [2e-4, 1e-4, 1e-4] }}
ends = ["ground", "free"]
"""


def critical(tmp_path, text, body, force):
    """Critical forces (k,) in N on the way to a force along z, or along the axis x of a column."""
    file = tmp_path / "critical.toml"
    load = f'[loads.end]\nbody = "{body}"\nforce = {[float(x) for x in force]}\n'
    file.write_text(HEAD + text + load, encoding="utf-8")
    return np.array(ephs.equilibrium(ephs.load(file)).critical) * np.sum(force)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("beyond", [1.05, 20.0])
def test_columns_of_links_lose_their_stiffness_at_each_load_of_theirs(count, beyond, tmp_path):
    """Links of length 1 with springs k: det(k B − P) = 0, B tridiagonal in the links' angles, of 1 at the last one."""
    stiffness = 10.0
    bending = 2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    bending[-1, -1] = 1.0
    right = stiffness * np.linalg.eigvalsh(bending)
    text = "".join(
        LINK.format(i=i, top=i + 1.0, stiffness=stiffness, below=f'"link{i - 1}"' if i else '"ground"')
        for i in range(count)
    )
    end = -beyond * right[-1]
    found = critical(tmp_path, text, f"link{count - 1}", [0.0, 0.0, end])
    assert -found == pytest.approx(right, rel=1e-8)


@pytest.mark.parametrize("end", [-10.0, -100.0])
def test_two_bars_snap_through_at_their_limit_loads(end, tmp_path):
    """Springs k between supports at ±1 and a hinge at a height: the load is ±2 k (L^⅔ − 1)^1.5 at its limits."""
    stiffness, height = 1000.0, 0.3
    length = float(np.hypot(1.0, height))
    limit = 2.0 * stiffness * (length ** (2.0 / 3.0) - 1.0) ** 1.5
    bars = [BAR.format(side=side, stiffness=stiffness, length=length) for side in (-1, 1)]
    found = critical(tmp_path, BARS.format(height=height) + "".join(bars), "hinge", [0.0, 0.0, end])
    assert found == pytest.approx([-limit, limit], rel=1e-8)


@pytest.mark.parametrize("bending", [(100.0, 300.0), (100.0, 100.0)])
def test_a_clamped_column_has_the_critical_loads_of_both_of_its_bendings(bending, tmp_path):
    """(2 n − 1)² π² EI/4 of a length of 1; elements of length h miss ((2 n − 1) π h)²/48."""
    elements, end = 8, 9.5 * np.pi**2 / 4.0 * min(bending)
    right = sorted({(2 * n - 1) ** 2 * np.pi**2 / 4.0 * each for n in (1, 2) for each in bending})
    right = [load for load in right if load < end]
    found = critical(tmp_path, COLUMN.format(elements=elements, bending=list(bending)), "rod.8", [-end, 0.0, 0.0])
    assert -found == pytest.approx(right, rel=2.0 * (3.0 * np.pi / elements) ** 2 / 48.0)
