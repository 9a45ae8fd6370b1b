"""Object code that comes with the package: taken where it is whole and fits, and never where it does not."""

import ast
import json
import struct
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ephs.semantics.stage import llvm, objects, shipping
from ephs.semantics.stage.objects import FITTING, TARGETS, compiled, fitting
from ephs.semantics.stage.shipping import INDEX, ship, shipped
from ephs.semantics.stage.store import STORE
from ephs.shipped import SHIPPED, programs, write_objects
from tests.processes import printed
from tests.rooms import SOURCES, module_name
from tests.semantics.stage.arm import SYMBOLS, sections
from tests.semantics.stage.test_objects import SMALL, value

pytestmark = pytest.mark.optimised

PROGRAMS = {program.name: program for program in programs()}
LIBRARY = {"memset", "memcpy", "memmove"}
V2 = llvm.Target(
    "x86_64-unknown-linux-gnu", "any", ",".join(f"+{one}" for one in FITTING["linux-x86-64-v2"][1].split())
)
V3 = replace(V2, features=",".join([V2.features, *(f"+{one}" for one in FITTING["linux-x86-64-v3"][1].split())]))
ARM = llvm.Target("aarch64-unknown-linux-gnu", "any", "+neon")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What a wheel brings."""
    made = tmp_path_factory.mktemp("objects")
    write_objects(made)
    return made


def unconditional() -> set[str]:
    """The functions of the package that return one program, whoever asks."""
    found: set[str] = set()
    for file in SOURCES:
        text = file.read_text(encoding="utf-8")
        for node in ast.parse(text).body if "-> Program" in text else ():
            if isinstance(node, ast.FunctionDef) and not ast.unparse(node.args) and node.returns is not None:
                found |= {f"{module_name(file)}:{node.name}"} if ast.unparse(node.returns) == "Program" else set()
    return found


def test_what_all_users_compile_alike_is_shipped():
    assert unconditional() <= set(SHIPPED)


def test_programs_have_names_of_their_own():
    assert len(PROGRAMS) == len(programs()) > 1


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize("target", FITTING)
def test_each_program_is_there_for_each_target(folder, name, target):
    code = shipped(PROGRAMS[name].text(), [target], folder)
    assert code == (folder / target / f"{name}.o").read_bytes()
    assert (folder / f"{name}.h").read_text() == PROGRAMS[name].header()


@pytest.mark.parametrize("name", PROGRAMS)
def test_what_is_compiled_again_is_the_same(folder, name):
    """For one target: all are emitted by the same compiler from the same text."""
    target = next(iter(FITTING))
    assert shipped(PROGRAMS[name].text(), [target], folder) == objects.emitted(PROGRAMS[name].text(), target)


def test_another_process_has_the_same_texts():
    """The index finds a program in any process: its text holds no order of sets and no place in memory."""
    code = (
        "from ephs.shipped import programs; from ephs.semantics.stage.shipping import _digest;"
        "print({program.name: _digest(program.text().encode()) for program in programs()})"
    )
    digests = {name: shipping._digest(program.text().encode()) for name, program in PROGRAMS.items()}
    assert ast.literal_eval(printed(code, PYTHONHASHSEED="271")) == digests


MOTIONS = """
import sys
from pathlib import Path
import ephs
from ephs.semantics.stage import objects, shipping
folder, targets, taken = Path('{folder}'), {targets!r}, set()
names = {{digest: next(iter(files.values()))[0] for digest, files in shipping._index(folder).items()}}
def given(text, _):
    code = shipping.shipped(text, targets, folder)
    if code is not None:
        taken.add(Path(names[shipping._digest(text.encode())]).stem)
    return code
objects.shipped = given
bits = []
for scene, method, options in (
    ("slider-crank", "rk87", {{}}), ("chain", "rk87", {{}}), ("chain", "radau", {{}}),
    ("four-bar", "natural", {{"step": 0.01}}),
):
    motion = ephs.simulate(ephs.load(f"scenes/{{scene}}.toml"), 0.05, method=method, audit="off", **options)
    bits.append(motion.t.tobytes().hex() + motion.energy.tobytes().hex())
print([sorted(taken), bits])
"""
TAKEN = {"motion_of_loops", "motion_of_trees", "stiff_steps_of_trees", "natural"}


def test_motions_have_the_same_bits_by_what_is_shipped_and_by_what_is_compiled(folder):
    """Of programs that call others by address, too, which the emulator of arm64 does not run."""
    targets = [[], *([target] for target in fitting(llvm.host()))]
    found = [ast.literal_eval(printed(MOTIONS.format(folder=folder, targets=t))) for t in targets]
    assert not found[0][0] and all(set(taken) >= TAKEN for taken, _ in found[1:])
    assert all(bits == found[0][1] for _, bits in found)


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize("target", FITTING)
def test_object_code_needs_nothing_but_memory_functions_of_c(folder, name, target):
    parts = sections((folder / target / f"{name}.o").read_bytes())
    (table,) = (part for part in parts if part.kind == SYMBOLS)
    names = parts[table.link].content
    entries = list(struct.iter_unpack("<IBBHQQ", table.content))
    text = {at: names[at : names.index(0, at)].decode() for at, *_ in entries}
    assert {text[at] for at, _, _, section, *_ in entries if at and section == 0} <= LIBRARY
    public = {text[at] for at, info, _, section, *_ in entries if section and info >> 4 == 1}
    assert public == {f"{name}_{entry}{form}" for entry in PROGRAMS[name].entries for form in ("", "_packed")}


@pytest.mark.parametrize(
    ("machine", "found"),
    [
        (V3, ["linux-x86-64-v3", "linux-x86-64-v2"]),
        (V2, ["linux-x86-64-v2"]),
        (replace(V3, features=V3.features.replace("+fma", "-fma")), ["linux-x86-64-v2"]),
        (replace(V2, features=V2.features.replace("+popcnt", "")), []),
        (ARM, ["linux-arm64"]),
        (replace(V3, triple="x86_64-apple-macosx14.0.0"), []),
        (replace(V3, triple="x86_64-pc-windows-msvc"), []),
    ],
)
def test_a_machine_is_given_what_it_can_run(machine, found):
    assert fitting(machine) == found
    assert set(FITTING) < set(TARGETS)


@pytest.fixture
def delivered(tmp_path, monkeypatch):
    """The small program in a package, and the modules that are compiled all the same."""
    text = SMALL.text()
    names = fitting(llvm.host()) or ["here"]
    monkeypatch.setattr(objects, "fitting", lambda machine: names)
    ship({"small": (text, {name: llvm.compile_text(text) for name in names})}, {}, tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(STORE, "usable", True)
    taken: list[str] = []

    def counted(text, *rest):
        taken.append(text)
        return llvm.compile_text(text, *rest)

    monkeypatch.setattr(objects, "compile_text", counted)
    monkeypatch.setattr(objects, "shipped", lambda text, targets: shipped(text, targets, tmp_path))
    return tmp_path, taken


def test_what_comes_with_the_package_is_not_compiled(delivered):
    folder, taken = delivered
    assert value(compiled(SMALL.text())) == 2.0
    assert not taken and not (folder / "cache").exists()


def test_a_program_that_has_changed_is_compiled(delivered):
    _, taken = delivered
    assert value(compiled(SMALL.text() + "\n")) == 2.0
    assert len(taken) == 1


@given(data=st.data())
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_spoilt_is_compiled(delivered, data):
    """No byte of the files can change without notice; names of the index that point nowhere count as absent."""
    folder, _ = delivered
    files = [folder / INDEX, *folder.glob("*/small.o")]
    kept = {file: file.read_bytes() for file in files}
    file = data.draw(st.sampled_from(files))
    spoilt = bytearray(kept[file])
    if data.draw(st.booleans()):
        spoilt[data.draw(st.integers(0, len(spoilt) - 1))] ^= data.draw(st.integers(1, 255))
    else:
        del spoilt[data.draw(st.integers(0, len(spoilt) - 1)) :]
    file.write_bytes(spoilt)
    shipping._index.cache_clear()
    try:
        found = shipped(SMALL.text(), fitting(llvm.host()), folder)
        assert found is None or found in [kept[file] for file in files[1:]]
        assert value(compiled(SMALL.text())) == 2.0
    finally:
        for one, content in kept.items():
            one.write_bytes(content)
        shipping._index.cache_clear()


@pytest.mark.parametrize("index", ["[]", "{", "3", '{"a": 1}', "\xff", None])
def test_an_index_of_any_kind_does_no_harm(tmp_path, index):
    shipping._index.cache_clear()
    if index is not None:
        (tmp_path / INDEX).write_text(index, encoding="latin-1")
    assert shipped(SMALL.text(), FITTING, tmp_path) is None


@pytest.mark.parametrize(
    "files", [{"t": 1}, {"t": ["x"]}, {"t": [1, "x"]}, [], {"t": ["absent.o", "x"]}, {"t": ["\0", "x"]}]
)
def test_an_entry_of_any_kind_does_no_harm(tmp_path, files):
    shipping._index.cache_clear()
    (tmp_path / INDEX).write_text(json.dumps({shipping._digest(SMALL.text().encode()): files}))
    assert shipped(SMALL.text(), ["t"], tmp_path) is None


def test_the_folder_lies_in_the_package():
    assert Path(shipping.__file__).is_relative_to(shipping.FOLDER.parent)
