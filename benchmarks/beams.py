"""A rod that falls from level, clamped at one end: error over processor time, here, by PyElastica and by Exudyn.

All have the same section in numbers. The error is the largest distance of the tip from a refined run at the same
instants, relative to the length. Reading the model and compiling are not counted; the set-up of a run is. How the
set-up and a step grow with the number of elements is in a second table. Programs that are not installed are left out.
"""

import sys
import time
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import ephs
from benchmarks.evaluation import own
from benchmarks.report import Report, exponent, table_of

LENGTH, RADIUS, YOUNG, POISSON, DENSITY, GRAVITY, UNTIL = 1.0, 0.02, 1e7, 0.3, 1000.0, 9.81, 1.0
INSTANTS = np.linspace(0.0, UNTIL, 21)
AREA, SECOND = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4.0
SHEAR = YOUNG / (2.0 * (1.0 + POISSON))
FACTOR = 27.0 / 28.0
"""Shear factor of circles in PyElastica."""
SCENE = """format = 1
name = "rod"
[world]
gravity = [0.0, {gravity!r}, 0.0]
[beams.rod]
from = [0.0, 0.0, 0.0]
to = [{length!r}, 0.0, 0.0]
elements = {elements}
order = {order}
section = {{ EA = {EA!r}, GA = [{GA!r}, {GA!r}], GJ = {GJ!r}, EI = [{EI!r}, {EI!r}], rhoA = {A!r}, rhoI = {rhoI} }}
ends = ["ground"]
"""
REFINED: tuple[int, int, str, dict[str, float]] = (24, 4, "rk87", {"rtol": 1e-7, "atol": 1e-9})
OWN: tuple[tuple[int, int, str, dict[str, float]], ...] = (
    *((n, 4, "rk87", {"rtol": 1e-4, "atol": 1e-5}) for n in (2, 3, 4, 6, 8, 12)),
    *((n, 2, "rk87", {"rtol": 1e-4, "atol": 1e-5}) for n in (8, 16, 32)),
    (4, 4, "natural", {"step": 0.01}),
    (16, 4, "natural", {"step": 0.005}),
    (8, 4, "natural4", {"step": 0.01}),
    (8, 4, "radau", {"rtol": 1e-3, "atol": 1e-4}),
    (8, 4, "radau", {"step": 0.01}),
)
SIZES = (125, 250, 500, 1000)
COLUMNS = {
    "by": ("by", 1.0), "elements": ("elements", 1.0), "steps": ("steps", 1.0), "time [s]": ("seconds", 1.0),
    "error": ("error", 1.0), "times the quickest here of at most this error": ("ratio", 1.0),
}  # fmt: skip
GROWTH = {
    "elements": ("elements", 1.0),
    "read [s]": ("load", 1.0),
    "read and set up [s]": ("setup", 1.0),
    "step [ms]": ("step", 1e3),
}


def report() -> Report:
    """Every program's runs, and the growth with the number of elements."""
    exact, _ = _own(*REFINED)
    rows = [_row(f"{method}, order {order}", n, _own(n, order, method, how), exact) for n, order, method, how in OWN]
    ours = list(rows)
    if find_spec("elastica"):
        for n, steps in ((20, 4_000), (40, 8_000), (80, 16_000), (160, 32_000), (320, 64_000)):
            rows.append(_row("PyElastica", n, _pyelastica(n, steps), exact))
    if find_spec("exudyn"):
        for n, steps in ((4, 100), (8, 100), (16, 200), (32, 400), (64, 1600)):
            for nodes in (2, 3):
                rows.append(_row(f"Exudyn, planar, {nodes} nodes", n, _exudyn(n, steps, nodes), exact))
        for n, steps in ((8, 200), (16, 400), (32, 400), (32, 800), (64, 1600)):
            rows.append(_row("Exudyn, spatial", n, _exudyn_spatial(n, steps), exact))
    for row in rows:
        times = [each["seconds"] for each in ours if each["error"] <= row["error"]]
        row["ratio"] = row["seconds"] / min(times) if times else None
    grown = [_growth(n) for n in SIZES]
    slope = {"elements": "exponent"} | {
        key: exponent(SIZES, [row[key] for row in grown]) / scale for _, (key, scale) in list(GROWTH.items())[1:]
    }
    return Report(table_of(rows, COLUMNS) + "\n\n" + table_of([*grown, slope], GROWTH), [*rows, *grown, slope])


def _row(by: str, elements: int, run: tuple[np.ndarray, dict[str, Any]], exact: np.ndarray) -> dict[str, Any]:
    tips, facts = run
    row = {"by": by, "elements": elements, "error": float(np.linalg.norm(tips - exact, axis=1).max()) / LENGTH, **facts}
    print(row, file=sys.stderr, flush=True)
    return row


def _scene(elements: int, order: int) -> Any:
    text = SCENE.format(
        gravity=-GRAVITY, length=LENGTH, elements=elements, order=order, EA=YOUNG * AREA, GA=FACTOR * SHEAR * AREA,
        GJ=2.0 * SHEAR * SECOND, EI=YOUNG * SECOND, A=DENSITY * AREA,
        rhoI=[DENSITY * SECOND * factor for factor in (2.0, 1.0, 1.0)],
    )  # fmt: skip
    with TemporaryDirectory() as folder:
        file = Path(folder, "rod.toml")
        file.write_text(text, encoding="utf-8")
        return ephs.load(file)


def _own(elements: int, order: int, method: str, how: dict[str, float]) -> tuple[np.ndarray, dict[str, Any]]:
    scene = _scene(elements, order)
    options: dict[str, Any] = {"method": method, "audit": "off", **how}
    ephs.simulate(scene, 0.04, **options)  # compiles
    start = time.process_time()
    sol = ephs.simulate(scene, UNTIL, save_at=INSTANTS, **options)
    seconds = time.process_time() - start
    return sol.body(f"rod.{elements}").position[:, :2], {"steps": int(sol.stats["steps"]), "seconds": seconds}


def _pyelastica(elements: int, steps: int) -> tuple[np.ndarray, dict[str, Any]]:
    ea: Any = import_module("elastica")

    class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing):
        """A collection with clamps and forces."""

    simulator = Simulator()
    rod = ea.CosseratRod.straight_rod(
        elements, np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), LENGTH, RADIUS, DENSITY,
        youngs_modulus=YOUNG, shear_modulus=SHEAR,
    )  # fmt: skip
    simulator.append(rod)
    simulator.constrain(rod).using(ea.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,))
    simulator.add_forcing_to(rod).using(ea.GravityForces, acc_gravity=np.array([0.0, -GRAVITY, 0.0]))
    simulator.finalize()
    stepper, h = ea.PositionVerlet(), UNTIL / steps
    now = stepper.step(simulator, 0.0, h)  # compiles
    tips = [rod.position_collection[:2, -1].copy()]
    start = time.process_time()
    for i in range(1, INSTANTS.size):
        for _ in range(steps // (INSTANTS.size - 1) - (i == 1)):
            now = stepper.step(simulator, now, h)
        tips.append(rod.position_collection[:2, -1].copy())
    return np.array(tips), {"steps": steps, "seconds": time.process_time() - start}


def _exudyn(elements: int, steps: int, nodes: int) -> tuple[np.ndarray, dict[str, Any]]:
    exu: Any = import_module("exudyn")
    items, beams = import_module("exudyn.itemInterface"), import_module("exudyn.beams")
    exu.SetWriteToConsole(False)
    system = exu.SystemContainer().AddSystem()
    template: Any = items.ObjectBeamGeometricallyExact2D(
        nodeNumbers=[-1] * nodes, massPerLength=DENSITY * AREA, crossSectionInertia=DENSITY * SECOND,
        bendingStiffness=YOUNG * SECOND, axialStiffness=YOUNG * AREA, shearStiffness=FACTOR * SHEAR * AREA,
    )  # fmt: skip
    made: Any = beams.GenerateStraightBeam(
        system, [0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0], elements, template, [0.0, -GRAVITY, 0.0], [1, 1, 1]
    )
    sensor = system.AddSensor(
        items.SensorNode(nodeNumber=made[0][-1], storeInternal=True, outputVariableType=exu.OutputVariableType.Position)
    )
    return _advance(exu, system, sensor, steps)


def _exudyn_spatial(elements: int, steps: int) -> tuple[np.ndarray, dict[str, Any]]:
    """Its two-node element on SE(3), with Euler parameters: quicker than the same with rotation vectors."""
    exu: Any = import_module("exudyn")
    items = import_module("exudyn.itemInterface")
    exu.SetWriteToConsole(False)
    system = exu.SystemContainer().AddSystem()
    section, shear = exu.BeamSection(), FACTOR * SHEAR * AREA
    section.massPerLength = DENSITY * AREA
    section.inertia = DENSITY * SECOND * np.diag([2.0, 1.0, 1.0])
    section.stiffnessMatrix = np.diag(
        [YOUNG * AREA, shear, shear, 2.0 * SHEAR * SECOND, YOUNG * SECOND, YOUNG * SECOND]
    )
    nodes = [
        system.AddNode(items.NodeRigidBodyEP(referenceCoordinates=[LENGTH * i / elements, 0, 0, 1, 0, 0, 0]))
        for i in range(elements + 1)
    ]
    for pair in pairwise(nodes):
        beam = items.ObjectBeamGeometricallyExact(nodeNumbers=list(pair), length=LENGTH / elements, sectionData=section)
        marker = system.AddMarker(items.MarkerBodyMass(bodyNumber=system.AddObject(beam)))
        system.AddLoad(items.LoadMassProportional(markerNumber=marker, loadVector=[0.0, -GRAVITY, 0.0]))
    ground = system.AddMarker(items.MarkerBodyRigid(bodyNumber=system.AddObject(items.ObjectGround())))
    clamped = system.AddMarker(items.MarkerNodeRigid(nodeNumber=nodes[0]))
    system.AddObject(items.GenericJoint(markerNumbers=[ground, clamped]))
    sensor = system.AddSensor(
        items.SensorNode(nodeNumber=nodes[-1], storeInternal=True, outputVariableType=exu.OutputVariableType.Position)
    )
    return _advance(exu, system, sensor, steps)


def _advance(exu: Any, system: Any, sensor: Any, steps: int) -> tuple[np.ndarray, dict[str, Any]]:
    system.Assemble()
    how: Any = exu.SimulationSettings()
    how.timeIntegration.endTime, how.timeIntegration.numberOfSteps = UNTIL, steps
    how.timeIntegration.generalizedAlpha.spectralRadius = 0.8
    how.timeIntegration.newton.useModifiedNewton = True
    how.linearSolverType = exu.LinearSolverType.EigenSparse
    how.solutionSettings.sensorsWritePeriod = UNTIL / (INSTANTS.size - 1)
    how.solutionSettings.writeSolutionToFile = False
    how.timeIntegration.verboseMode = 0
    start = time.process_time()
    system.SolveDynamic(how)
    seconds = time.process_time() - start
    return np.array(system.GetSensorStoredData(sensor))[:, 1:3], {"steps": steps, "seconds": seconds}


def _growth(elements: int) -> dict[str, Any]:
    """Processor time of a rod's reading, of all before its first evaluation, and of a step of `natural`."""
    own(_scene(8, 2))[0](1)
    start = time.process_time()
    scene = _scene(elements, 2)
    load = time.process_time() - start
    own(scene)
    setup = time.process_time() - start
    options: dict[str, Any] = {"method": "natural", "step": 0.01, "audit": "off"}
    spent: list[float] = []
    for until in (0.02, 0.42):
        start = time.process_time()
        ephs.simulate(scene, until, **options)
        spent.append(time.process_time() - start)
    row = {"elements": elements, "load": load, "setup": setup, "step": (spent[1] - spent[0]) / 40.0}
    print(row, file=sys.stderr, flush=True)
    return row
