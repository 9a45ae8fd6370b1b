"""Values that a system allows, drawn at random, and what is left of a component's own equations at them.

Flows come from the primitives of the system, box by box; the equations are those of the flattened component, solved one
by one for what the system does not name. Neither knows how the one was found from the other.
"""

from dataclasses import dataclass, field

import numpy as np
import sympy

from ephs.modelica.expressions import derivative
from ephs.operad import Path
from ephs.semantics import Reference

REFERENCE = Reference(temperature=300.0)


@dataclass
class Drawn:
    """Efforts and flows by port and state; by state its amount and its rates; energy stored and entropy made, a second.

    Energies are relative to no temperature: a heat port's power is θ times its flow.
    """

    efforts: dict
    flows: dict
    amounts: dict = field(default_factory=dict)
    rates: dict = field(default_factory=dict)
    slopes: dict = field(default_factory=dict)
    stored: float = 0.0
    produced: float = 0.0

    def power(self, interface):
        """What the ports take in W."""
        return sum(
            self.flows[str(port)]
            * (self.efforts[str(port)] + (REFERENCE.temperature if of.quantity.kind == "entropy" else 0.0))
            for port, of in interface.items()
        )

    def size(self):
        """Of the terms of balances of power."""
        return sum(abs(flow) * max(abs(self.efforts[port]), REFERENCE.temperature) for port, flow in self.flows.items())


def drawn(component, rng):
    """Random efforts that the constraints allow, with multipliers at random, and what follows."""
    system = component.system
    junctions = {str(name): of.quantity for name, of in system.pattern.junctions.items() if str(name) != "flux"}
    efforts = {
        name: rng.uniform(-40.0, 40.0) if of.kind == "entropy" else rng.normal() for name, of in junctions.items()
    }
    out = Drawn(efforts, dict.fromkeys(junctions, 0.0))
    for box, found in (("dirac", _dirac), ("loss", _loss), ("stored", _stored)):
        filling = system.fillings.get(Path.of(box))
        if filling is not None:
            joined = system.pattern.boxes[Path.of(box)].ports
            found(out, filling, [str(joined[port].junction) for port in filling.bundle.ports], rng)
    return out


def _dirac(out, filling, names, rng):
    skew, constraint = filling.structure({Path.of("field"): np.array([1.0])})
    e = np.array([out.efforts[name] for name in names])
    e = e - np.linalg.pinv(constraint) @ (constraint @ e) if len(constraint) else e
    out.efforts |= dict(zip(names, e, strict=True))
    for name, flow in zip(names, skew @ e + constraint.T @ rng.standard_normal(len(constraint)), strict=True):
        out.flows[name] += flow


def _loss(out, filling, names, rng):
    e = np.array([out.efforts[name] for name in names])
    flow = filling.flow({}, e, REFERENCE)
    for name, each in zip(names, flow, strict=True):
        out.flows[name] += each
    out.produced = -float(filling.bundle.indicator("entropy") @ flow)


def _stored(out, filling, names, rng):
    e = np.array([out.efforts[name] for name in names])
    if filling.bundle.indicator("entropy").any():
        theta, rate = REFERENCE.temperature + e[0], rng.normal()
        out.flows[names[0]], out.stored = rate, theta * rate
        out.slopes = {names[0]: theta * rate / dict(filling.parameters)["c2"]}
        return
    ports = filling.bundle.ports
    ones = [{port: np.ones(1) if port == one else np.zeros(1) for port in ports} for one in ports]
    matrix = np.array([filling.energy_gradient(x) for x in ones]).T
    rates = -np.array([out.flows.pop(name) for name in names])
    out.amounts = dict(zip(names, np.linalg.solve(matrix, e), strict=True))
    out.rates, out.slopes = dict(zip(names, rates, strict=True)), dict(zip(names, matrix @ rates, strict=True))
    out.stored = float(e @ rates)


def left_over(flat, component, out):
    """The largest residual of the component's equations beside its terms, once what they define is put in."""
    values = _values(flat, component, out)
    lengths = {symbol for symbol, unit in flat.units.items() if unit in ("rad", "m")}
    residuals = [each.residual for each in flat.equations]
    residuals += [
        sum(sympy.diff(each, symbol) * derivative(symbol) for symbol in each.free_symbols)
        for each in residuals
        if each.free_symbols and each.free_symbols <= lengths
    ]
    worst, changed = 0.0, True
    while changed:
        changed, later = False, []
        for residual in residuals:
            unknown = residual.free_symbols - values.keys()
            if not unknown:
                terms = [float(term.subs(values)) for term in sympy.Add.make_args(residual)]
                worst = max(worst, abs(sum(terms)) / max(1.0, *(abs(term) for term in terms)))
            elif len(unknown) == 1 and (slope := sympy.diff(residual, symbol := unknown.pop())).is_number:
                values[symbol] = float(-residual.subs(symbol, 0).subs(values) / slope)
                changed = True
            else:
                later.append(residual)
        residuals = later
    assert all(each.free_symbols <= lengths | values.keys() for each in residuals), residuals
    return worst


def _values(flat, component, out):
    """The variables of the component that ports and states tell."""
    values = {}
    for port in flat.ports:
        effort, flow = out.efforts[port.name], out.flows.get(port.name, 0.0)
        if port.heat:
            theta = REFERENCE.temperature + effort
            values |= {port.potential: theta, port.flow: flow * theta}
            if port.name in out.slopes:
                values[derivative(port.potential)] = out.slopes[port.name]
                values |= {derivative(s): out.slopes[port.name] for s, of in flat.units.items() if of == "K"}
        else:
            values |= {derivative(port.potential) if port.domain.position else port.potential: effort, port.flow: flow}
    for symbol, unit in flat.units.items():
        name = symbol.name
        if name not in out.amounts:
            continue
        if unit in ("rad", "m"):
            rest = flat.starts.get(symbol, 0.0) - component.initial[f"stored.{name}"]
            values |= {symbol: out.amounts[name] + rest, derivative(symbol): out.rates[name]}
        else:
            values |= {symbol: out.efforts[name], derivative(symbol): out.slopes[name]}
    return values
