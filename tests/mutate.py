"""Break one thing at a time and see which tests go red: ``python -m tests.mutate [NAME...]``.

Works on a copy of the tree. A mutation that no test notices is an error.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLAIN = ("tests/mechanics/test_components.py", "tests/mechanics/test_models.py", "tests/mechanics/test_variational.py")
COMPILED = ("tests/mechanics/test_components.py", "tests/mechanics/test_motions.py")
SEMANTICS = ("tests/semantics/test_primitives.py", "tests/semantics/test_laws.py", "tests/semantics/test_relations.py")
OPERAD = ("tests/operad",)
SYMBOLS = ("tests/semantics/symbols",)
REDUCED = ("tests/mechanics/reduced",)
IMPORTS = ("tests/mechanics/imports",)


@dataclass(frozen=True)
class Mutation:
    """One edit: in a file, some text becomes another; and the tests that ought to see it."""

    file: str
    old: str
    new: str
    tests: tuple[str, ...]


MUTATIONS = {
    "left trivialisation": Mutation(
        "ephs/semantics/symbols/programs.py", "[[-a, -b, -c], [w, -c, b]", "[[-a, -b, -c], [w, c, b]", SYMBOLS
    ),
    "traced correction": Mutation(
        "ephs/semantics/symbols/traced_kernels.py", "near += WEIGHT *", "near -= WEIGHT *", COMPILED
    ),
    "traced slope": Mutation(
        "ephs/semantics/symbols/traced_kernels.py", "0.5 * slope[at + q]", "slope[at + q]", COMPILED
    ),
    "equations": Mutation(
        "ephs/semantics/symbols/writer.py",
        "parts.balances[writer.junction(path, port)] += expression",
        "parts.balances[writer.junction(path, port)] -= expression",
        SYMBOLS,
    ),
    "reduced, turning frames": Mutation(
        "ephs/mechanics/reduced/sweep_kernels.py",
        "w.bias[i, k] = carried[k] + column[k]",
        "w.bias[i, k] = carried[k] - column[k]",
        REDUCED,
    ),
    "reduced, cut joints": Mutation(
        "ephs/mechanics/reduced/loop_kernels.py", "total[k] += turned[k]", "total[k] -= turned[k]", REDUCED
    ),
    "reduced, heat": Mutation(
        "ephs/mechanics/reduced/sweep_kernels.py", "s_rate[t.heat[i]] -= w.f[d]", "s_rate[t.heat[i]] += w.f[d]", REDUCED
    ),
    "books": Mutation(
        "ephs/mechanics/solve/books.py",
        "self.exergy - self.exergy[:1] + self.destroyed",
        "self.exergy - self.exergy[:1] - self.destroyed",
        ("tests/mechanics/solve/test_books.py",),
    ),
    "lp": Mutation("ephs/mechanics/components.py", "[-space.ad(unit).T @ x[p]", "[space.ad(unit).T @ x[p]", PLAIN),
    "lp, compiled": Mutation(
        "ephs/mechanics/kernels.py",
        "flow[3 + i] = u[j] * mean[3 + k] - u[k] * mean[3 + j]",
        "flow[3 + i] = u[k] * mean[3 + j] - u[j] * mean[3 + k]",
        COMPILED,
    ),
    "o1": Mutation("ephs/mechanics/components.py", "np.hstack([-carried,", "np.hstack([carried,", PLAIN),
    "o1, not inverted": Mutation(
        "ephs/mechanics/components.py",
        "carried = SE3.adjoint(SE3.inverse(np.asarray(offset, dtype=float)))",
        "carried = SE3.adjoint(np.asarray(offset, dtype=float))",
        PLAIN,
    ),
    "hc": Mutation(
        "ephs/mechanics/components.py",
        "np.hstack([SE3.adjoint(SE3.inverse(pose)), -np.eye(6), of.basis])",
        "np.hstack([SE3.adjoint(SE3.inverse(pose)), np.eye(6), of.basis])",
        PLAIN,
    ),
    "hc, compiled": Mutation(
        "ephs/mechanics/holonomic_kernels.py",
        "side[i], mid[i], inner[i] = -0.5 * h * effort[6 + i], 0.5 * h * bi, h * ai",
        "side[i], mid[i], inner[i] = 0.5 * h * effort[6 + i], 0.5 * h * bi, h * ai",
        COMPILED,
    ),
    "mf": Mutation(
        "ephs/semantics/structures.py",
        "out[:d, d] = out[d, :d] = -drag",
        "out[:d, d] = out[d, :d] = drag",
        SEMANTICS + PLAIN,
    ),
    "mf, compiled": Mutation(
        "ephs/semantics/kernels.py", "flow[d] = -power / theta", "flow[d] = power / theta", COMPILED
    ),
    "substitution": Mutation(
        "ephs/operad/substitution.py",
        "        target[path] = kept = box / path\n",
        "        target[path] = kept = path\n",
        OPERAD + SEMANTICS,
    ),
    "substitution, absorbed elsewhere": Mutation(
        "ephs/operad/substitution.py",
        "target[path] = outer.target[content.ports[path].junction]  # absorbed",
        "target[path] = outer.target[min(content.ports.values(), key=lambda p: p.junction).junction]",
        OPERAD + SEMANTICS,
    ),
    "import, angles": Mutation(
        "ephs/mechanics/imports/draft.py",
        "SE3.compose(_turn(2, given[2]), _turn(1, given[1]))",
        "SE3.compose(_turn(1, given[1]), _turn(2, given[2]))",
        IMPORTS,
    ),
    "import, files outside": Mutation(
        "ephs/mechanics/imports/draft.py", "file.is_relative_to(folder) and file.is_file()", "file.is_file()", IMPORTS
    ),
    "import, entities": Mutation(
        "ephs/mechanics/imports/xml.py",
        "if declared := _DECLARATION.search(text):",
        "if declared := None:",
        IMPORTS,
    ),
    "import, welds": Mutation(
        "ephs/mechanics/imports/mjcf_links.py", "pose(data[3:6], data[6:10])", "pose(data[3:6])", IMPORTS
    ),
    "gluing": Mutation(
        "ephs/semantics/relation.py", "outer_at[path] + i, -1.0))", "outer_at[path] + i, 1.0))", SEMANTICS
    ),
}


def red(mutation: Mutation) -> list[str]:
    """The tests that fail when the mutation is made."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "tree"
        shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns(".*", "out", "__pycache__", "_build"))
        file = copy / mutation.file
        text = file.read_text(encoding="utf-8")
        if text.count(mutation.old) != 1:
            raise SystemExit(
                f"{mutation.file}: {mutation.old!r} occurs {text.count(mutation.old)} times, expected once"
            )
        file.write_text(text.replace(mutation.old, mutation.new), encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-n",
            "2",
            "-p",
            "no:cacheprovider",
            "--no-header",
            "--hypothesis-profile=mutate",
            *mutation.tests,
        ]
        environment = os.environ | {"PYTHONPATH": str(copy)}
        done = subprocess.run(command, cwd=copy, capture_output=True, text=True, env=environment)
        return sorted(set(re.findall(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)))


def main(names: list[str]) -> int:
    """Make the named mutations, or all."""
    survived = 0
    for name in names or MUTATIONS:
        failures = red(MUTATIONS[name])
        print(f"\n{name}: {len(failures)} red", *failures, sep="\n  ", flush=True)
        survived += not failures
    return 1 if survived else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
