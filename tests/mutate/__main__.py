"""Make mutants, run tests, add up: ``python -m tests.mutate [GROUP...]``."""

import argparse
import json
import os
import sys
from pathlib import Path

from tests.mutate.equivalent import explained
from tests.mutate.groups import GROUPS, sample
from tests.mutate.mutants import ROOT, Mutant
from tests.mutate.reach import Reach, reach
from tests.mutate.server import preload, verdict
from tests.mutate.table import survivors, table

FOLDER = ROOT / ".build" / "mutate"


def arguments() -> argparse.Namespace:
    """What is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutate", description=__doc__)
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"of {', '.join(GROUPS)}; all, where none is named")
    parser.add_argument("--count", type=int, default=100, help="how many mutants of each group")
    parser.add_argument("--seed", type=int, default=0, help="which ones")
    parser.add_argument("--all", action="store_true", help="all mutants of each group")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these mutants, whatever is known of them")
    parser.add_argument(
        "--again", action="store_true", help="those again that lived and are not explained, and no others"
    )
    parser.add_argument("--keep", action="store_true", help="take what tests reach from a measurement of older sources")
    parser.add_argument("--budget", type=float, help="seconds of tests for each mutant, in place of the group's")
    parser.add_argument("--list", action="store_true", help="say which mutants there are, and make none")
    parser.add_argument("--table", action="store_true", help="only add up what is known of all")
    parser.add_argument("--results", type=Path, default=FOLDER / "results.jsonl", help="where verdicts are added")
    return parser.parse_args()


def main() -> int:
    """Run; 1 where a mutant lives that is not explained."""
    asked = arguments()
    if unknown := sorted({*asked.groups} - {*GROUPS}):
        raise SystemExit(f"no group {', '.join(unknown)}; there are {', '.join(GROUPS)}")
    chosen = {name: choice(asked, name) for name in asked.groups or GROUPS}
    if asked.list:
        for mutants in chosen.values():
            print(*(f"{m.name}: {m.change}" for m in mutants), sep="\n")
        return 0
    known = verdicts(asked.results)
    if not asked.table:
        run(asked, chosen, known)
        known = verdicts(asked.results)
    every = {name: GROUPS[name].mutants() for name in chosen}
    lived = {name: [m for m in mutants if _lives(m, known)] for name, mutants in every.items()}
    print(table(every, known, explained()))
    print(survivors(lived, explained()))
    return 1 if any(m.name not in explained() for mutants in lived.values() for m in mutants) else 0


def choice(asked: argparse.Namespace, name: str) -> list[Mutant]:
    """The mutants of a group that are asked for."""
    every = GROUPS[name].mutants()
    if asked.only:
        return [m for m in every if m.name in asked.only]
    return every if asked.all or name == "named" else sample(every, asked.count, asked.seed)


def verdicts(file: Path) -> dict[str, dict]:
    """What is known, by the mutant's name and what it changes; the last verdict counts."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.is_file() else []
    return {key(entry["name"], entry["change"]): entry for entry in map(json.loads, lines)}


def key(name: str, change: str) -> str:
    """Under which a verdict is kept."""
    return f"{name}: {change}"


def _lives(mutant: Mutant, known: dict[str, dict]) -> bool:
    entry = known.get(key(mutant.name, mutant.change))
    return entry is not None and not entry["killed"]


def run(asked: argparse.Namespace, chosen: dict[str, list[Mutant]], known: dict[str, dict]) -> None:
    """Make those that are not known yet, and add what is found to the file; a process for each group."""
    asked.results.parent.mkdir(parents=True, exist_ok=True)
    for name, mutants in chosen.items():
        if asked.again:
            todo = [m for m in GROUPS[name].mutants() if _lives(m, known) and m.name not in explained()]
        else:
            todo = [m for m in mutants if asked.only or key(m.name, m.change) not in known]
        if todo:
            sys.stdout.flush()
            if (child := os.fork()) == 0:
                make(asked, name, todo)
                os._exit(0)
            if os.waitpid(child, 0)[1] != 0:
                raise SystemExit(f"{name}: the process of the group did not end well")


def make(asked: argparse.Namespace, name: str, todo: list[Mutant]) -> None:
    """Make the mutants of one group."""
    group = GROUPS[name]
    preload()
    reached = reach(group.tests, group.pace, FOLDER, lambda line: print(line, flush=True), keep=asked.keep)
    for i, mutant in enumerate(todo, 1):
        tests = reached.tests(mutant, asked.budget or group.pace.budget, group.tests)
        entry = verdict(mutant, tests, limit(reached, tests)) | {"group": name}
        with asked.results.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry, ensure_ascii=False) + "\n")
        word = f"killed by {entry['by'].rpartition('/')[2]}" if entry["killed"] else f"LIVES, {entry['tests']} tests"
        print(f"{name} {i}/{len(todo)} {entry['seconds']:5.1f} s  {mutant.name}: {word}", flush=True)


def limit(reached: Reach, tests: list[str]) -> float:
    """Seconds of a processor after which a mutant counts as killed: some times what its tests take."""
    return 15.0 + 4.0 * sum(reached.seconds[test] for test in tests)


if __name__ == "__main__":
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[variable] = "1"
    sys.exit(main())
