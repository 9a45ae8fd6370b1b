"""Numbers of a model by path: what is written is read, nothing else changes, loops stay closed."""

import re

import numpy as np
import pytest

import ephs
from ephs import library as lib
from ephs.mechanics.scene.parameters import names, read, varied
from tests.mechanics.written_scenes import WRITTEN
from tests.numerics import largest
from tests.semantics.test_chemistry import GASES
from tests.written import scene_of_text

SCENES = ("four-bar", "slider-crank", "heavy-top", "chain", "universal")


@pytest.fixture(scope="module", params=SCENES)
def scene(request):
    return ephs.load(f"scenes/{request.param}.toml")


def changed(scene, path):
    value = read(scene, path)
    if ".friction[" in path and value == 0.0:
        return value  # an entry beside the diagonal alone is no friction
    return value * 1.01 if value else 0.0 if "inertia" in path or "stiffness[" in path or "rest" in path else 1e-3


def test_what_is_written_is_read(scene):
    for path in names(scene):
        try:
            value = changed(scene, path)
            found = varied(scene, {path: value}, strict=False)
        except ephs.SceneError as error:
            # What cannot be: velocities of bodies that joints hold, and changes that leave loops open.
            assert "velocity" in path or "no number" in str(error) or "gap" in str(error) or "velocities" in str(error)
            continue
        assert read(found, path) == pytest.approx(value, rel=1e-9, abs=1e-9), path


def test_nothing_else_changes(scene):
    plain = [p for p in names(scene) if p.endswith(("mass", "length", "damping", "capacity", "conductance"))]
    for path in plain:
        found = varied(scene, {path: 1.5 * read(scene, path)})
        for other in names(scene):
            if other != path:
                assert read(found, other) == read(scene, other)


def test_loops_close_after_a_link_was_lengthened():
    scene = ephs.load("scenes/four-bar.toml")
    found = varied(scene, {"joints.knee.frame1.position[0]": 0.47, "joints.main.coordinate": 0.2})
    model = ephs.dynamics(found)
    assert largest(model.constraints(model.state0).gaps) < 1e-9
    assert found.joint("main").coordinate[0] == pytest.approx(0.2, abs=1e-9)
    ends = [found.body("coupler"), found.body("crank")]
    assert np.linalg.norm(ends[0].pose[4:] - ends[1].pose[4:]) < 1.0


def test_a_centre_of_mass_moves_while_the_joints_stay():
    scene = ephs.load("scenes/slider-crank.toml")
    found = varied(scene, {"bodies.rod.position[2]": 0.03})
    before, after = scene.body("rod"), found.body("rod")
    assert after.pose[6] == 0.03 and np.array_equal(after.pose[:6], before.pose[:6])
    motion = ephs.dynamics(found)
    assert motion.state0.coordinates["bearing"] == pytest.approx(ephs.dynamics(scene).state0.coordinates["bearing"])
    assert largest(motion.constraints(motion.state0).gaps) < 1e-12


def test_a_mass_leaves_the_motion_as_it_is():
    scene = ephs.load("scenes/slider-crank.toml")
    found = varied(scene, {"bodies.rod.mass": 0.3})
    for name, body in scene.all_bodies():
        assert np.array_equal(found.body(name).twist, body.twist)


@pytest.mark.parametrize(
    ("path", "hint"),
    [
        ("bodies.crnk.mass", 'did you mean "bodies.crank.mass"'),
        ("joints.main.rate[3]", "entry [0…0]"),
        ("bodies.crank.inertia", "entry [0…5]"),
        ("nothing", "there are"),
    ],
)
def test_unknown_paths_name_the_nearest(path, hint):
    with pytest.raises(ephs.SceneError) as error:
        read(ephs.load("scenes/four-bar.toml"), path)
    assert hint in str(error.value)


@pytest.mark.parametrize(
    ("path", "value"),
    [("bodies.crank.mass", -1.0), ("joints.pivot.friction", -0.1), ("bodies.crank.inertia[0]", 1.0),
     ("joints.main.drive", float("nan"))],
)  # fmt: skip
def test_values_out_of_their_range_are_refused(path, value):
    scene = ephs.load("scenes/four-bar.toml")
    with pytest.raises(ephs.SceneError) as error:
        varied(scene, {path: value})
    assert path.split("[")[0] in str(error.value)


def test_states_of_a_system_have_paths_too():
    """Of vector spaces, by entry where they have several numbers; other numbers stay."""
    body = ephs.mechanics.rigid_body(2.0, [0.1, 0.2, 0.3])
    system = ephs.Pattern.from_text("p: body_momentum; it(p)")(it=body)
    found = varied(system, {"it.ke.p[4]": 3.0, "it.ke.p[0]": 0.5})
    assert [read(found, f"it.ke.p[{k}]") for k in range(6)] == [0.5, 0.0, 0.0, 0.0, 3.0, 0.0]
    for path in ("it.ke.p", "it.ke.p[6]", "it.pe.q[0]"):
        with pytest.raises(ephs.AssemblyError, match="an entry"):
            read(system, path)


def test_only_numbers_of_components_are_parameters():
    """Not the species of a mixture, and not its phase."""
    gas = lib.ideal_mixture(species=GASES)
    ports = {str(port): ephs.junction(of.quantity, exposed=True) for port, of in gas.interface.items()}
    system = ephs.Pattern(junctions=ports, boxes={"gas": {port: port for port in ports}})(gas=gas)
    assert names(system) == []
    with pytest.raises(ephs.AssemblyError, match="neither a number"):
        read(system, "gas.phase")


def test_elements_of_beams_have_no_law_of_a_joint():
    """Theirs is the section's: what would change nothing has no path, and forces within have no port."""
    scene = scene_of_text("format = 1\n" + WRITTEN["rib"])
    assert not [path for path in names(scene) if re.match(r"joints\.rib-\d\.(friction|stiffness|rest|drive)", path)]
    with pytest.raises(ephs.SceneError, match="there is no such number"):
        varied(scene, {"joints.rib-1.drive[5]": 1.0})
    with pytest.raises(ephs.AssemblyError, match=r"joints\.rib-1: no such outer power port"):
        ephs.simulate(scene, 0.01, inputs={"joints.rib-1": [0.0] * 6})


def test_components_of_a_system_have_paths_too():
    oscillator = ephs.Pattern.from_text("q: displacement; p: momentum; pe(q); ke(p); pkc(q, p)")
    system = ephs.Pattern.from_text("osc()")(
        osc=oscillator(pe=lib.spring(k=1.5), ke=lib.point_mass(m=1.0), pkc=lib.pkc())
    )
    for model in (system, system.flatten()):
        assert names(model) == ["osc.pe.k", "osc.ke.m"]
        found = varied(model, {"osc.pe.k": 2.5})
        assert (read(found, "osc.pe.k"), read(found, "osc.ke.m")) == (2.5, 1.0)
        with pytest.raises(ephs.AssemblyError, match="did you mean"):
            read(model, "osc.pe.m")
    with pytest.raises(ephs.StructureError):
        varied(system, {"osc.ke.m": -1.0})
