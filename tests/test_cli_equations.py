"""`ephs equations` takes the forms of runs, and those of the equations themselves."""

from ephs import cli
from tests.scenes import ROOT


def printed(capsys, form):
    assert cli.main(["equations", str(ROOT / "scenes/heavy-top.toml"), "--form", form]) == 0
    return capsys.readouterr().out


def test_the_form_of_the_paper_is_the_relation(capsys):
    assert printed(capsys, "paper") == printed(capsys, "relation") != printed(capsys, "descriptor")


def test_the_folded_form_has_no_transformers(capsys):
    paper, folded = printed(capsys, "paper"), printed(capsys, "folded")
    assert "joints.tip.o1" in paper and "joints.tip.o1" not in folded
    assert "bodies.top.ke.p.e = " in folded
