"""What is built, tested as it is installed: ``python -m tests.release objects|wheel|matrix|smoke [for pytest]``.

``objects``: object code of the shipped programs, into the tree, from where a build takes it.
``wheel``: the wheel and the sdist in dist/; what they hold, and the sdist's tests against the installed wheel.
``matrix``: the same tests under each of `VERSIONS` that is found here, oldest and newest dependencies.
``smoke``: commands of the wheel under each of these but the running one, with no extras and nothing compiled.

It needs no more than the standard library, ``build`` and ``uv`` (``objects``: the package), and says what it could not
find.
"""

import argparse
import csv
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
VERSIONS = {
    "3.11-oldest": "lowest-direct",
    "3.11-newest": "highest",
    "3.12-newest": "highest",
    "3.13-newest": "highest",
}
"""Python and its dependencies, and how uv resolves these."""
DATA = (
    "ephs/py.typed",
    "ephs/operad/pattern.schema.json",
    "ephs/semantics/system.schema.json",
    "ephs/mechanics/references.bib",
    *(f"ephs/show/assets/{file.name}" for file in sorted((ROOT / "ephs/show/assets").iterdir())),
    *(f"ephs/templates/{file.name}" for file in sorted((ROOT / "ephs/templates").iterdir()) if file.is_file()),
)
OBJECTS = ROOT / "ephs" / "objects"
PATIENCE_S = 300.0
SMOKE = (
    ("--version",),
    ("new", "first"),
    ("draw", "first.toml", "-o", "first.svg"),
    ("equations", "first.toml"),
)


def uv(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run uv, which finds interpreters and resolves versions; 124 where a registry does not answer for long."""
    command = [sys.executable, "-m", "uv", *map(str, arguments)]
    trusting = {
        "UV_SYSTEM_CERTS": "1",
        "UV_NATIVE_TLS": "1",
    } | os.environ  # whom pip trusts; by its new and its old name
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, env=trusting)
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 124, "", f"uv took more than {PATIENCE_S:g} s")


def interpreter(version: str) -> str:
    """The path of a Python, empty where there is none: pyenv's, whose stand-ins on the path answer for one; uv's."""
    pyenv = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv")
    if inside := sorted(pyenv.glob(f"versions/{version}.*/bin/python{version}")):
        return str(inside[-1])
    found = uv("python", "find", "--no-python-downloads", "--system", version)
    return found.stdout.strip() if found.returncode == 0 else ""


def environment(python: str, folder: Path, wheel: Path, extra: str, resolution: str = "highest") -> str:
    """Install the wheel into a new environment; its Python, or empty where that cannot be had.

    The oldest of what the wheel needs is taken only where it is named beside it: hence the requirements.
    """
    made = uv("venv", "--quiet", "--python", python, folder)
    inside = str(folder / "bin" / "python")
    needs = [wheel, "-r", ROOT / "pyproject.toml", *(["--extra", extra] if extra else [])]
    if made.returncode == 0:
        made = uv("pip", "install", "--quiet", "--python", inside, "--resolution", resolution, *needs)
    if made.returncode:
        print(made.stderr, file=sys.stderr)
    return "" if made.returncode else inside


def built(folder: Path) -> tuple[Path, Path]:
    """The wheel and the sdist, built into a folder unless they are there."""
    if not list(folder.glob("*.whl")):
        command = [sys.executable, "-m", "build", "--outdir", str(folder), str(ROOT)]
        subprocess.run(command, check=True, capture_output=True)
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, sdist


def faults_of(wheel: Path) -> list[str]:
    """What is missing in a wheel, or has no place there."""
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        listed = {row[0] for name in names if name.endswith("/RECORD") for row in _rows(archive.read(name).decode())}
    sources = {file.relative_to(ROOT).as_posix() for file in (ROOT / "ephs").rglob("*.py")}
    code = {file.relative_to(ROOT).as_posix() for file in OBJECTS.rglob("*") if file.is_file()}
    missing = [f"{name} is missing" for name in sorted({*sources, *DATA, *code} - names)]
    missing += ["object code is missing: run the job objects before the build"] * (not code)
    missing += [f"{name} is not in RECORD" for name in sorted(names - listed) if not name.endswith("/RECORD")]
    foreign = [f"{n} has no place there" for n in sorted(names) if not n.startswith("ephs/") and ".dist-info/" not in n]
    licensed = any(name.endswith("licenses/LICENSE") for name in names)
    return [*missing, *foreign, *([] if licensed else ["the licence is missing"])]


def _rows(text: str) -> list[list[str]]:
    return list(csv.reader(text.splitlines()))


def objects_job() -> int:
    """The job ``objects``."""
    from ephs.shipped import write_objects

    shutil.rmtree(OBJECTS, ignore_errors=True)
    write_objects(OBJECTS)
    files = [file for file in OBJECTS.rglob("*") if file.is_file()]
    print(f"ephs/objects: {len(files)} files, {sum(file.stat().st_size for file in files) / 1000:.0f} kB")
    return 0


def tested(python: str, sdist: Path, folder: Path, tests: Sequence[str]) -> int:
    """Run an sdist's tests against the package that is installed; the exit code."""
    with tarfile.open(sdist) as archive:
        archive.extractall(folder, filter="data")
    (tree,) = folder.iterdir()
    say = "import sysconfig; print(sysconfig.get_path('purelib'))"
    site = Path(subprocess.check_output([python, "-c", say], text=True).strip())
    (site / "tests-of-the-sdist.pth").write_text(f"{tree}\n")  # after what is installed, so that that is found first
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    ask = [python, "-c", "import ephs; print(ephs.__file__)"]
    origin = subprocess.check_output(ask, text=True, cwd=folder, env=clean).strip()
    if not Path(origin).is_relative_to(site):
        print(f"ephs comes from {origin}, not from the environment", file=sys.stderr)
        return 1
    pytest = [str(Path(python).with_name("pytest")), "-q", "-o", "pythonpath=", *tests]
    return subprocess.run(pytest, cwd=tree, env=clean).returncode


def wheel_job(tests: Sequence[str]) -> int:
    """The job ``wheel``."""
    with TemporaryDirectory() as scratch:
        wheel, sdist = built(ROOT / "dist")
        faults = faults_of(wheel)
        for file in (wheel, sdist):
            print(f"{file.name}: {file.stat().st_size / 1000:.0f} kB")
        print("\n".join(faults) or "the wheel holds the package and its data, and nothing else")
        python = environment(sys.executable, Path(scratch, "env"), wheel, "dev")
        return int(bool(faults) or not python or tested(python, sdist, Path(scratch, "tree"), tests))


def matrix_job(tests: Sequence[str], only: Sequence[str]) -> int:
    """The job ``matrix``: 1 where a version fails."""
    results: dict[str, str] = {}
    with TemporaryDirectory() as scratch:
        wheel, sdist = built(Path(scratch, "dist"))
        for name in only:
            python = interpreter(name.partition("-")[0])
            inside = python and environment(python, Path(scratch, name), wheel, "dev", VERSIONS[name])
            if not inside:
                results[name] = "not installed" if python else "no interpreter found here: NOT TESTED"
            else:
                print(f"{name}: {versions(inside)}", flush=True)
                results[name] = "FAILED" if tested(inside, sdist, Path(scratch, f"tree-{name}"), tests) else "passed"
            print(f"{name}: {results[name]}", flush=True)
    print("\n".join(f"{name}: {result}" for name, result in results.items()))
    return int(any(result in ("FAILED", "not installed") for result in results.values()))


def versions(python: str) -> str:
    """What is installed of what ephs needs, a line."""
    say = (
        "import importlib.metadata as m, platform, re; "
        "names = [re.match(r'[\\w-]+', r)[0] for r in m.requires('ephs') if 'extra' not in r]; "
        "print(platform.python_version(), *(f'{n} {m.version(n)}' for n in names), sep=', ')"
    )
    return subprocess.check_output([python, "-c", say], text=True).strip()


def smoke_job() -> int:
    """The job ``smoke``: 0 also where there is no other Python or no way to install."""
    running = f"{sys.version_info.major}.{sys.version_info.minor}-newest"
    with TemporaryDirectory() as scratch:
        try:
            wheel, _ = built(Path(scratch, "dist"))
        except subprocess.CalledProcessError:  # a build that is broken shows where the environment is made
            print("smoke: the wheel could not be built; nothing tested")
            return 0
        return max(_smoke(name, wheel, Path(scratch, name)) for name in VERSIONS if name != running)


def _smoke(name: str, wheel: Path, folder: Path) -> int:
    python = interpreter(name.partition("-")[0])
    inside = python and environment(python, folder, wheel, "", VERSIONS[name])
    if not inside:
        print(f"smoke, {name}: {'nothing could be installed' if python else 'no such Python here'}; not tested")
        return 0
    work = folder / "work"
    work.mkdir()
    plain = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    for command in SMOKE:
        done = subprocess.run([inside, "-m", "ephs", *command], cwd=work, env=plain, capture_output=True, text=True)
        if done.returncode:
            print(f"smoke, {name}: ephs {' '.join(command)} ended with {done.returncode}")
            print(done.stdout, done.stderr, sep="\n")
            return 1
    print(f"smoke, {name}: {len(SMOKE)} commands of the wheel ran", flush=True)
    return 0


def main() -> int:
    """Do the job that is asked for."""
    parser = argparse.ArgumentParser(prog="python -m tests.release", description=__doc__)
    parser.add_argument("job", choices=("objects", "wheel", "matrix", "smoke"))
    parser.add_argument("tests", nargs="*", default=["tests"], help="what pytest is to run")
    parser.add_argument("--only", nargs="+", choices=VERSIONS, default=list(VERSIONS), help="these of the matrix")
    asked, options = parser.parse_known_args()  # what is not known here is pytest's: -n 2
    tests = [*asked.tests, *options]
    if asked.job in ("objects", "smoke"):
        return objects_job() if asked.job == "objects" else smoke_job()
    return wheel_job(tests) if asked.job == "wheel" else matrix_job(tests, asked.only)


if __name__ == "__main__":
    sys.exit(main())
