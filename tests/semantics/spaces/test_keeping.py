"""What is kept of compiled kernels is whole, or it is as if it were not there; a disk that fails costs time only."""

import errno
import os
import time
from pathlib import Path

import numba
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ephs.semantics.spaces import jit, keeping
from ephs.semantics.spaces.keeping import DISK, KernelFiles


def root(x):
    """Compiled in the tests."""
    return x**0.5


def compiled(folder, function=root):
    """The function as a process finds it that has not called it yet."""
    made = numba.njit(function)
    made._cache = KernelFiles(function, folder, "")
    return made


def hits(made):
    return sum(made.stats.cache_hits.values())


@pytest.fixture(autouse=True)
def usable(monkeypatch):
    monkeypatch.setattr(DISK, "usable", True)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A folder with one kernel, and its file."""
    folder = tmp_path_factory.mktemp("kernels")
    assert compiled(folder)(4.0) == 2.0
    (file,) = folder.iterdir()
    return file, file.read_bytes()


def test_signatures_are_kept_side_by_side(tmp_path):
    assert compiled(tmp_path)(4.0) == compiled(tmp_path)(4) == 2.0
    assert len(list(tmp_path.iterdir())) == 2
    again = compiled(tmp_path)
    assert again(9.0) == again(9) == 3.0
    assert hits(again) == 2


@pytest.mark.parametrize("kept", [0, 1, 31, 32, 33, 0.5, 0.99])
def test_files_cut_short_are_compiled_anew_and_replaced(whole, kept):
    file, content = whole
    file.write_bytes(content[: kept if isinstance(kept, int) else int(kept * len(content))])
    made = compiled(file.parent)
    assert made(4.0) == 2.0
    assert hits(made) == 0
    after = compiled(file.parent)
    assert (after(9.0), hits(after)) == (3.0, 1)


@given(st.data())
def test_no_spoilt_byte_is_taken(whole, data):
    file, content = whole
    at = data.draw(st.integers(0, len(content) - 1))
    spoilt = bytearray(content)
    spoilt[at] ^= data.draw(st.integers(1, 255))
    file.write_bytes(spoilt)
    made = compiled(file.parent)
    signature = (numba.float64,)
    assert made._cache.load_overload(signature, made.targetctx) is None
    file.write_bytes(content)
    assert made._cache.load_overload(signature, made.targetctx) is not None


def test_a_file_of_another_kernel_is_not_taken(whole, tmp_path):
    _, content = whole
    made = compiled(tmp_path)
    made._cache = KernelFiles(root, tmp_path, "another text")
    assert made(4.0) == 2.0
    (other,) = tmp_path.iterdir()
    other.write_bytes(content)
    again = compiled(tmp_path)
    again._cache = KernelFiles(root, tmp_path, "another text")
    assert (again(4.0), hits(again)) == (2.0, 0)


def test_a_kernel_can_be_forgotten(tmp_path):
    made = compiled(tmp_path)
    made(4.0)
    made._cache.flush()
    assert not list(tmp_path.iterdir())


def full(path, content):
    with open(path, "wb") as file:
        file.write(content[: len(content) // 2])
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def sealed(path, *_args, **_keywords):
    raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))


def refused(path, *_args, **_keywords):
    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))


@pytest.mark.parametrize(
    ("method", "fault", "says"),
    [
        ("write_bytes", full, "No space left"),
        ("write_bytes", refused, "Permission denied"),
        ("replace", refused, "Permission denied"),
        ("mkdir", sealed, "Read-only file system"),
        ("mkdir", refused, "Permission denied"),
    ],
)
def test_a_disk_that_fails_costs_one_warning(tmp_path, monkeypatch, method, fault, says):
    monkeypatch.setattr(Path, method, fault)
    with pytest.warns(jit.KernelCacheWarning, match=f"(?s){says}.*XDG_CACHE_HOME") as caught:
        assert compiled(tmp_path)(4.0) == compiled(tmp_path)(9.0) - 1.0 == 2.0
        assert compiled(tmp_path)(4) == 2.0
    assert len(caught) == 1
    monkeypatch.undo()
    assert not list(tmp_path.iterdir())


def test_a_file_in_the_place_of_the_folder_costs_one_warning(tmp_path):
    occupied = tmp_path / "file"
    occupied.touch()
    with pytest.warns(jit.KernelCacheWarning, match="file") as caught:
        assert compiled(occupied / "ephs")(4.0) == compiled(occupied / "ephs")(4.0) == 2.0
    assert len(caught) == 1


def test_what_cannot_be_written_is_read_without_a_warning(whole, monkeypatch):
    file, content = whole
    file.write_bytes(content)
    for method in ("write_bytes", "mkdir", "replace"):
        monkeypatch.setattr(Path, method, sealed)
    made = compiled(file.parent)
    assert (made(4.0), hits(made)) == (2.0, 1)


def test_what_cannot_be_read_is_compiled(whole, monkeypatch):
    file, content = whole
    file.write_bytes(content)
    monkeypatch.setattr(Path, "read_bytes", refused)
    made = compiled(file.parent)
    assert (made(4.0), hits(made)) == (2.0, 0)


def homeless():
    raise RuntimeError("Could not determine home directory.")


def test_without_a_home_nothing_is_kept(monkeypatch):
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    jit.cache_folder.cache_clear()
    try:
        assert jit.cache_folder() is None
    finally:
        jit.cache_folder.cache_clear()
    with pytest.warns(jit.KernelCacheWarning, match="no home") as caught:
        assert compiled(None)(4.0) == compiled(None)(4.0) == 2.0
    assert len(caught) == 1


def test_folders_are_absolute(monkeypatch):
    """A process that changes its folder goes on with its cache."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", "somewhere")
    jit.cache_folder.cache_clear()
    try:
        assert jit.cache_folder().is_absolute()
    finally:
        jit.cache_folder.cache_clear()


def test_addresses_of_this_process_are_not_kept(tmp_path):
    address = numba.cfunc("float64(float64)")(root).ctypes

    def call(x):
        return address(x)

    assert compiled(tmp_path, call)(4.0) == 2.0
    assert not list(tmp_path.iterdir())
    assert keeping.DISK.usable


def test_folders_that_nobody_uses_are_removed_in_the_end(tmp_path):
    folders = {name: tmp_path / (name * 24) for name in "abc"}
    other = tmp_path / "formulas"
    for folder in (folders["a"], folders["b"]):
        assert compiled(folder)(4.0) == 2.0
    other.mkdir()
    old = time.time() - 2.0 * keeping.UNUSED  # the age of folders; nothing is timed
    for folder in (folders["a"], folders["b"], other):
        os.utime(folder, (old, old))
    for once in (keeping._use, keeping._prune):  # as a later process
        once.cache_clear()
    assert compiled(folders["a"])(4.0) == 2.0  # used: it is as if it were new
    assert folders["a"].stat().st_mtime > old
    assert compiled(folders["c"])(4.0) == 2.0  # a new folder comes into being
    assert {folder.name[0] for folder in tmp_path.iterdir()} == {"a", "c", "f"}
