"""Generated machines (bodies, joints, springs, circuits, gases and heat under any names and nesting) in both forms."""

import numpy as np
from hypothesis import given, settings

import ephs
from ephs import Pattern, junction
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics.scene.build import drive_ports, initial_state, scene_inputs, scene_system
from ephs.mechanics.tree.equations.equations import ReducedEquations
from ephs.operad import Path
from ephs.semantics.systems.system import System
from ephs.solve.posing.problem import Signal
from ephs.testing import mechanisms
from tests.mechanics.methods.systems import nested, problem_of
from tests.mechanics.tree.general import held_to_the_general_form
from tests.numerics import generators

THETA = 293.15


class Bench:
    """A scene as one box, and what is put beside it; its junctions and boxes have names that say nothing."""

    def __init__(self, scene, rng):
        free = [j for name, j in scene.all_joints() if j.dim == 1 and j.motion is None]
        self.joints = [free[i] for i in rng.permutation(len(free))[: int(rng.integers(1, 3))]] if free else []
        self.rng, self.start, self.signals = rng, {}, {}
        self.junctions, self.boxes, self.fillings = {}, {}, {}
        system = scene_system(scene, driven=[j.name for j in self.joints])
        given = scene_inputs(scene)
        ports = {}
        for path, of in system.interface.items():
            mine = any(path == port for j in self.joints for port, _ in drive_ports(j))
            name = self.junction(of.quantity, exposed=not mine)
            ports[path] = name
            if not mine:
                self.signals[name] = given[path].value, given[path].effort
        self.box = self.add(system, ports)
        self.start |= {f"{self.box}.{path}": value for path, value in initial_state(scene).items()}
        self.node = self.junction(Q.entropy)
        self.add(lib.thermal_capacity(c1=THETA * 7.0, c2=7.0), {"s": self.node})
        for j in self.joints:
            self.machine(ports[drive_ports(j)[0][0]], float(j.rate[0]))

    def number(self):
        return float(self.rng.uniform(0.3, 2.0))

    def chance(self, share=0.5):
        return bool(self.rng.random() < share)

    def junction(self, of, exposed=False):
        name = f"j{len(self.junctions)}"
        self.junctions[name] = junction(of, exposed=exposed)
        return name

    def add(self, filling, ports):
        name = f"b{len(self.boxes)}"
        self.boxes[name], self.fillings[name] = ports, filling
        return name

    def heat(self):
        """Where heat goes: a store that all share, one of its own, or one whose entropy is exchanged reversibly."""
        if self.chance():
            return self.node
        own = self.junction(Q.entropy)
        self.add(lib.thermal_capacity(c1=THETA * self.number(), c2=self.number() * 3.0), {"s": own})
        self.add(lib.heat_transfer(h=self.number()), {"s1": own, "s2": self.node})
        return own

    def machine(self, port, rate):
        """A shaft behind a gear: a rotor, a brake, motors, a gas."""
        of, shaft, ratio = self.junctions[port].quantity, self.junction(Q.angular_momentum), self.number()
        self.add(ephs.transformer({"p": Q.angular_momentum, "r": of}, [[ratio]]), {"p": shaft, "r": port})
        if self.chance():
            inertia = self.number()
            self.start[f"{self.add(lib.rotor(j=inertia), {'p': shaft})}.p"] = inertia * rate / ratio
        if self.chance():
            self.add(lib.rotational_friction(d=self.number()), {"p": shaft, "s": self.heat()})
        if self.chance():
            self.gas(shaft)
        for _ in range(int(self.rng.integers(0, 3))):
            self.motor(shaft)

    def motor(self, shaft):
        """A mesh with a coil that a magnet couples to the shaft."""
        b, magnet = self.junction(Q.flux_linkage), self.junction(Q.flux_linkage)
        self.start[f"{self.add(lib.inductor(l=1.0), {'b': magnet})}.b"] = self.number()
        self.add(lib.mkc(), {"b": b, "p": shaft, "bs": f"~{magnet}"})
        self.start[f"{self.add(lib.inductor(l=self.number()), {'b': b})}.b"] = self.number()
        if self.chance():
            self.add(lib.resistor(r=self.number()), {"b": b, "s": self.heat()})
        if self.chance():
            q = self.junction(Q.charge)
            self.add(lib.emc(), {"q": q, "b": b})
            self.start[f"{self.add(lib.capacitor(c=self.number()), {'q': q})}.q"] = self.number()
        elif self.chance():
            q = self.junction(Q.charge, exposed=True)
            self.add(lib.emc(), {"q": q, "b": b})
            self.signals[q] = np.array([self.number()]), True

    def gas(self, shaft):
        """A gas that the shaft compresses against another, both leaking heat."""
        near, far, p = self.junction(Q.volume), self.junction(Q.volume), self.junction(Q.momentum)
        self.add(ephs.transformer({"p": Q.momentum, "r": Q.angular_momentum}, [[0.3]]), {"p": p, "r": shaft})
        self.add(lib.piston(a=0.01 * self.number()), {"v1": near, "v2": far, "p": p})
        for volume in (near, far):
            s, size = self.junction(Q.entropy), 0.01 * self.number()
            energy = 2.5 * 101325.0 * size
            box = self.add(lib.ideal_gas(c1=energy, c2=energy / THETA, v0=size, c=2.5), {"v": volume, "s": s})
            self.start |= {f"{box}.v": size * self.number(), f"{box}.s": 0.1 * self.number()}
            self.add(lib.heat_transfer(h=self.number()), {"s1": s, "s2": self.heat()})

    def problem(self):
        system = Pattern(junctions=self.junctions, boxes=self.boxes)(**self.fillings)
        flat = system.flatten()
        made, moved = nested(System.of(flat.pattern, dict(flat.fillings.items())), self.rng)
        start = {Path.of(path): np.atleast_1d(np.array(x, dtype=float)) for path, x in self.start.items()}
        start = {(Path(["inside"]) / p if Path(tuple(p)[:-1]) in moved else p): x for p, x in start.items()}
        signals = {
            Path.of(name): Signal(np.array(x, dtype=float), effort) for name, (x, effort) in self.signals.items()
        }
        return problem_of(made, made.state() | start, signals)


@settings(max_examples=20)
@given(mechanisms(max_bodies=3), generators)
def test_joint_coordinates_and_the_general_form_are_one(scene, rng):
    problem = Bench(scene, rng).problem()
    eq = ReducedEquations(problem, 0.0)
    state = eq.start(0.0)
    held_to_the_general_form(eq, problem, state)
