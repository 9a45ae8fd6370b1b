"""The same input gives the same result bit for bit: across processes, threads, hash seeds, however fast the machine."""

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from threading import Event, Thread

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import ephs
from ephs.mechanics.methods.registry import METHODS
from ephs.solve.running import loop
from ephs.solve.running.threads import in_one_thread
from tests.processes import printed
from tests.repeat import contents, digest
from tests.scenes import ROOT, shipped


def digests(threads: str, seed: str) -> subprocess.Popen:
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    environment = os.environ | dict.fromkeys(names, threads) | {"PYTHONHASHSEED": seed}
    command = [sys.executable, "-m", "tests.repeat"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, cwd=ROOT)


def test_threads_and_hash_seeds_change_nothing():
    """One scene with heat, one with a loop, and a system with a function of one's own, by every method."""
    first, second = (json.loads(run.communicate()[0]) for run in (digests("1", "0"), digests("4", "4242")))
    assert {name.partition("-")[0] for name in first} - {"sweep"} == set(METHODS), "every method has runs"
    assert {name for name in first if first[name] != second[name]} == set()


@pytest.mark.parametrize("method", ["natural", "natural4"])
@pytest.mark.parametrize(
    ("file", "until", "step"),
    [
        ("scenes/hot-brake.toml", 0.5, 0.01),
        ("scenes/four-bar.toml", 0.5, 0.01),
        ("benchmarks/scenes/four-bar-windows-1.toml", 2.0, 0.02),  # through configurations in which it can branch
    ],
)
def test_how_fast_the_machine_is_changes_nothing(method, file, until, step, monkeypatch):
    """Steps are taken many at a time, as many as the time that the last ones took allows."""
    scene = ephs.load(ROOT / file)
    found = set()
    for largest, response in ((1, 0.1), (3, 0.1), (4096, 1e9)):
        monkeypatch.setattr(loop, "BURST", largest)
        monkeypatch.setattr(loop, "RESPONSE", response)
        found.add(digest(contents(ephs.simulate(scene, until, method=method, step=step))))
    assert len(found) == 1


@pytest.mark.parametrize("method", ["rk54", "rk87"])
def test_how_many_steps_a_compiled_call_takes_changes_nothing(method, monkeypatch):
    scene = shipped("four-bar")
    found = set()
    for burst, response in ((1, 0.1), (3, 0.1), (2000, 1e9)):
        monkeypatch.setattr(loop, "BURST", burst)
        monkeypatch.setattr(loop, "RESPONSE", response)
        found.add(digest(contents(ephs.simulate(scene, 0.5, method=method))))
    assert len(found) == 1


def threads() -> set[int]:
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_libraries_that_come_later_take_one_thread_too():
    """SUNDIALS brings a library of its own when it is first imported."""
    text = """
from threadpoolctl import threadpool_info, threadpool_limits
from ephs.solve.running.threads import in_one_thread
seen = in_one_thread(lambda: {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"})
for module in ("numpy", "sksundae.ida"):
    __import__(module)
    with threadpool_limits(2, "blas"):
        print(module, seen())
"""
    assert printed(text) == "numpy {1}\nsksundae.ida {1}\n"


def test_linear_algebra_takes_one_thread_until_the_last_call_is_done():
    seen = []

    @in_one_thread
    def inner():
        seen.append(threads())

    @in_one_thread
    def outer():
        other = Thread(target=inner)
        other.start()
        other.join()
        seen.append(threads())
        raise ValueError

    in_one_thread(threads)()  # loads the libraries
    with threadpool_limits(2, "blas"):
        with pytest.raises(ValueError):
            outer()
        assert threads() == {2}
    assert seen == [{1}, {1}]


def test_any_thread_takes_one_thread_of_linear_algebra_and_restores_it():
    """The thread that was first to limit libraries is not the only one that can."""
    begun, ended, seen = Event(), Event(), []

    @in_one_thread
    def inner():
        begun.set()
        ended.wait()
        seen.append(threads())

    in_one_thread(threads)()  # loads the libraries
    with threadpool_limits(2, "blas"):
        other = Thread(target=inner)
        other.start()
        begun.wait()
        in_one_thread(ended.set)()  # the other thread is last to end
        other.join()
        assert seen == [{1}]
        assert threads() == {2}


@pytest.mark.parametrize(("method", "until"), [("rk87", 0.5), ("radau", 0.05)])
def test_runs_in_several_threads_at_once_are_those_of_one(method, until):
    """Engines of one mechanism share tables; memory is each one's own, that of attached circuits, too."""
    scene = shipped("motor-four-bar")

    def run():
        return digest(contents(ephs.simulate(scene, until, method=method, rtol=1e-8)))

    with ThreadPoolExecutor(4) as pool:
        found = {each.result() for each in [pool.submit(run) for _ in range(8)]}
    assert found == {run()}
