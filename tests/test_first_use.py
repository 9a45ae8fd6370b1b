"""The first minutes: what one is told, what one is given to start from, and what a slip of the keys leads to."""

import re
import runpy
from pathlib import Path

import pytest

import ephs
from ephs import library as lib
from ephs.cli import commands as cli
from ephs.cli.new import TEMPLATES
from ephs.cli.next import EXAMPLES, commands
from ephs.cli.progress import said_of, seldom
from tests.processes import printed
from tests.scenes import ROOT, shipped
from tests.typed import typed


@pytest.fixture
def here(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def made(like):
    name = f"my-{like}"
    assert typed(f"new {name} --like {like}") == 0
    suffix = Path(TEMPLATES[like][0]).suffix
    return f"{name}{suffix}:{like}" if suffix == ".py" else f"{name}{suffix}"


@pytest.mark.parametrize("like", TEMPLATES)
def test_what_new_writes_is_sound_and_runs(here, capsys, like):
    model = made(like)
    assert f"ephs run {model} --until 5" in capsys.readouterr().out
    assert typed(f"check {model}") == 0
    if like == "oscillator":
        system = runpy.run_path(model.partition(":")[0])["oscillator"]
        solution = ephs.simulate(system, 0.5, initial={"spring.q": 1.0})
    else:
        solution = ephs.simulate(ephs.load(model), 0.5)
    assert solution.energy_error.max() < 1e-6  # the tolerance where none is given
    assert (solution.heat[-1] > 0.0) == (like not in ("double-pendulum", "spinning-body"))


@pytest.mark.parametrize("like", TEMPLATES)
def test_what_new_writes_names_itself_and_nothing_else(here, like):
    text = Path(made(like).partition(":")[0]).read_text()
    assert "NAME" not in text
    assert f"my-{like}" in text


def test_lengths_of_the_closed_loops_can_be_changed(here):
    made("four-bar")
    file = Path("my-four-bar.toml")
    file.write_text(file.read_text().replace("position = [0.45,", "position = [0.5,"))
    scene = ephs.load(file)
    solution = ephs.simulate(scene, 0.1, step=0.01)
    assert solution.constraint_error.max() < 1e-10


def test_new_never_writes_over_a_file(here, capsys):
    Path("taken.toml").write_text("mine")
    assert typed("new taken") == 2
    assert "taken.toml: the file exists" in capsys.readouterr().err
    assert Path("taken.toml").read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("new a.json", [".json", ".toml"]),
        ("new a.toml --like oscillator", [".toml", ".py", "oscillator"]),
        ("new a --like four-bra", ["four-bra", "four-bar"]),
        ("new", ["NAME"]),
        ("new /", ["expected a name"]),
        ("rnu a", ["ephs rnu", "did you mean ephs run?"]),
        ("chart stabilty", ["ephs chart stabilty", "ephs chart stability?"]),
        ("frobnicate", ["frobnicate", "run, check, draw"]),
        ("a.toml", ["ephs run a.toml --until 5"]),
        ("run scnee.toml --until 1", ["scnee.toml", 'did you mean "scene.toml"?']),
        ("run scene --until 1", ["scene: no such file", 'did you mean "scene.toml"?']),
        ("check mine.pi:model", ["no such file"]),
        ("check mime.py:model", ["mime.py: no such file", 'did you mean "mine.py"?']),
        ("check mine.py:modle", ["no System or Scene modle in it", 'did you mean "model"?']),
        ("draw scene.toml -o a.sgv", ["a.sgv", 'did you mean ".svg"?']),
        ("run scene.toml --until 1 --method natral", ["natral", "did you mean 'natural'?"]),
        ("run scene.toml --until 1 --form redced", ["redced", "reduced"]),
        ("run scene.toml --utnil 1", ["--utnil", "--until"]),
        ("--hlep", ["--hlep"]),
    ],
)
def test_slips_are_met_with_the_nearest_name(here, capsys, words, expected):
    made("spinning-body")
    Path("my-spinning-body.toml").rename("scene.toml")
    Path("mine.py").write_text("from ephs import library as lib\nfrom ephs import Pattern\n"
                               "model = Pattern.from_text('s: entropy; env(s)')(env=lib.environment())\n")  # fmt: skip
    capsys.readouterr()
    assert typed(words) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in expected), said
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("options", "expected"),
    [({"method": "rk45"}, "'rk54'"), ({"form": "fodled"}, "'folded'"), ({"options": {"kepe": "energy"}}, "'keep'")],
)
def test_slips_in_python_are_met_with_the_nearest_name(options, expected):
    scene = shipped("mbs")
    with pytest.raises(ephs.OptionError, match=f"did you mean {expected}"):
        ephs.simulate(scene, 1.0, step=0.1, **{"method": "radau", **options})


def every_command():
    names = commands(cli.app)
    return [*names, *(f"{name} {inner}" for name in names for inner in commands(cli.app[name]))]


@pytest.mark.parametrize("command", every_command())
def test_every_command_has_an_example_in_its_help(command, capsys):
    assert typed(f"{command} --help") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert all(example in said for example in EXAMPLES[command])


@pytest.mark.parametrize("example", [line for name in every_command() for line in EXAMPLES[name]])
def test_examples_are_calls_of_the_command_and_their_files_exist(example):
    words = example.split()[1:]
    bound = cli.app.parse_args(words, exit_on_error=False, print_error=False)
    assert callable(bound[0])
    for word in words:
        if word.startswith(("scenes/", "examples/")):
            assert (ROOT / word.partition(":")[0]).is_file()


def test_alone_it_shows_every_command(capsys):
    assert typed("") == 0
    said = capsys.readouterr().out
    assert all(EXAMPLES[name][0] in said for name in commands(cli.app))
    assert "ephs new my-pendulum" in said


def test_a_run_says_what_to_look_at_next(here, capsys):
    made("spinning-body")
    assert typed("run my-spinning-body.toml --until 0.1") == 0
    said = capsys.readouterr().out
    for word in ("next:", "out/my-spinning-body/report.html", 'ephs.load_solution("out/my-spinning-body/solution.nc")'):
        assert word in said


@pytest.mark.parametrize("step", [None, 1e-3], ids=["chosen steps", "constant steps"])
def test_progress_tells_steps_and_the_energy_error_so_far(step):
    scene = shipped("slider-crank")
    seen = []
    options = {"method": "natural", "step": step} if step else {"method": "rk87", "rtol": 1e-8}
    sol = ephs.simulate(scene, 60.0 if step is None else 4.0, progress=lambda *now: seen.append(now), **options)
    assert seen
    worst = max(stats["energy_error"] for _, _, stats in seen)
    assert 0.0 < worst <= 10.0 * sol.energy_error.max()
    t, until, stats = seen[-1]
    words = said_of(t, until, stats, 0.5)
    assert f"{stats['steps']} steps, {stats['steps'] / 0.5:.3g}/s, energy error " in words


def test_completion_is_written_for_a_shell(here, capsys):
    assert typed("--install-completion --shell bash --output completion.sh") == 0
    script = Path("completion.sh").read_text()
    assert all(name in script for name in ("sweep", "--until", "equations"))


@pytest.mark.parametrize("words", ["", "--help", "new --help", "rnu", "sweep --help"])
def test_what_is_said_first_loads_nothing_heavy(words):
    script = (
        f"import sys; from ephs.cli import main; main({words.split()!r}); "
        "heavy = ('numpy', 'llvmlite', 'scipy', 'sympy', 'pydantic', 'ephs.mechanics'); "
        "print('has', *[name for name in heavy if name in sys.modules])"
    )
    assert printed(script).splitlines()[-1] == "has"


def test_a_name_that_is_no_model_is_answered_with_the_models_of_the_file(capsys):
    assert typed(f"check {ROOT}/examples/oscillator.py:damped") == 2
    assert "damped is a Pattern" in (said := capsys.readouterr().err) and "free_oscillator, damped_oscillator" in said


def oscillator():
    return ephs.Pattern.from_text("q: displacement; p: momentum, exposed; spring(q); mass(p); pkc(q, p)")


def filled():
    return oscillator()(spring=lib.spring(k=1.0), mass=lib.point_mass(m=1.0), pkc=lib.pkc())


SLIPS = {
    "a pattern is run": (
        lambda: ephs.simulate(oscillator(), 1.0),
        "found a pattern, expected a system .* fill its boxes",
    ),
    "a state as reference": (lambda: filled().check({"spring.q": 1.0}), "expected a Reference .* state="),
    "a number as text": (lambda: lib.spring(k="1.5"), r"parameter k is '1\.5', expected a number > 0"),
    "no number": (lambda: lib.friction(d=None), "parameter d is None, expected a number"),
    "an input without return": (
        lambda: ephs.simulate(filled(), 1.0, inputs={"p": {"flow": lambda t: None}}),
        "it returns None, perhaps for want of a return",
    ),
    "two ways at once": (lambda: lib.thermal_capacity(c1=1.0, capacity=2.0), "expected c1 and c2, or capacity and"),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_slips_are_told_by_what_was_meant(slip):
    make, said = SLIPS[slip]
    with pytest.raises((ephs.SemanticsError, ephs.SimulationError, AttributeError), match=said):
        make()


@pytest.mark.parametrize(("seconds", "most"), [(4.0, 0), (60.0, 8), (3600.0, 18), (86400.0, 26)])
def test_progress_without_a_terminal_is_some_lines(seconds, most):
    """One after 5 s, and each further one after half as long again: 1 + log(T / 5) / log 1.5 of them."""
    now, lines = [0.0], []
    line = seldom(lines.append, lambda: now[0])
    for k in range(20_001):
        now[0] = seconds * (k / 20_000) ** 3
        line(lambda spent: f"{spent:.1f} s")
    assert most - 2 <= len(lines) <= most
    assert not lines or re.fullmatch(r"5\.0 s, after 5 s", lines[0])


def test_a_run_without_a_terminal_tells_its_progress_on_stderr(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("ephs.cli.progress.FIRST", 0.0)
    words = f"run scenes/heavy-top.toml --until 0.02 --no-report --out {tmp_path / 'top'}"
    assert typed(words) == 0
    said = capsys.readouterr()
    assert re.search(r"^heavy-top: t = \S+ of 0.02 s, .* after \d+ s$", said.err, re.MULTILINE)
    assert "t = " not in said.out
