"""The tool that breaks things: what it changes, that names stay, and that what is broken is found."""

import ast

import pytest

from tests.mutate.equivalent import explained
from tests.mutate.groups import GROUPS, sample
from tests.mutate.mutants import ROOT, mutants_in, mutants_of
from tests.mutate.named import BREAKS, breaks
from tests.mutate.reach import Reach, files_at
from tests.mutate.server import forked, verdict
from tests.mutate.table import survivors, table

SOURCE = '''"""Text, 1 + 1."""
from somewhere import cross

AT = 3


def f(x: "tuple[int, 4]", n=2):
    """Text."""
    if x[0] < n and not x[1:]:
        raise ValueError(f"{n - 1}")
    x[-1] += -x[2] - 0.5  # a - comment
    for i in range(n):
        x = x.T @ (
            # one - way
            x
        )
    return cross(x, i), max(1e-9, n), True


class A:
    def g(self, y):
        z, w = nb.carray(y, 2), nb.carray(work, 9)
        return y in (1.5, 0)
'''


def test_each_kind_of_change_is_made():
    found = [(m.function, m.kind, m.change) for m in mutants_in("some/file.py", SOURCE.encode())]
    assert found == [
        ("module", "constant", "AT = ⟦3 → 4⟧"),
        ("f", "constant", 'def f(x: "tuple[int, 4]", n=⟦2 → 3⟧):'),
        ("f", "logic", "if x[0] < n ⟦and → or⟧ not x[1:]:"),
        ("f", "comparison", "if x[0] ⟦< → <=⟧ n and not x[1:]:"),
        ("f", "comparison", "if x[0] ⟦< → >=⟧ n and not x[1:]:"),
        ("f", "index", "if x[⟦0 → 1⟧] < n and not x[1:]:"),
        ("f", "logic", "if x[0] < n and ⟦not → ⟧x[1:]:"),
        ("f", "index", "if x[0] < n and not x[⟦1 → 2⟧:]:"),
        ("f", "index", "if x[0] < n and not x[⟦1 → 0⟧:]:"),
        ("f", "sign", "x[-1] ⟦+= → -=⟧ -x[2] - 0.5"),
        ("f", "index", "x[⟦-1 → -2⟧] += -x[2] - 0.5"),
        ("f", "sign", "x[-1] += -x[2] ⟦- → +⟧ 0.5"),
        ("f", "sign", "x[-1] += ⟦- → ⟧x[2] - 0.5"),
        ("f", "index", "x[-1] += -x[⟦2 → 3⟧] - 0.5"),
        ("f", "index", "x[-1] += -x[⟦2 → 1⟧] - 0.5"),
        ("f", "constant", "x[-1] += -x[2] - ⟦0.5 → 1.0⟧"),
        ("f", "range", "for i in range(⟦n → (n) - 1⟧):"),
        ("f", "order", "x = ⟦x.T @ ( x ) → (x) @ (x.T)⟧"),
        ("f", "transpose", "x = x⟦.T → ⟧ @ ("),
        ("f", "order", "return cross(⟦x, i → i, x⟧), max(1e-9, n), True"),
        ("f", "extreme", "return cross(x, i), ⟦max → min⟧(1e-9, n), True"),
        ("f", "logic", "return cross(x, i), max(1e-9, n), ⟦True → False⟧"),
        ("A.g", "length", "z, w = nb.carray(y, ⟦2 → 1⟧), nb.carray(work, 9)"),
        ("A.g", "comparison", "return y ⟦in → not in⟧ (1.5, 0)"),
        ("A.g", "constant", "return y in (⟦1.5 → 3.0⟧, 0)"),
        ("A.g", "constant", "return y in (1.5, ⟦0 → 1⟧)"),
    ]


def test_what_runs_when_a_module_is_loaded_is_told():
    found = {(m.function, m.kind): m.loading for m in mutants_in("a.py", SOURCE.encode())}
    assert found["module", "constant"] and not found["f", "sign"] and not found["A.g", "constant"]
    text = b"class A:\n    x = 1.5\n    def f(self, y=2):\n        return 3\n"
    assert [m.loading for m in mutants_in("a.py", text)] == [True, True, False]


def test_every_change_is_python_and_is_one():
    same = ast.dump(ast.parse(SOURCE))
    for mutant in mutants_in("some/file.py", SOURCE.encode()):
        assert ast.dump(ast.parse(mutant.text(SOURCE.encode()))) != same


def test_names_are_unique_and_outlive_edits_elsewhere():
    before = {m.name: m.change for m in mutants_in("a.py", SOURCE.encode())}
    edited = SOURCE.replace("AT = 3", "AT = 3\nMORE = [1, 2, 3]\n").replace("return y in", "return y and y in")
    after = {m.name: m.change for m in mutants_in("a.py", edited.encode())}
    assert len(before) == len(mutants_in("a.py", SOURCE.encode()))
    assert [after[name] for name in before if " f " in name] == [c for name, c in before.items() if " f " in name]


def test_a_sample_is_drawn_by_its_seed_evenly_over_functions():
    every = mutants_in("a.py", SOURCE.encode())
    assert sample(every, 6, 1) == sample(every, 6, 1) != sample(every, 6, 2)
    assert {m.function for m in sample(every, 3, 0)} == {"module", "f", "A.g"}
    assert len(sample(every, 100, 0)) == len(every)


@pytest.mark.parametrize("name", GROUPS)
def test_a_group_has_files_tests_and_mutants(name):
    group = GROUPS[name]
    assert group.mutants()
    assert all((ROOT / path).exists() for path in group.tests)
    assert all(list(ROOT.glob(pattern)) for pattern in (*group.files, *group.without))


def test_what_is_explained_exists_and_says_why():
    known = {name: change for name, (change, _) in explained().items()}
    every = {m.name: m.change for file in {name.split()[0] for name in known} for m in mutants_of(file)}
    assert {name: every.get(name) for name in known} == known
    assert all(len(why) > 20 for _, why in explained().values())


def test_breaks_by_hand_find_their_text_once():
    assert len(breaks()) == len(BREAKS)


def test_a_test_that_fails_kills_and_one_that_does_not_reach_lets_live():
    mutant = next(m for m in breaks() if "(mf)" in m.function)
    path = "tests/semantics/test_primitives.py"
    reached = Reach(
        {f"{path}::a": 2.0, f"{path}::b": 1.0}, {mutant.file: {mutant.lines[0]: {f"{path}::a", f"{path}::b"}}}, {}
    )
    assert reached.tests(mutant, 10.0, [path]) == [f"{path}::b", f"{path}::a"]
    assert reached.tests(mutant, 1.5, [path]) == [f"{path}::b"]
    assert reached.tests(mutant, 10.0, ["tests/operad"]) == []
    assert verdict(mutant, [], 1.0)["killed"] is False


# Python 3.12 warns where a process with threads is forked, such as one of several that run tests.
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_process_that_takes_too_long_is_ended():
    def work(tell):
        tell("begun")
        while True:
            pass

    assert forked(work, 1.0) == (None, ["begun"])


def test_the_table_counts_both_ways():
    every = mutants_in("a.py", SOURCE.encode())[:4]
    known = {
        f"{m.name}: {m.change}": {"name": m.name, "change": m.change, "killed": i < 2, "seconds": 1.0}
        for i, m in enumerate(every)
    }
    why = {every[2].name: (every[2].change, "nobody asks for it, and nobody could")}
    assert table({"a": every}, known, why).splitlines()[-1] == "| a | 4 | 4 | 2 | 1 | 1 | 50.0% | 75.0% | 1.0 |"
    assert "nobody could" in survivors({"a": every[2:]}, why)


def test_there_are_tests_to_find():
    assert (ROOT / "tests/test_mutate.py") in list(files_at(["tests/test_mutate.py"]))
