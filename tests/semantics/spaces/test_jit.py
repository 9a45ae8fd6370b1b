"""Compiled kernels are kept on disk, and a changed helper in another file never meets a stale kernel."""

import ast
import os
import subprocess
import sys
from functools import cache

import pytest

from ephs.semantics.spaces import jit

ROOT = jit.PACKAGE.parent  # where it is installed, which need not be beside the tests
HELPER = """
from ephs.semantics.spaces.jit import kernel
@kernel
def helper(x):
    return x + {number}
"""
CALLER = """
from ephs.semantics.spaces.jit import kernel
from ephs.semantics.spaces.helper_kernels import helper
@kernel
def caller(x):
    return helper(x)
"""
RUN = """
from ephs.semantics.spaces.caller_kernels import caller
print(caller(1.0), getattr(caller, "stats", None))
"""


def environment(folder, **more):
    """Of a process that imports from a folder and has a cache of its own there."""
    variables = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA")}
    # Python's own compiled files are told apart by whole seconds and sizes, which are too coarse for these edits.
    fixed = {"PYTHONPATH": str(folder), "XDG_CACHE_HOME": str(folder / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    return variables | fixed | more


def run(code, folder, **more):
    """Run code in a fresh process with a cache of its own."""
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, env=environment(folder, **more), cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def package(tmp_path):
    """A package named ephs with this decorator and two kernels in two files."""
    room = tmp_path / "ephs" / "semantics" / "spaces"
    room.mkdir(parents=True)
    for folder in (room, room.parent, room.parent.parent):  # a package of its own, before the one that is installed
        (folder / "__init__.py").touch()
    for file in ("jit.py", "keeping.py"):
        (room / file).write_bytes((ROOT / "ephs/semantics/spaces" / file).read_bytes())
    (room / "helper_kernels.py").write_text(HELPER.format(number=1.0))
    (room / "caller_kernels.py").write_text(CALLER)
    return tmp_path


def test_cache_is_used_and_never_stale(package):
    first = run(RUN, package)
    assert first.startswith("2.0 ")
    assert "cache_hits=Counter(), cache_misses=Counter({(float64,): 1})" in first
    again = run(RUN, package)
    assert again.startswith("2.0 ")
    assert "cache_hits=Counter({(float64,): 1}), cache_misses=Counter()" in again
    # The caller's own file stays as it is; only what it calls changes.
    (package / "ephs/semantics/spaces/helper_kernels.py").write_text(HELPER.format(number=5.0))
    assert run(RUN, package).startswith("6.0 ")
    assert not list(package.glob("ephs/**/*.kernel"))
    # What it does not reach leaves it alone.
    (package / "ephs/semantics/spaces/other_kernels.py").write_text(HELPER.format(number=7.0))
    assert "cache_hits=Counter({(float64,): 1}), cache_misses=Counter()" in run(RUN, package)


CONSTANT = "NUMBER = {number}\n"
SHIFTED = """
from ephs.semantics.spaces.jit import kernel
from ephs.semantics.constants import (  # over several lines
    NUMBER,
)
@kernel
def helper(x):
    return x + NUMBER
"""


def test_changed_constants_are_compiled_anew(package):
    (package / "ephs/semantics/spaces/helper_kernels.py").write_text(SHIFTED)
    (package / "ephs/semantics/constants.py").write_text(CONSTANT.format(number=2.0))
    assert run(RUN, package).startswith("3.0 ")
    (package / "ephs/semantics/constants.py").write_text(CONSTANT.format(number=7.0))
    assert run(RUN, package).startswith("8.0 ")


def test_what_a_process_has_imported_counts_not_what_the_file_says_now(package):
    """A helper that changes while a process runs is not filed, as it was, under what it is."""
    change = (
        "from ephs.semantics.spaces import helper_kernels\n"
        f"open(helper_kernels.__file__, 'w').write({HELPER.format(number=5.0)!r})\n"
    )
    assert run(change + RUN, package).startswith("2.0 ")
    assert run(RUN, package).startswith("6.0 ")


def test_settings_of_the_compiler_count(package):
    run(RUN, package)
    assert "cache_hits=Counter()" in run(RUN, package, NUMBA_OPT="0")
    assert "cache_hits=Counter({(float64,): 1})" in run(RUN, package)


def test_processes_at_once_share_an_empty_cache(package):
    variables = environment(package)
    command = [sys.executable, "-W", "error", "-c", RUN]
    started = [
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=variables, cwd=package)
        for _ in range(3)
    ]
    for process in started:
        out, fault = process.communicate()
        assert (process.returncode, fault, out[:4]) == (0, "", "2.0 ")
    assert "cache_hits=Counter({(float64,): 1}), cache_misses=Counter()" in run(RUN, package)
    assert not list(package.rglob("*.tmp"))


def test_a_process_that_is_killed_while_it_writes_leaves_nothing_that_others_take(package):
    killed = (
        "import os, pathlib\n"
        "whole = pathlib.Path.write_bytes\n"
        "def half(path, content):\n"
        "    whole(path, content[: len(content) // 2])\n"
        "    os._exit(9)\n"
        "pathlib.Path.write_bytes = half\n"
    )
    done = subprocess.run([sys.executable, "-c", killed + RUN], env=environment(package), cwd=package)
    assert done.returncode == 9
    assert len(list(package.rglob("*.tmp"))) == 1
    assert "cache_hits=Counter(), cache_misses=Counter({(float64,): 1})" in run(RUN, package)
    assert "cache_hits=Counter({(float64,): 1}), cache_misses=Counter()" in run(RUN, package)


def test_without_compilation_kernels_are_plain_functions(package):
    assert run(RUN, package, NUMBA_DISABLE_JIT="1") == "2.0 None\n"
    assert not (package / "cache").exists()


def test_real_kernels_run_without_compilation():
    code = (
        "import numpy as np\n"
        "from ephs.semantics.spaces import se3_kernels as k\n"
        "x = np.array([1.0, 0, 0, 0, 0, 0, 0]); v = np.full(6, 0.3); w = np.empty(6)\n"
        "k.retract(k.SE3, x, v, x); k.increment(k.SE3, np.eye(7)[0], x, w); print(abs(w - v).max() < 1e-15)"
    )
    variables = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=variables)
    assert done.stdout == "True\n", done.stderr


def _double(x):
    return 2.0 * x


def test_functions_from_elsewhere_are_not_kept(tmp_path, monkeypatch):
    """What they reach is not known, so they could go stale."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    jit.cache_folder.cache_clear()
    try:
        assert jit.kernel(_double)(2.0) == 4.0
    finally:
        jit.cache_folder.cache_clear()
    assert not list(tmp_path.iterdir())


def test_callbacks_have_addresses():
    callback = jit.cfunc_kernel("float64(float64)")(_double)
    assert callback.address != 0
    assert callback.ctypes(3.0) == 6.0


SOURCES = [path for path in sorted((ROOT / "ephs").rglob("*.py")) if jit.is_source(path)]


def test_every_file_that_makes_kernels_counts():
    makers = {
        path
        for path in (ROOT / "ephs").rglob("*.py")
        if any(line.startswith(("@kernel", "@cfunc_kernel", "@jit.")) for line in path.read_text().splitlines())
    }
    assert makers
    assert makers <= set(SOURCES)


def names_in(tree):
    return {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}


@cache
def definitions(path):
    """For each name of a file: the names, here and in other files, from which it is made; None stands for all there."""
    found = {}
    for node in ast.parse(path.read_text()).body:
        match node:
            case ast.ImportFrom(module=str(module), names=names) if module.startswith("ephs"):
                folder = ROOT.joinpath(*module.split("."))
                file = folder.with_suffix(".py") if folder.with_suffix(".py").is_file() else folder / "__init__.py"
                for alias in names:
                    inside = folder / f"{alias.name}.py"
                    at = (inside, None) if inside.is_file() else (file, alias.name)
                    found[alias.asname or alias.name] = {at}
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                found[name] = {(path, used) for used in names_in(node)}
            case ast.Assign(targets=targets, value=value):
                for target in targets:
                    found |= {name: {(path, used) for used in names_in(value)} for name in names_in(target)}
            case ast.AnnAssign(target=ast.Name(id=name), value=value) if value:
                found[name] = {(path, used) for used in names_in(value)}
    return found


@cache
def files_of(path, name):
    """The files in which a name of a file, and all from which it is made, is defined."""
    found, rest = set(), [(path, name)]
    while rest:
        at = rest.pop()
        if at not in found:
            found.add(at)
            here = definitions(at[0])
            rest += set().union(*here.values()) if at[1] is None else here.get(at[1], set())
    return {file for file, _ in found}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_all_that_kernels_take_from_others_is_in_their_fingerprint(path):
    known = set(jit.sources_of(path))
    for function in ast.parse(path.read_text()).body:
        if not isinstance(function, ast.FunctionDef):
            continue
        if "kernels" in path.name or any("kernel" in ast.unparse(mark) for mark in function.decorator_list):
            for name in names_in(function):
                assert files_of(path, name) <= known, f"{function.name} takes {name} from beyond"
