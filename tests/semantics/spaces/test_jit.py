"""Compiled kernels are kept on disk, and a changed helper in another file never meets a stale kernel."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from ephs.semantics.spaces import jit

ROOT = Path(__file__).resolve().parents[3]
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


def run(code, folder, **environment):
    """Run code in a fresh process with a cache of its own."""
    variables = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA")}
    variables |= {"PYTHONPATH": str(folder), "XDG_CACHE_HOME": str(folder / "cache")} | environment
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, env=variables, cwd=folder
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def package(tmp_path):
    """A package named ephs with this decorator and two kernels in two files."""
    room = tmp_path / "ephs" / "semantics" / "spaces"
    room.mkdir(parents=True)
    for folder in (room, room.parent, room.parent.parent):  # a package of its own, before the one that is installed
        (folder / "__init__.py").touch()
    (room / "jit.py").write_bytes((ROOT / "ephs/semantics/spaces/jit.py").read_bytes())
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
    assert not list(package.glob("ephs/**/*.nbi"))
    # What it does not reach leaves it alone.
    (package / "ephs/semantics/spaces/other_kernels.py").write_text(HELPER.format(number=7.0))
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


def clear():
    jit.cache_folder.cache_clear()
    jit._base.cache_clear()


def test_unwritable_folder_warns_once_and_goes_on(tmp_path, monkeypatch):
    occupied = tmp_path / "file"
    occupied.write_text("not a folder")
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(occupied))
    clear()
    try:
        with pytest.warns(jit.KernelCacheWarning, match="XDG_CACHE_HOME") as caught:
            plain, other = jit.kernel(_double), jit.kernel(_double)
        assert len(caught) == 1
        assert plain(2.0) == other(2.0) == 4.0
    finally:
        clear()


def _double(x):
    return 2.0 * x


def test_decoration_leaves_the_setting_alone():
    from numba import config

    before = config.CACHE_DIR
    jit.kernel(_double)
    assert before == config.CACHE_DIR


def test_callbacks_have_addresses():
    callback = jit.cfunc_kernel("float64(float64)")(_double)
    assert callback.address != 0
    assert callback.ctypes(3.0) == 6.0


def test_every_file_that_makes_kernels_counts():
    sources = set(jit.kernel_sources())
    makers = {
        path
        for path in (ROOT / "ephs").rglob("*.py")
        if any(line.startswith(("@kernel", "@cfunc_kernel", "@jit.")) for line in path.read_text().splitlines())
    }
    assert makers
    assert makers <= sources
