"""What is broken, in groups, and with which tests."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from hashlib import sha256

from tests.mutate.mutants import ROOT, Mutant, mutants_of
from tests.mutate.named import breaks
from tests.mutate.reach import Pace

SPACES = "tests/semantics/spaces"
MECHANICS = "tests/mechanics"


@dataclass(frozen=True, slots=True)
class Group:
    """Files, as patterns from the root, and the tests that ought to see what is broken in them.

    ``pace``: how long those tests may take.
    """

    files: tuple[str, ...]
    tests: tuple[str, ...]
    without: tuple[str, ...] = ()
    pace: Pace = field(default_factory=Pace)

    def paths(self) -> list[str]:
        """The files, sorted."""
        found = {f.relative_to(ROOT).as_posix() for pattern in self.files for f in ROOT.glob(pattern)}
        left_out = {f.relative_to(ROOT).as_posix() for pattern in self.without for f in ROOT.glob(pattern)}
        return sorted(found - left_out)

    def mutants(self) -> list[Mutant]:
        """All of them, file by file."""
        return [mutant for path in self.paths() for mutant in mutants_of(path)] or breaks()


PARTS = (f"{MECHANICS}/test_components.py", f"{MECHANICS}/test_models.py", f"{MECHANICS}/test_variational.py")
RUNS = (
    f"{MECHANICS}/test_stability_functions.py",
    f"{MECHANICS}/tree/engine",
    f"{MECHANICS}/methods",
    "tests/solve/test_collocation.py",
    "tests/solve/test_lu.py",
    "tests/solve/test_radau.py",
    "tests/solve/test_integrate.py",
    "tests/solve/test_own_methods.py",
)

LONG = Pace(each=10.0, file=90.0, budget=40.0)
"""For what shows itself over many steps."""
DERIVATIVES = (
    "ephs/mechanics/road/closures.py",
    "ephs/mechanics/tree/sweeps/expanding.py",
    "ephs/mechanics/road/inverse.py",
    "ephs/mechanics/tree/engine/tangents.py",
    "ephs/mechanics/tree/equations/residual.py",
    "ephs/mechanics/sensitivity/explicit.py",
    "ephs/semantics/stage/duals.py",
)

GROUPS = {
    "operad": Group(
        ("ephs/operad/*.py", "examples/rewriting/*.py"),
        ("tests/operad", "tests/semantics/test_stacked.py"),
    ),
    "spaces": Group(
        ("ephs/semantics/spaces/*.py",),
        (SPACES, *PARTS),
        ("ephs/semantics/spaces/errors.py",),
    ),
    "pairs": Group(
        (
            "ephs/mechanics/elements/joints.py",
            "ephs/mechanics/elements/components.py",
            "ephs/mechanics/elements/offset.py",
            "ephs/mechanics/constraints/directions.py",
            "ephs/semantics/derive/holonomic.py",
            "ephs/mechanics/elements/springs.py",
        ),
        (
            *PARTS,
            f"{SPACES}/test_pairs.py",
            f"{MECHANICS}/test_build.py",
            f"{MECHANICS}/test_joint_ports.py",
            f"{MECHANICS}/test_redundancy.py",
        ),
    ),
    "elements": Group(
        (
            "ephs/mechanics/elements/*.py",
            "ephs/mechanics/elements/shell/*.py",
            "ephs/mechanics/shapes/*.py",
        ),
        (
            f"{MECHANICS}/elements",
            f"{MECHANICS}/shapes",
            f"{MECHANICS}/test_components.py",
            f"{MECHANICS}/test_models.py",
            f"{MECHANICS}/test_twins.py",
        ),
        (
            "ephs/mechanics/elements/components.py",
            "ephs/mechanics/elements/joints.py",
            "ephs/mechanics/elements/offset.py",
            "ephs/mechanics/elements/notation.py",
        ),
        pace=LONG,
    ),
    "primitives": Group(
        (
            "ephs/semantics/primitives/primitives.py",
            "ephs/semantics/primitives/differences.py",
            "ephs/semantics/primitives/structures.py",
            "ephs/semantics/library/__init__.py",
            "ephs/semantics/primitives/forms.py",
            "ephs/semantics/derive/*.py",
            "ephs/semantics/primitives/behaviour.py",
            "ephs/semantics/primitives/constructors.py",
        ),
        ("tests/semantics", *PARTS),
    ),
    "relations": Group(
        (
            "ephs/semantics/meaning/*.py",
            "ephs/semantics/systems/laws.py",
        ),
        (
            *tuple(
                f"tests/semantics/test_{name}.py"
                for name in ("base", "controls", "edge_cases", "laws", "naturality", "relations", "stacked")
            ),
            "tests/semantics/meaning",
        ),
    ),
    "algebras": Group(
        ("ephs/semantics/algebra/*.py",),
        ("tests/semantics/algebra",),
    ),
    "integrators": Group(
        (
            "ephs/solve/methods/natural.py",
            "ephs/solve/methods/spread.py",
            "ephs/solve/methods/radau.py",
            "ephs/solve/methods/collocation.py",
            "ephs/solve/methods/integral.py",
            "ephs/solve/methods/energies.py",
            "ephs/solve/methods/conduction.py",
            "ephs/mechanics/methods/explicit.py",
            "ephs/mechanics/methods/tableaux.py",
            "ephs/mechanics/methods/radau.py",
            "ephs/mechanics/methods/variational.py",
        ),
        (
            *RUNS,
            "tests/solve/test_integral.py",
            "tests/solve/test_energies.py",
            "tests/solve/test_ledgers.py",
            "tests/solve/test_journal.py",
            f"{MECHANICS}/rewrite/test_folding.py",
            f"{MECHANICS}/test_methods.py",
            f"{MECHANICS}/test_outcomes.py",
            f"{MECHANICS}/test_pace.py",
            f"{MECHANICS}/test_variational.py",
            f"{MECHANICS}/test_work.py",
        ),
        pace=LONG,
    ),
    "kernels": Group(
        (
            "ephs/solve/methods/stages.py",
            "ephs/solve/methods/guesses.py",
            "ephs/solve/methods/moves.py",
            "ephs/solve/methods/newton.py",
            "ephs/solve/methods/residuals.py",
            "ephs/solve/methods/scales.py",
            "ephs/solve/methods/stages.py",
        ),
        (
            *RUNS,
            f"{MECHANICS}/dynamics/test_dynamics.py",
            "tests/solve/test_natural4.py",
            "tests/solve/test_residuals.py",
            f"{MECHANICS}/test_redundancy.py",
        ),
        pace=LONG,
    ),
    "sweeps": Group(
        (
            "ephs/mechanics/road/linear.py",
            "ephs/mechanics/road/pack.py",
            "ephs/mechanics/road/tree.py",
            "ephs/mechanics/tree/engine/links.py",
            "ephs/mechanics/tree/engine/near.py",
            "ephs/mechanics/tree/engine/forces.py",
            "ephs/mechanics/tree/engine/heats.py",
            "ephs/mechanics/tree/engine/motion.py",
            "ephs/solve/march/*.py",
        ),
        (
            f"{MECHANICS}/tree/engine",
            *(f"{MECHANICS}/tree/test_{name}.py" for name in ("attached", "gears", "joint_rates", "oracle", "sweeps")),
            f"{MECHANICS}/test_work.py",
            "tests/solve/test_march.py",
            "tests/solve/test_iteration.py",
            f"{MECHANICS}/methods/test_heat.py",
            f"{MECHANICS}/elements/test_contact.py",
            f"{MECHANICS}/impacts/test_generated.py",
        ),
        pace=Pace(each=30.0, file=300.0, budget=60.0),
    ),
    "derivatives": Group(
        DERIVATIVES,
        (
            f"{MECHANICS}/dynamics",
            f"{MECHANICS}/methods/test_error_estimates.py",
            f"{MECHANICS}/methods/test_variational_steps.py",
            f"{MECHANICS}/sensitivity/test_exact.py",
            "tests/semantics/stage/test_duals.py",
        ),
        pace=LONG,
    ),
    "reductions": Group(
        (
            "ephs/mechanics/rewrite/*.py",
            "ephs/mechanics/constraints/subgroup.py",
            "ephs/mechanics/tree/engine/build.py",
            "ephs/mechanics/road/elimination.py",
            "ephs/mechanics/tree/engine/tables.py",
            "ephs/mechanics/tree/finding/mechanism.py",
            "ephs/mechanics/tree/finding/spanning.py",
        ),
        (f"{MECHANICS}/rewrite", f"{MECHANICS}/tree/engine", f"{MECHANICS}/test_stability_functions.py"),
    ),
    "named": Group(
        (),
        (
            "tests/operad",
            "tests/semantics",
            *PARTS,
            f"{MECHANICS}/methods",
            f"{MECHANICS}/imports",
            "tests/solve/test_ledgers.py",
            "tests/solve/test_journal.py",
        ),
    ),
}


def sample(mutants: Sequence[Mutant], count: int, seed: int) -> list[Mutant]:
    """As equally many of each function as can be, drawn by a seed; edits elsewhere do not change the draw."""

    def lot(name: str) -> bytes:
        return sha256(f"{seed} {name}".encode()).digest()

    of: dict[str, list[Mutant]] = {}
    for mutant in sorted(mutants, key=lambda m: lot(m.name)):
        of.setdefault(f"{mutant.file} {mutant.function}", []).append(mutant)
    piles = [of[function] for function in sorted(of, key=lot)]
    drawn = [pile[turn] for turn in range(max(map(len, piles), default=0)) for pile in piles if turn < len(pile)]
    return drawn[:count]
