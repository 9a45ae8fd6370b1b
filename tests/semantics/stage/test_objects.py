"""Object code: kept whole or not at all, loaded by a second process, the same bits for each kind of processor."""

import ctypes
import errno
import mmap
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ephs.semantics.stage import Entry, Program, llvm, objects, store, vector
from ephs.semantics.stage.errors import StageError
from ephs.semantics.stage.objects import TARGETS, compiled, emitted, fitting, telling
from ephs.semantics.stage.store import STORE, ObjectCacheWarning
from tests.processes import printed
from tests.semantics.stage.arm import Arm
from tests.semantics.stage.test_elementary import PROGRAM, inputs
from tests.staged import bits

pytestmark = pytest.mark.optimised

SMALL = Program("small", total=Entry(lambda on, x: x[0] * on.exp(x[1]), x=vector(2)))


@pytest.fixture
def compilations(monkeypatch):
    """The modules that LLVM compiles."""
    texts: list[str] = []

    def counted(text, *rest):
        texts.append(text)
        return llvm.compile_text(text, *rest)

    monkeypatch.setattr(objects, "compile_text", counted)
    return texts


def value(library: llvm.Library) -> float:
    """The result of the small program, called as C calls it."""
    x = np.array([2.0, 0.0])
    call = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p, ctypes.c_int64)(library.address("small_total"))
    return call(x.ctypes.data, 2)


def test_a_module_is_compiled_once(folder, compilations):
    assert [value(compiled(SMALL.text())) for _ in range(3)] == [2.0] * 3
    assert len(compilations) == 1 and len(list(folder.iterdir())) == 1


def test_targets_and_texts_have_names_of_their_own():
    texts = (SMALL.text(), PROGRAM.text())
    names = {objects.name_of(text, target) for text in texts for target in (*TARGETS.values(), llvm.host())}
    assert len(names) == len(texts) * (len(TARGETS) + 1)


def test_levels_of_optimisation_are_compiled_apart_and_give_the_same_value(folder, compilations, monkeypatch):
    values = []
    for level in objects.LEVELS:
        monkeypatch.setenv("EPHS_LLVM_LEVEL", level)
        values.append(value(compiled(SMALL.text())))
    assert values == [2.0] * len(objects.LEVELS)
    assert len(compilations) == len(list(folder.iterdir())) == len(objects.LEVELS)


@pytest.mark.parametrize("given", ["", "4", "fast"])
def test_another_level_is_refused_by_name(folder, monkeypatch, given):
    monkeypatch.setenv("EPHS_LLVM_LEVEL", given)
    with pytest.raises(StageError, match=f"EPHS_LLVM_LEVEL: an optimisation level is {given!r}, expected one of 0, 1"):
        compiled(SMALL.text())


@given(data=st.data())
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_spoilt_file_is_compiled_anew(folder, compilations, data):
    compiled(SMALL.text())
    (file,) = folder.iterdir()
    content = file.read_bytes()
    spoilt = bytearray(content)
    if data.draw(st.booleans()):
        spoilt[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    else:
        del spoilt[data.draw(st.integers(0, len(content) - 1)) :]
    file.write_bytes(spoilt)
    before = len(compilations)
    assert value(compiled(SMALL.text())) == 2.0
    assert len(compilations) == before + 1 and file.read_bytes() == content


def full(path, content):
    """A disk without room."""
    with open(path, "wb") as file:
        file.write(content[: len(content) // 2])
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def refused(path, *_args, **_keywords):
    """A folder of others."""
    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))


def sealed(path, *_args, **_keywords):
    """A disk that can only be read."""
    raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))


@pytest.mark.parametrize(
    ("method", "fault"), [("write_bytes", full), ("write_bytes", refused), ("replace", refused), ("mkdir", sealed)]
)
def test_a_disk_that_fails_costs_one_warning(folder, monkeypatch, method, fault):
    with monkeypatch.context() as broken:
        broken.setattr(Path, method, fault)
        with pytest.warns(ObjectCacheWarning, match="XDG_CACHE_HOME") as caught:
            assert value(compiled(SMALL.text())) == value(compiled(SMALL.text())) == 2.0
        assert len(caught) == 1
    assert not folder.exists() or not list(folder.iterdir())


def test_a_folder_that_can_only_be_read_serves(folder, compilations, monkeypatch):
    compiled(SMALL.text())
    for method in ("write_bytes", "mkdir", "replace"):
        monkeypatch.setattr(Path, method, sealed)
    monkeypatch.setattr(os, "utime", sealed)
    assert value(compiled(SMALL.text())) == 2.0
    assert len(compilations) == 1


def test_without_a_home_nothing_is_kept(monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", lambda: (_ for _ in ()).throw(RuntimeError))
    monkeypatch.setattr(STORE, "usable", True)
    with pytest.warns(ObjectCacheWarning, match="no home"):
        assert value(compiled(SMALL.text())) == 2.0


def test_what_is_compiled_is_told_while_it_is_and_once(folder):
    said: list[str] = []
    with telling(said.append):
        compiled(SMALL.text(), "small")
        assert said == ["small", ""]
        compiled(SMALL.text(), "small")  # from disk
    compiled(PROGRAM.text(), "another")
    assert said == ["small", ""]


def test_files_that_nobody_uses_are_removed(folder):
    compiled(SMALL.text())
    (used,) = folder.iterdir()
    unused = used.with_name("unused.o")
    unused.write_bytes(b"")
    old = time.time() - 2.0 * store.UNUSED  # the age of files; nothing is timed
    for file in (used, unused):
        os.utime(file, (old, old))
    store._prune.cache_clear()
    compiled(SMALL.text())  # used again
    compiled(PROGRAM.text())  # a new file is made
    assert used.exists() and not unused.exists()


def test_processes_at_once_leave_one_whole_file(folder):
    code = (
        "from tests.semantics.stage.test_objects import SMALL, compiled, value;"
        "assert value(compiled(SMALL.text())) == 2.0"
    )
    environment = os.environ | {"XDG_CACHE_HOME": str(folder.parent.parent)}
    running = [subprocess.Popen([sys.executable, "-c", code], env=environment) for _ in range(3)]
    assert [process.wait(timeout=120.0) for process in running] == [0, 0, 0]
    (file,) = folder.iterdir()
    assert STORE.read(file.name) is not None


def load_where_memory_is_scattered() -> None:
    """Load code and a table many times, in a process whose free places are small and 3 GiB apart."""
    system, page, block = ctypes.CDLL(None), 1 << 12, 3 << 30
    system.mmap.restype = ctypes.c_void_p
    system.mmap.argtypes = (ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long)
    system.munmap.argtypes = (ctypes.c_void_p, ctypes.c_size_t)
    code = llvm.compile_text(
        f"@table = internal constant [4096 x i64] [{', '.join(f'i64 {k}' for k in range(4096))}]\n"
        "define i64 @pick(i64 %k) {\n%at = getelementptr [4096 x i64], ptr @table, i64 0, i64 %k\n"
        "%found = load i64, ptr %at\nret i64 %found\n}"
    )
    for _ in range(40):
        start = system.mmap(None, block, 0, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, -1, 0)
        system.munmap(start + block - page, page)
    pick = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)
    loaded = [llvm.load(code) for _ in range(200)]
    assert all(pick(library.address("pick"))(k) == k for k, library in enumerate(loaded))


def test_code_is_loaded_where_free_memory_is_scattered():
    """Addresses in code have 32 bits: code and tables of an object must be placed together."""
    code = "from tests.semantics.stage import test_objects; test_objects.load_where_memory_is_scattered()"
    printed(code)


def many() -> tuple[np.ndarray, np.ndarray]:
    """Inputs of which some give other bits if a product and a sum are fused: one in 500 does."""
    usual = np.random.default_rng(8).uniform(0.1, 3.0, (2, 6000))
    return tuple(np.concatenate([*pair]) for pair in zip(inputs(), usual, strict=True))


def evaluated(library: llvm.Library) -> np.ndarray:
    """All functions at all inputs, called as C calls them."""
    x, y = many()
    out = np.zeros(5 * x.size)
    pair = (ctypes.c_void_p, ctypes.c_int64)
    call = ctypes.CFUNCTYPE(None, *pair, *pair, *pair)(library.address("elementary_all_of"))
    call(x.ctypes.data, x.size, y.ctypes.data, y.size, out.ctypes.data, out.size)
    return out


@pytest.mark.parametrize("name", [*fitting(llvm.host()), None])
def test_all_processors_that_fit_give_the_same_bits(name):
    code = llvm.compile_text(PROGRAM.text()) if name is None else emitted(PROGRAM.text(), name)
    assert bits(evaluated(llvm.load(code))) == bits(evaluated(compiled(PROGRAM.text())))


def in_emulator(text: str) -> np.ndarray:
    """All functions at all inputs on arm64."""
    x, y = many()
    out = np.zeros(5 * x.size)
    Arm(emitted(text, "linux-arm64")).call("elementary_all_of", "void", x, x.size, y, y.size, out, out.size)
    return out


def test_arm_gives_the_same_bits():
    assert bits(in_emulator(PROGRAM.text())) == bits(evaluated(compiled(PROGRAM.text())))


def test_arm_would_not_if_sums_and_products_were_fused():
    fused = PROGRAM.text().replace(" fmul ", " fmul contract ").replace(" fadd ", " fadd contract ")
    assert bits(in_emulator(fused)) != bits(evaluated(compiled(PROGRAM.text())))


@pytest.mark.parametrize("target", TARGETS)
def test_object_code_is_emitted_for_other_machines(target):
    code = emitted(SMALL.text(), target)
    starts = {"linux": b"\x7fELF", "macos": b"\xcf\xfa\xed\xfe", "windows": b"\x64\x86", "webassembly": b"\0asm"}
    assert code.startswith(starts[target.partition("-")[0]])
    assert code == emitted(SMALL.text(), target)


def test_the_header_declares_the_entry_functions():
    assert "double small_total(double *restrict x, int64_t x_size);" in SMALL.header()
    assert "void elementary_all_of(double *restrict x, int64_t x_size, " in PROGRAM.header()


def test_a_header_that_is_ready_for_cpp_is_no_other_for_c():
    body = [line for line in SMALL.header().splitlines() if not line.startswith("#")]
    assert body == ['extern "C" {', "double small_total(double *restrict x, int64_t x_size);", "}"]


CALLER = """
#include "small.h"
int main(void) { double x[2] = {2.0, 0.0}; return small_total(x, 2) == 2.0 ? 0 : 1; }
"""


@pytest.mark.parametrize("language", ["c", "c++"])
def test_c_calls_the_object_code(tmp_path, language):
    (tmp_path / "small.h").write_text(SMALL.header())
    (tmp_path / "small.o").write_bytes(llvm.compile_text(SMALL.text()))
    (tmp_path / "main.c").write_text(CALLER)
    if shutil.which("cc") is None:  # then Python calls it, by the same convention
        assert value(llvm.load((tmp_path / "small.o").read_bytes())) == 2.0
        return
    warnings = ["-Wall", "-Wextra", "-Werror", *(["-std=c99", "-pedantic"] if language == "c" else [])]
    compile_and_link = ["cc", *warnings, "-x", language, "main.c", "-x", "none", "small.o", "-o", "main"]
    subprocess.run(compile_and_link, cwd=tmp_path, check=True)
    assert subprocess.run([tmp_path / "main"], check=False).returncode == 0
