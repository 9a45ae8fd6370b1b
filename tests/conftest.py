"""Which examples are drawn: the same on every machine; `fuzz` draws anew for long, `mutate` looks for one failure."""

import os

# Several test processes, each with threads of its own for small matrices, would mostly wait for one another.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import importlib  # noqa: E402
import pkgutil  # noqa: E402
from typing import Any  # noqa: E402

import pytest  # noqa: E402
from hypothesis import HealthCheck, Phase, settings  # noqa: E402

import benchmarks  # noqa: E402
import ephs  # noqa: E402
from tests.durations import Durations, function_of, long_tests  # noqa: E402
from tests.show.browser import browser  # noqa: E402

# The suite of somebody else's package: test_downstream.py runs it, in a process of its own.
collect_ignore = ["downstream"]
collect_ignore_glob = ["*/test_*_browser.py"] if browser() is None else []


def pytest_report_header() -> str:
    """Say whether pages are looked at as a browser shows them."""
    return f"browser: {browser() or 'none, so tests of pages in it are left out'}"


def pytest_configure(config: pytest.Config) -> None:
    """Measure the tests, unless that is what runs them."""
    if not any(isinstance(plugin, Durations) for plugin in config.pluginmanager.get_plugins()):
        config.pluginmanager.register(Durations())


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that are long; `make test` leaves them to `make laws`."""
    long = long_tests()
    for item in items:
        if function_of(item.nodeid) in long:
            item.add_marker(pytest.mark.long)


SHARING = frozenset({"tests/semantics/stage/test_shipping.py"})
"""Files of tests that share what takes minutes to make, as all object code: one worker runs all of a file."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Send the tests of a file that shares to one worker, all others to whichever is free.

    The mark ``xdist_group`` relies on a private attribute of tests that pytest 9.2 no longer has.
    """
    from xdist.scheduler import LoadScopeScheduling

    class Sharing(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return file if file in SHARING else nodeid

    return Sharing(config, log)


# Hypothesis also draws constants that it reads in modules of the checkout that are loaded. With all of them loaded a
# file draws the same examples alone, in the whole suite, and in any order.
for package in (ephs, benchmarks):
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)

COMPILING = [HealthCheck.too_slow]  # programs are compiled while mechanisms of a new class are drawn
settings.register_profile(
    "same", derandomize=True, deadline=None, max_examples=50, print_blob=True, suppress_health_check=COMPILING
)
# A broken law is enough; which of its counterexamples is smallest does not matter.
settings.register_profile(
    "mutate", derandomize=True, deadline=None, max_examples=20, database=None, phases=[Phase.explicit, Phase.generate]
)
# Where CI is set, Hypothesis' own defaults draw the same again.
settings.register_profile("fuzz", derandomize=False, deadline=None, max_examples=5000, suppress_health_check=COMPILING)
settings.load_profile("same")
