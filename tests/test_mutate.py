"""The breaks of `tests.mutate` still apply: each finds the text that it replaces, once."""

import pytest

from tests.mutate import MUTATIONS, ROOT


@pytest.mark.parametrize("name", MUTATIONS)
def test_a_break_finds_its_text(name):
    mutation = MUTATIONS[name]
    assert (ROOT / mutation.file).read_text(encoding="utf-8").count(mutation.old) == 1
    assert all((ROOT / tests).exists() for tests in mutation.tests)
