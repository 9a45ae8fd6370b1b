"""Units that several files test."""

import fmpy
import pytest

import ephs
from tests.solve.exchange.units import spring

CART = """
format = 1
[bodies.cart]
mass = 1.0
inertia = [0.1, 0.1, 0.1]
[joints.rail]
type = "prismatic"
bodies = ["ground", "cart"]
at = [0.0, 0.0, 0.0]
axis = [1.0, 0.0, 0.0]
rate = 1.0
"""


@pytest.fixture(scope="session")
def springs(tmp_path_factory):
    """A file of the spring of 100 N/m."""
    return spring(tmp_path_factory.mktemp("spring"))


@pytest.fixture(scope="session")
def cart(tmp_path_factory):
    """1 kg on a rail at 1 m/s."""
    file = tmp_path_factory.mktemp("cart") / "cart.toml"
    file.write_text(CART)
    return ephs.load(file)


@pytest.fixture(scope="session")
def carts(cart, tmp_path_factory):
    """A file of the cart as a unit: force in, coordinate, rate and energy out."""
    file = tmp_path_factory.mktemp("carts") / "cart.fmu"
    ephs.export_fmu(cart, file, inputs=["joints.rail"], rtol=1e-11, atol=1e-13, platforms=[fmpy.platform_tuple])
    return file
