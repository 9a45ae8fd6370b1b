"""Numbers of sheets by path, those of layers too: read, varied, refused; derivatives as differences have them."""

import pytest

import ephs
from ephs.mechanics.scene.parameters import names, read, varied
from tests.mechanics.elements.shell.test_shell_touch import cloth, touch
from tests.mechanics.sensitivity.test_sensitivity import Case, check_derivatives, reading

LAYER = "thickness = 5e-3, E1 = 2e5, E2 = 1e5, G12 = 4e4, nu12 = 0.2, rho = 900.0"
LAYERS = f"layers = [{{ {LAYER}, angle = 0.3 }}, {{ {LAYER}, G13 = 3e4 }}]"
ONE = "thickness = 1e-2\nE = 1e5\nnu = 0.3\nrho = 900.0\n"


def layered(more="", floor=""):
    text = cloth(elements="[1, 1]", more=more, floor=floor or "#").replace(ONE, LAYERS + "\n")
    return touch(text)


def test_each_number_of_a_layer_has_a_path_that_is_that_of_its_key():
    scene = layered()
    own = [path for path in names(scene) if path.startswith("shells.cloth.layers")]
    keys = ("thickness", "E1", "E2", "G12", "nu12", "angle", "rho", "G13", "G23")
    assert sorted(own) == sorted(f"shells.cloth.layers[{i}].{key}" for i in (0, 1) for key in keys)
    for path in own:
        value = 1.01 * read(scene, path) + 1e-3
        found = varied(scene, {path: value})
        assert read(found, path) == value
        follows = {path.replace("G12", key) for key in ("G13", "G23") if "G12" in path}  # what has it for a default
        others = {other for other in own if read(found, other) != read(scene, other)} - {path}
        assert others == follows - {"shells.cloth.layers[1].G13"}


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("shells.cloth.layers[2].E1", 1.0, "found [2], expected an entry [0…1]"),
        ("shells.cloth.layers[0].E3", 1.0, 'did you mean "shells.cloth.layers[0].E2"'),
        ("shells.cloth.layers.E1", 1.0, 'did you mean "shells.cloth.layers['),
        ("shells.cloth.layers[0].E1", -1.0, "shells.cloth.layers[0].E1: found -1.0, expected a number above 0"),
        ("shells.cloth.layers[0].nu12", 3.0, "layers[0].nu12 is 3.0"),
        ("shells.cloth.E", 1e5, "there is no such number"),
    ],
)
def test_what_is_no_number_of_a_layer_is_refused(path, value, words):
    with pytest.raises(ephs.SceneError) as error:
        varied(layered(), {path: value})
    assert words in str(error.value)


HELD = 'edges = ["free", "free", "free", "ground"]'


def test_derivatives_by_numbers_of_layers_are_those_of_differences():
    paths = (
        "shells.cloth.layers[0].E1 shells.cloth.layers[1].angle shells.cloth.layers[0].thickness "
        "shells.cloth.layers[1].G12 shells.cloth.damping"
    )
    step = {"method": "rk54", "step": 5e-4}
    check_derivatives(Case(lambda: layered(HELD), paths, "heat kinetic potential", 0.02, step, tolerance=1e-6))


def test_derivatives_of_a_touch_are_those_of_differences():
    """The radius of the balls follows the thickness. Forces begin without a kink: steps may straddle the touch."""
    floor = '[surfaces.floor]\nbody = "ground"\nshape = { plane = {} }\nposition = [0.0, 0.0, 0.0145]\n'
    named = "[contacts.touch]\nsurfaces = ['skin', 'floor']\nstiffness = 3e4\nexponent = 1.5\n"
    text = cloth(elements="[1, 1]", more=HELD, floor=floor + named)
    scene = touch(text.replace("damping = 5e-3", "damping = 2e-4"))
    paths = ["shells.cloth.thickness", "shells.cloth.E", "contacts.touch.stiffness"]
    pace = {"method": "rk87", "step": 2e-4}
    found = ephs.sensitivity(scene, paths, 0.03, **pace)
    assert found.solution.contact("touch").force[-1, 2] > 0.0, "it touches"
    for number, path in enumerate(paths):
        value = read(scene, path)
        ends = [ephs.simulate(varied(scene, {path: (1.0 + by) * value}), 0.03, **pace) for by in (1e-4, -1e-4)]
        for name in ("heat", "kinetic"):
            one, other = (reading(end, name)[-1] for end in ends)
            scale = max(abs(reading(found.solution, name)[-1]) / value, abs(one - other) / (2e-4 * value))
            assert abs(found[name][-1, number] - (one - other) / (2e-4 * value)) < 1e-4 * scale, (path, name)
