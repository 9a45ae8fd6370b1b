"""Untrusted files are data: reading them opens nothing outside their folder, starts nothing, runs nothing."""

import json
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

import ephs
from ephs.mechanics.imports import convert
from ephs.mechanics.scene.document import scene_from_text, scene_to_text
from tests.fuzz.seeds import LEG, MESH, MJCF, PENDULUM, SDF, URDF
from tests.scenes import ROOT

NAMES = (
    '"><script>alert(1)</script><img/src=x/onerror=alert(1)>',
    "a/b",
    r"]]>--><b>%s{0}&amp;'\input{x}^^M\write18{ls}$\foo$",
)
"""Names that a scene may have, and that pages, formulas or figures might obey."""


def scene_text(names=NAMES):
    text = 'format = 1\nname = "<script>alert(2)<script>"\n'
    for k, name in enumerate(names):
        body, joint, node = (json.dumps(letter + name) for letter in ("", "j", "t"))
        text += (
            f"[bodies.{body}]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\nshape = {{ sphere = 0.1 }}\n"
            f'[joints.{joint}]\ntype = "revolute"\nbodies = ["ground", {body}]\nat = [0.0, {k}.0, 0.0]\n'
            f"axis = [0.0, 1.0, 0.0]\nrate = 0.5\nfriction = 0.1\nheat = {node}\n"
            f"[thermal.{node}]\ncapacity = 1.0\ntemperature = 300.0\n"
        )
    return text


@pytest.fixture(scope="module")
def solution(tmp_path_factory):
    path = tmp_path_factory.mktemp("names") / "scene.toml"
    path.write_text(scene_text())
    return ephs.simulate(ephs.load(path), 0.02, step=0.01)


# ---- nothing but the folder --------------------------------------------------------------------------------------

WATCHED = """
import json, sys, warnings
import ephs
from pathlib import Path
from ephs.mechanics.imports import convert
from ephs.mechanics.scene.load import load

def read(path):
    try:
        with warnings.catch_warnings(record=True):
            warnings.simplefilter("always")
            if path.name.startswith("system"):
                ephs.System.from_json(path.read_bytes())
            elif path.suffix == ".json":
                ephs.Pattern.from_json(path.read_bytes())
            elif path.suffix == ".text":
                ephs.Pattern.from_text(path.read_text())
            elif path.suffix == ".nc":
                ephs.load_solution(path)
            else:
                load(path)
                if path.suffix != ".toml":
                    convert(path, path.with_name("converted.toml"))
        return "model"
    except ephs.PatternError:
        return "error"
    except ValueError as error:
        return type(error).__name__

good, bad = (sorted(path for path in Path(folder).iterdir() if path.is_file()) for folder in sys.argv[1:])
for path in good:  # imports, and what is compiled once
    read(path)
seen = []
def hook(event, args):
    if event == "open":
        seen.append((event, str(args[0])))
    elif event.partition(".")[0] in ("compile", "exec", "subprocess", "socket", "os", "ctypes", "shutil", "urllib"):
        if event not in ("os.listdir", "os.scandir", "os.putenv"):
            seen.append((event, str(args)[:200]))
sys.addaudithook(hook)
found = {path.name: read(path) for path in bad}
print(json.dumps([found, seen]))
"""


def write_all(folder, scenes):
    folder.mkdir()
    for name, content in scenes.items():
        path = folder / name
        path.write_bytes(content) if isinstance(content, bytes) else path.write_text(content)


def hostile(secret: Path) -> dict[str, str]:
    """Files that ask for others, or for code to be run."""
    away = str(secret)
    code = "__import__('os').system('touch ran')"
    body = '<body name="a"><freejoint/><geom size="1"/>{}</body>'
    return {
        "use.toml": f'format = 1\n[parts.p]\nuse = "{away}/leg.toml"\n',
        "up.toml": 'format = 1\n[parts.p]\nuse = "../secret/leg.toml"\n',
        "linked.toml": 'format = 1\n[parts.p]\nuse = "link.toml"\n',
        "device.toml": 'format = 1\n[parts.p]\nuse = "/dev/zero"\n',
        "mesh.toml": f"format = 1\n{PENDULUM}[bodies.b]\nmass = 1.0\ninertia = [1.0, 1.0, 1.0]\n"
        f'shape = {{ mesh = "{away}/mesh.stl" }}\n',
        "code.toml": f'format = 1\nname = "{code}"\n[bodies."{code.replace(".", "_").replace(" ", "-")}"]\nmass = 1.0\n'
        "inertia = [1.0, 1.0, 1.0]\n",
        "number.toml": f'format = 1\n[bodies.a]\nmass = "{code}"\ninertia = [1.0, 1.0, 1.0]\n',
        "mesh.urdf": URDF.replace("package://p/mesh.stl", f"file://{away}/mesh.stl"),
        "up.urdf": URDF.replace("package://p/mesh.stl", "package://p/../secret/mesh.stl"),
        "address.urdf": URDF.replace("package://p/mesh.stl", "http://localhost:9/mesh.stl"),
        "entity.urdf": f'<!DOCTYPE r [<!ENTITY e SYSTEM "file://{away}/leg.toml">]><robot name="&e;"/>',
        "include.xml": f'<mujoco><include file="{away}/model.xml"/></mujoco>',
        "up.xml": '<mujoco><include file="../secret/model.xml"/></mujoco>',
        "mesh.xml": f'<mujoco><compiler meshdir="{away}"/><asset><mesh name="m" file="mesh.stl"/></asset><worldbody>'
        + body.format('<geom type="mesh" mesh="m"/>')
        + "</worldbody></mujoco>",
        "model.xml": f'<mujoco><asset><model name="m" file="{away}/model.xml"/></asset><worldbody>'
        + body.format("")
        + "</worldbody></mujoco>",
        "plugin.xml": f'<mujoco><extension><plugin plugin="{away}/lib.so"/></extension><worldbody>'
        + body.format('<plugin plugin="x"/>')
        + "</worldbody></mujoco>",
        "uri.sdf": SDF.replace("</model>", f"<include><uri>file://{away}/model.sdf</uri></include></model>"),
        "plugin.sdf": SDF.replace("</model>", f'<plugin name="p" filename="{away}/lib.so"/></model>'),
        "code.json": json.dumps({"format": 1, "junctions": {}, "boxes": {}, "links": [[code]]}),
        "system-code.json": json.dumps({"format": 1, "parts": [{"part": code, "ports": [], "parameters": {}}]}),
        "system-term.json": json.dumps(
            {"format": 1, "parts": [{"storage": code, "ports": [["q", {"quantity": "charge"}]], "energy": [code, "q"]}]}
        ),
        "code.text": f'q: {{"kind": "{code}", "space": {{"name": "R", "dim": 1, "size": 1}}, "parity": 1}}; a(q)',
    }


REFUSED = ("use.toml", "up.toml", "linked.toml", "device.toml", "include.xml", "model.xml")


def test_hostile_files_reach_nothing(tmp_path, solution):
    good = {
        "a.toml": f"format = 1\n{PENDULUM}",
        "bad.toml": "format = 2\n",
        "a.urdf": URDF,
        "a.sdf": SDF,
        "a.xml": MJCF,
    }
    good["system.json"] = ephs.mechanics.rigid_body(1.0, [1.0, 1.0, 1.0]).to_json()
    good |= {"bad.urdf": "<robot/>", "a.json": "{}", "a.text": "q: angle; a(q)", "mesh.stl": MESH}
    write_all(tmp_path / "good", good)
    write_all(tmp_path / "secret", {"leg.toml": LEG, "mesh.stl": MESH, "model.xml": MJCF, "lib.so": b"no library"})
    write_all(tmp_path / "bad", hostile(tmp_path / "secret"))
    (tmp_path / "bad" / "link.toml").symlink_to(tmp_path / "secret" / "leg.toml")
    solution.save(tmp_path / "good" / "a.nc")
    moved = '{"mesh": "' + str(tmp_path / "secret" / "mesh.stl") + '"}'
    changed(
        tmp_path / "good" / "a.nc", tmp_path / "bad" / "mesh.nc", lambda text: text.replace('{"sphere": 0.1}', moved)
    )
    run = subprocess.run(
        [sys.executable, "-c", WATCHED, str(tmp_path / "good"), str(tmp_path / "bad")],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    )
    found, seen = json.loads(run.stdout.splitlines()[-1])
    read = {name for name, outcome in found.items() if outcome == "model"}
    assert {found[name] for name in ("system-code.json", "system-term.json")} == {"error"}
    assert {"mesh.urdf", "mesh.xml", "plugin.sdf", "code.toml", "mesh.nc"} <= read
    assert {found[name] for name in REFUSED} == {"SceneError"}
    outside = [each for each in seen if each[0] != "open" or not each[1].startswith(str(tmp_path / "bad"))]
    outside = [each for each in outside if not _finds_libraries(*each)]
    assert not [each for each in outside if not each[1].startswith(sys.prefix) or each[0] != "open"], outside
    assert not (tmp_path / "secret" / "ran").exists() and not Path("ran").exists()


def _finds_libraries(event: str, what: str) -> bool:
    """Whether this is how threads of linear algebra are limited: by a look at the libraries that are loaded."""
    return event == "open" and what == "/proc/self/maps"


def changed(source: Path, target: Path, change) -> None:
    """A solution's file, its scene's text changed."""
    target.write_bytes(source.read_bytes())
    with h5py.File(target, "r+") as file:
        file.attrs["model"] = change(file.attrs["model"])


def test_copies_of_meshes_follow_no_links(tmp_path):
    model = tmp_path / "robot" / "model.urdf"
    write_all(tmp_path / "robot", {"model.urdf": URDF, "mesh.stl": MESH})
    target = tmp_path / "robot" / "scenes" / "arm.toml"
    (tmp_path / "precious").mkdir()
    target.parent.mkdir()
    (target.parent / "arm-meshes").symlink_to(tmp_path / "precious")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ephs.ModelWarning)
        with pytest.raises(ephs.SceneError, match="not a link"):
            convert(model, target)
        assert not list((tmp_path / "precious").iterdir())
        (target.parent / "arm-meshes").unlink()
        convert(model, target)
    assert (target.parent / "arm-meshes" / "mesh.stl").read_bytes() == MESH


# ---- result files ------------------------------------------------------------------------------------------------


def external(file):
    file["more"] = h5py.ExternalLink("other.h5", "/x")


def soft(file):
    file["more"] = h5py.SoftLink("/t")


def virtual(file):
    layout = h5py.VirtualLayout(shape=(3,), dtype="f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", shape=(3,))
    file.create_virtual_dataset("more", layout)


def elsewhere(file):
    file.create_dataset("more", (4,), "f8", external=[("/etc/passwd", 0, 32)])


def bomb(file):
    file.create_dataset("more", (10**12,), "f8", chunks=(10**6,), fillvalue=0.0)


def deflated(file):
    file.create_dataset("more", data=np.zeros(10**7), compression="gzip", compression_opts=9)


def references(file):
    file.create_dataset("more", (1,), h5py.ref_dtype)[0] = file["t"].ref


def grouped(file):
    file.create_group("more")


def lossy(file):
    file.create_dataset("more", (10,), "f8", scaleoffset=3)


@pytest.mark.parametrize(
    "attack", [external, soft, virtual, elsewhere, bomb, deflated, references, grouped, lossy], ids=lambda f: f.__name__
)
def test_result_files_hold_plain_arrays_of_their_own(attack, solution, tmp_path):
    path = tmp_path / "solution.nc"
    solution.save(path)
    with h5py.File(path, "r+") as file:
        attack(file)
    with pytest.raises(ValueError, match="not a solution"):
        ephs.load_solution(path)


@pytest.mark.parametrize(
    "old, new",
    [
        ('"shape": [7]', '"shape": [1]'),
        ('"kind": "revolute"', '"kind": "pickle"'),
        ('"body1": "ground"', '"body1": "nobody"'),
        ('"mass": 1.0', '"mass": "1.0"'),
        ('"mass": 1.0', '"mass": NaN'),
        ('"pitch": 0.0', '"pitch": 1e999'),
        ('"bodies": {', '"bodies": [], "x": {'),
        ('"heat": "t', '"heat": "u'),
        ("{", "["),
        ("{", "[" * 100_000),
        ('"name": "a/b"', '"name": "ab"'),
    ],
)
def test_changed_scenes_in_result_files_are_refused(old, new, solution, tmp_path):
    solution.save(tmp_path / "whole.nc")
    path = tmp_path / "solution.nc"
    changed(tmp_path / "whole.nc", path, lambda text: text.replace(old, new))
    with pytest.raises(ValueError, match=r"solution\.nc: not a solution"):
        ephs.load_solution(path)


@pytest.mark.parametrize("content", [b"", b"\x89HDF\r\n\x1a\n" + bytes(100), b"{}"])
def test_what_is_no_result_file_is_refused(content, tmp_path):
    path = tmp_path / "solution.nc"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"solution\.nc: not a netCDF file"):
        ephs.load_solution(path)
    with pytest.raises(ValueError, match="not a file"):
        ephs.load_solution(tmp_path)


def test_truncated_and_altered_result_files_are_refused_or_read(solution, tmp_path):
    solution.save(tmp_path / "whole.nc")
    whole = (tmp_path / "whole.nc").read_bytes()
    path = tmp_path / "solution.nc"
    random = np.random.default_rng(0)
    for _ in range(60):
        data = bytearray(whole[: random.integers(1, len(whole)) if random.random() < 0.3 else len(whole)])
        for at in random.integers(0, len(data), 20):
            data[at] = random.integers(0, 256)
        path.write_bytes(data)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                ephs.load_solution(path)
            except ValueError as error:
                assert str(error).startswith(f"{path}: ")


def test_names_with_slashes_come_back_from_files(solution, tmp_path):
    solution.save(tmp_path / "solution.nc")
    again = ephs.load_solution(tmp_path / "solution.nc")
    assert set(again.states) == set(solution.states)
    assert np.array_equal(again.body("a/b").position, solution.body("a/b").position)


def test_documents_of_sound_scenes_pass(solution):
    from ephs.mechanics.scene.soundness import check_scene

    check_scene(scene_from_text(scene_to_text(solution.scene)))


# ---- what is written ---------------------------------------------------------------------------------------------


def test_pages_obey_no_name(solution, tmp_path):
    from ephs.show.report import write_report

    pages = [write_report(solution, tmp_path).read_text(encoding="utf-8"), solution.animate().html]
    pages += [solution._repr_html_(), solution.scene._repr_html_(), ephs.show.draw(solution.scene.system()).svg]
    for page in pages:
        for words in ("<script>alert", "<img/src", "<b>", "--><"):
            assert words not in page.replace("<b style", "")


def test_formulas_obey_no_name(solution):
    system = solution.scene.system()
    for text in (system.equations().latex(), ephs.show.draw(system).tikz):
        obeyed = [re.split(r"(?<!\\)%", line)[0] for line in text.splitlines()]  # the rest is a comment
        assert not any(rf"\{word}" in line for word in ("input", "write", "foo") for line in obeyed)


@pytest.mark.parametrize("name", ["../../up", "/etc", "..", "a\\b", "a\u202eb", "x" * 201])
def test_results_of_a_scene_stay_in_the_folder(name, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(f"format = 1\nname = {json.dumps(name)}\n{PENDULUM}")
    with pytest.raises(ephs.SceneError, match="a valid name of a folder"):
        ephs.load(path)


def test_messages_steer_no_terminal(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(f'format = 1\n{PENDULUM}[bodies."\\u001b[2J"]\nmass = "\\u009b2J"\n')
    with pytest.raises(ephs.SceneError) as caught:
        ephs.load(path)
    assert all(line.isprintable() for line in str(caught.value).splitlines())
    model = tmp_path / "model.urdf"
    model.write_text(URDF.replace('name="j"', 'name="&#x9b;2J"').replace('<mimic joint="j"/>', ""))
    with pytest.warns(ephs.ModelWarning) as told:
        ephs.load(model)
    assert all(line.isprintable() for each in told for line in str(each.message).splitlines())


def test_progress_obeys_no_name(monkeypatch):
    from ephs.cli.charts import _status
    from ephs.cli.progress import progress_bar

    monkeypatch.setenv("FORCE_COLOR", "1")  # as on a terminal
    with _status("[/b][link=x]") as note:
        note("[/i]")
    with progress_bar("[/b]") as progress:
        progress(1.0, 2.0, {"steps": 1, "rejected": 0})


# ---- what grows --------------------------------------------------------------------------------------------------


def test_few_files_do_not_stand_for_many(tmp_path):
    for k in range(30):
        uses = "".join(f'[parts.{name}]\nuse = "{k + 1}.toml"\n' for name in "ab")
        (tmp_path / f"{k}.toml").write_text(f"format = 1\n{uses}")
    (tmp_path / "30.toml").write_text("format = 1\n")
    with pytest.raises(ephs.SceneError, match="at most 2000 uses of parts"):
        ephs.load(tmp_path / "0.toml")


@pytest.mark.parametrize(
    "name, text, words",
    [
        ("a.toml", "format = 1\n" + "a." * 60_000 + "a = 1\n", "at most 50 names"),
        ("a.toml", "format = 1\n" + '"a".' * 60_000 + "a = 1\n", "at most 50 names"),
        ("a.toml", "format = " + "[" * 200_000, "nested too deeply"),
        ("a.toml", "x" * 200_000 + " = 1", "unknown key"),
        ("a.toml", "# " + "x" * 11_000_000, "11 MB, expected at most 10 MB"),
        (
            "a.xml",
            '<mujoco><worldbody><replicate count="1000000000"><geom size="1"/></replicate></worldbody></mujoco>',
            "copies included",
        ),
        ("a.xml", '<mujoco><asset><mesh name="m" builtin="plate" params="1e6 1e6"/></asset></mujoco>', "at most 100"),
        (
            "a.sdf",
            SDF.replace(
                "</model>",
                "".join(f'<frame name="f{k}"><pose relative_to="f{k + 1}"/></frame>' for k in range(2000))
                + '<frame name="f2000"/><link name="z"><pose relative_to="f0"/></link></model>',
            ),
            "at most 200 levels",
        ),
    ],
    ids=["dots", "quoted", "lists", "name", "size", "copies", "formula", "frames"],
)
def test_small_files_ask_for_little(name, text, words, tmp_path):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(ephs.SceneError, match=words):
        ephs.load(path)


def test_pipes_and_folders_are_not_read(tmp_path):

    os.mkfifo(tmp_path / "pipe.toml")
    os.mkfifo(tmp_path / "pipe.urdf")
    for name in ("pipe.toml", "pipe.urdf"):
        with pytest.raises(ephs.SceneError, match="a pipe or a device"):
            ephs.load(tmp_path / name)


# ---- servers -----------------------------------------------------------------------------------------------------


def test_the_helper_of_pages_listens_on_this_machine_only(solution, monkeypatch):
    import viser

    hosts: list[str] = []
    made = viser.ViserServer.__init__

    def init(self, host="0.0.0.0", *rest, **more):
        hosts.append(host)
        made(self, host, *rest, **more)

    monkeypatch.setattr(viser.ViserServer, "__init__", init)
    solution.animate()
    assert hosts == ["127.0.0.1"]
