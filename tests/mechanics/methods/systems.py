"""Systems that say nothing by their names: those of scenes, renamed and nested at random."""

from dataclasses import replace

import numpy as np

from ephs import Pattern
from ephs.mechanics.scene.build import initial_state, scene_inputs, scene_system
from ephs.operad import Path, junction
from ephs.semantics.bundles.bundle import Reference
from ephs.semantics.systems.system import System
from ephs.solve.posing.problem import Problem, Signal
from tests.oracle import Oracle


def problem_of(system, initial=None, signals=None, reference=None):
    return Problem(
        "system", system, system.descriptor(), initial or system.state(), signals or {}, reference or Reference()
    )


def oracle_of(problem):
    """The plain evaluation of a problem whose inputs are constant."""
    inputs = {port: (np.atleast_1d(np.array(of.value, dtype=float)), of.effort) for port, of in problem.signals.items()}
    return Oracle(problem.system, inputs, problem.reference)


def renamed(scene, word, seed):
    """The problem of a scene's system under names that say nothing, some of its boxes in a system of their own."""
    flat = scene_system(scene).flatten()
    numbers = {box: Path([word, f"b{i}"]) for i, box in enumerate(flat.pattern.boxes)}
    outer = {j for j, of in flat.pattern.junctions.items() if of.exposed}
    names = {j: j if j in outer else Path([f"{word}-j", f"j{i}"]) for i, j in enumerate(flat.pattern.junctions)}
    pattern = Pattern(
        junctions={names[j]: of for j, of in flat.pattern.junctions.items()},
        boxes={
            numbers[box]: {port: replace(at, junction=names[at.junction]) for port, at in of.ports.items()}
            for box, of in flat.pattern.boxes.items()
        },
    )
    system = System.of(pattern, {numbers[box]: filling for box, filling in flat.fillings.items()})
    system, moved = nested(system, np.random.default_rng(seed))

    def place(path):
        box = numbers[Path(tuple(path)[:-1])]
        return (Path(["inside"]) / box if box in moved else box) / path[-1]

    initial = {place(path): value for path, value in initial_state(scene).items()}
    signals = {path: Signal(one.value, one.effort) for path, one in scene_inputs(scene).items()}
    world = scene.world
    return problem_of(system, initial, signals, Reference(world.temperature, world.pressure)), place


def nested(system, rng):
    """The same system with every box from a random one on in a box of its own, and which boxes these are."""
    boxes = list(system.pattern.boxes)
    moved = set(boxes[int(rng.integers(1, len(boxes) + 1)) :])
    if not moved:
        return system, moved
    touched = {
        inside: {
            at.junction for box in boxes if (box in moved) is inside for at in system.pattern.boxes[box].ports.values()
        }
        for inside in (True, False)
    }
    kept = {j for j, of in system.pattern.junctions.items() if of.exposed or j in touched[False]}
    part = Pattern(
        junctions={
            j: junction(of.quantity, exposed=j in kept)
            for j, of in system.pattern.junctions.items()
            if j in touched[True]
        },
        boxes={box: system.pattern.boxes[box].ports for box in boxes if box in moved},
    )
    whole = Pattern(
        junctions={j: of for j, of in system.pattern.junctions.items() if j in kept},
        boxes={box: system.pattern.boxes[box].ports for box in boxes if box not in moved}
        | {"inside": {j: str(j) for j in touched[True] & kept}},
    )
    inner = System.of(part, {box: system.fillings[box] for box in boxes if box in moved})
    return System.of(whole, {box: system.fillings[box] for box in boxes if box not in moved} | {"inside": inner}), moved
