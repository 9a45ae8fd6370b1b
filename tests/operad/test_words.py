"""What the syntax prints and says is what was read and found good."""

import json

import pytest

from tests.operad.words import GOLDEN, words

EXPECTED = json.loads(GOLDEN.read_text(encoding="utf-8")) if GOLDEN.exists() else {}
WORDS = words()


@pytest.mark.parametrize("what", sorted(EXPECTED | WORDS))
def test_it_says_what_it_said(what):
    assert WORDS[what]() == EXPECTED.get(what)
