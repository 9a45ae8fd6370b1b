"""Runs whose every number is put into one digest each: ``python -m tests.repeat`` prints them as JSON.

``python -m tests.repeat --cold`` runs them with nothing compiled yet, then again, and says what differs: minutes.
"""

import hashlib
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import ephs
from ephs import Pattern
from ephs import library as lib
from ephs import quantity as Q
from ephs.mechanics.methods.registry import METHODS

ROOT = Path(__file__).resolve().parents[1]


def digest(value) -> str:
    """Of arrays, numbers, texts, and of mappings and sequences of such; what tells the time does not count."""
    found = hashlib.sha256()
    for name, part in sorted(leaves("", value)):
        found.update(name.encode() + b"\0" + part + b"\0")
    return found.hexdigest()


def leaves(name: str, value) -> Iterator[tuple[str, bytes]]:
    if hasattr(value, "items"):
        for key, part in value.items():
            if not str(key).endswith("_s"):
                yield from leaves(f"{name}/{key}", part)
    elif isinstance(value, list | tuple):
        for i, part in enumerate(value):
            yield from leaves(f"{name}/{i}", part)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        yield name, value.tobytes()
    else:
        yield name, repr(value).encode()


def contents(sol) -> dict:
    """All that a solution says: states, what is derived from them, ledgers, the summary."""
    data = sol.to_xarray()
    return {"arrays": {name: data[name].values for name in data.variables}, "summary": sol.summary()}


def oscillator():
    """A damped oscillator whose spring is a function of one's own."""
    pattern = Pattern.from_text("q: displacement; p: momentum; s: entropy; pe(q); ke(p); pkc(q, p); mf(p, s); env(s)")
    hard = ephs.storage({"q": Q.displacement}, lambda q: 0.5 * q**2 + 0.25 * q**4)
    return pattern(pe=hard, ke=lib.point_mass(m=1.0), pkc=lib.pkc(), mf=lib.friction(d=0.1), env=lib.environment())


def steps(method, step: float) -> list[dict]:
    """Constant steps where the method takes them, and its own where it chooses them."""
    chosen = [{"step": step}] if method.fixed else []
    return [*chosen, *([{"rtol": 1e-6, "atol": 1e-8}] if method.adaptive else [])]


def runs() -> Iterator[tuple[str, dict]]:
    """Name and contents of each run."""
    brake, bar = (ephs.load(ROOT / f"scenes/{name}.toml") for name in ("hot-brake", "four-bar"))
    for method in METHODS.values():
        for number, setting in enumerate(steps(method, 0.01)):
            for name, model, state in (
                ("brake", brake, None),
                ("bar", bar, None),
                ("own", oscillator(), {"pe.q": 1.0}),
            ):
                if method.scenes if state is None else method.systems:
                    sol = ephs.simulate(model, 0.1, initial=state, method=method.name, **setting)
                    yield f"{method.name}-{number}-{name}", contents(sol)
    table = ephs.sweep(bar, {"bodies.crank.mass": [0.5, 0.6]}, until=0.05, workers=1)
    yield "sweep", {name: table[name].values for name in table.data_vars}


def cold() -> int:
    """Whether what compiles and what is compiled give the same: 0 if so, else 1, having said what differs."""
    with TemporaryDirectory() as folder:
        empty = os.environ | {"XDG_CACHE_HOME": folder}
        command = [sys.executable, "-m", "tests.repeat"]
        first, again = (json.loads(subprocess.check_output(command, env=empty, cwd=ROOT)) for _ in range(2))
    differ = sorted(name for name in first if first[name] != again[name])
    print(f"{len(first)} runs with nothing compiled, and again with all compiled: {len(differ)} differ {differ}")
    return int(bool(differ))


def main() -> int:
    """Print the digests."""
    if "--cold" in sys.argv:
        return cold()
    warnings.simplefilter("error")
    print(json.dumps({name: digest(values) for name, values in runs()}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
