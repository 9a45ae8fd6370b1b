"""`ephs equations` takes the forms of runs, and those of the equations themselves."""

from tests.scenes import ROOT
from tests.typed import typed


def printed(capsys, form):
    assert typed(f"equations {ROOT}/scenes/heavy-top.toml --form {form}") == 0
    return capsys.readouterr().out


def test_the_form_of_the_paper_is_the_relation(capsys):
    assert printed(capsys, "paper") == printed(capsys, "relation") != printed(capsys, "descriptor")


def test_the_folded_form_has_no_transformers(capsys):
    paper, folded = printed(capsys, "paper"), printed(capsys, "folded")
    assert "joints.tip.o1" in paper and "joints.tip.o1" not in folded
    assert "bodies.top.ke.p.e = " in folded
