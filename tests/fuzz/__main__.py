"""Mutated inputs by the million: ``python -m tests.fuzz COUNT [--seed SEED] [--again]``.

One process reads them, within bounds of time and memory, another watches it; what is no model and no clear error is
made smaller and kept in ``tests/fuzz/corpus``. Interrupted, or run again with a larger count, it goes on where it was.
"""

import argparse
import json
import mmap
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from tests.fuzz.mutations import mutated

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CORPUS = HERE / "corpus"
MEMORY_DISK = Path("/dev/shm")
FIELDS = ("next", "models", "errors", "defects", "deep", "seconds")
DEEP = 50
"""One in so many inputs has to run as well."""
SILENT_S = 120.0
"""How long a process may be at one input before it counts as hanging."""
STARTING_S = 1200.0
"""… and at its first one, before which all that is compiled once is compiled."""
RENEWED = 100_000
"""After so many inputs a fresh process goes on: what a long one has gathered would hide what one input takes."""


class Tally:
    """Where the run is, in a file that both processes see, so that not even a crash loses count."""

    def __init__(self, path: Path) -> None:
        if not path.exists():
            path.write_bytes(bytes(8 * len(FIELDS)))
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), 8 * len(FIELDS))

    def __getitem__(self, field: str) -> int:
        return struct.unpack_from("q", self._map, 8 * FIELDS.index(field))[0]

    def __setitem__(self, field: str, value: int) -> None:
        struct.pack_into("q", self._map, 8 * FIELDS.index(field), value)


def main() -> None:
    """Watch processes that read inputs, until all are read."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", default="0")
    parser.add_argument("--again", action="store_true", help="from the first input on")
    parser.add_argument("--one", type=int, help="read this one only, and say what becomes of it")
    parser.add_argument("--reader", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    folder = ROOT / "out" / "fuzz-inputs" / given.seed
    folder.mkdir(parents=True, exist_ok=True)
    if given.again:
        (folder / "tally").unlink(missing_ok=True)
    tally = Tally(folder / "tally")
    if given.one is not None:
        _one(given.seed, given.one, folder)
    elif given.reader:
        _read(given.seed, given.count, tally)
    else:
        _watch(given.seed, given.count, tally)


def _watch(seed: str, count: int, tally: Tally) -> None:
    command = [sys.executable, "-X", "faulthandler", "-m", "tests.fuzz", str(count), "--seed", seed, "--reader"]
    said, spoken, died = tally["next"], time.monotonic(), -1
    while tally["next"] < count:
        reader = subprocess.Popen(command, cwd=ROOT)
        first = at = tally["next"]
        since = time.monotonic()
        try:
            while reader.poll() is None:
                time.sleep(0.2)
                now = time.monotonic()
                if tally["next"] != at:
                    at, since = tally["next"], now
                elif now - since > (SILENT_S if at > first else STARTING_S):
                    reader.send_signal(signal.SIGABRT)  # it says where it hangs
                if now - spoken > 15.0:
                    print(_line(tally, count, (at - said) / (now - spoken)), flush=True)
                    said, spoken = at, now
        except KeyboardInterrupt:
            reader.kill()
            print(_line(tally, count, 0.0))
            sys.exit(130)
        if reader.returncode > 0:
            sys.exit("the reader failed at its own work")
        if reader.returncode and tally["next"] != died:  # once more: it may have been the machine's doing
            died = tally["next"]
            print(f"input {died}: the process died with {reader.returncode}; read again", flush=True)
        elif reader.returncode:
            _died(seed, reader.returncode, tally)
    print(_line(tally, count, 0.0))


def _line(tally: Tally, count: int, rate: float) -> str:
    counts = ", ".join(f"{tally[field]} {field}" for field in FIELDS[1:])
    return f"{tally['next']} of {count} inputs: {counts}; {rate:.0f} inputs/s"


def _died(seed: str, code: int, tally: Tally) -> None:
    """A process that an input killed: the input is kept as it is, and left behind."""
    from tests.fuzz.seeds import seeds

    kind, data = mutated(seed, tally["next"], seeds())
    _keep(f"died with {code}", kind, data, f"seed {seed}, input {tally['next']}: the process died with {code}")
    tally["defects"] += 1
    tally["next"] += 1


def _read(seed: str, count: int, tally: Tally) -> None:
    from tests.fuzz.judging import Judge
    from tests.fuzz.seeds import seeds

    texts = seeds()
    with tempfile.TemporaryDirectory(prefix="ephs-fuzz-", dir=MEMORY_DISK if MEMORY_DISK.is_dir() else None) as place:
        _read_in(Judge(Path(place)), texts, seed, count, tally)


def _read_in(judge: Any, texts: dict[str, list[str]], seed: str, count: int, tally: Tally) -> None:
    from tests.fuzz.judging import bounded

    for kind in ("toml", "urdf", "sdf", "xml"):  # what is compiled or imported once is not an input's
        for text in dict.fromkeys(texts[kind]):
            judge(kind, text.encode(), deep=True)
    bounded()
    known = set[str]()
    last, start = min(count, tally["next"] + RENEWED), time.process_time()
    while tally["next"] < last:
        number = tally["next"]
        kind, data = mutated(seed, number, texts)
        verdict = judge(kind, data, deep=number % DEEP == 0)
        if verdict.outcome == "defect" and verdict.signature not in known:
            known.add(verdict.signature)
            small = _smaller(judge, kind, data, verdict.signature, deep=number % DEEP == 0)
            _keep(verdict.signature, kind, small, f"seed {seed}, input {number}\n{verdict.detail}")
        tally[verdict.outcome + "s"] += 1
        tally["deep"] += verdict.deep
        tally["next"] = number + 1
        if number % 1000 == 0:
            now = time.process_time()
            tally["seconds"] += int(now - start)
            start += int(now - start)


def _one(seed: str, number: int, folder: Path) -> None:
    from tests.fuzz.judging import Judge
    from tests.fuzz.seeds import seeds

    kind, data = mutated(seed, number, seeds())
    sys.stdout.buffer.write(data[:5000] + b"\n")
    print(kind, Judge(folder / "one")(kind, data, deep=True))


def _smaller(judge: Any, kind: str, data: bytes, signature: str, *, deep: bool) -> bytes:
    """The same defect from less, by leaving out ever smaller pieces, as long as that is quick."""
    until, size = time.monotonic() + 5.0, len(data) // 2
    while size and time.monotonic() < until:
        at = 0
        while at < len(data) and time.monotonic() < until:
            less = data[:at] + data[at + size :]
            if judge(kind, less, deep=deep).signature == signature:
                data = less
            else:
                at += size
        size //= 2
    return data


def _keep(signature: str, kind: str, data: bytes, detail: str) -> None:
    CORPUS.mkdir(exist_ok=True)
    name = re.sub(r"\W+", "-", signature).strip("-").lower()[:80]
    names = (CORPUS / f"{name}{number}.{kind}" for number in ("", *(f"-{i}" for i in range(2, 1000))))
    target = next(path for path in names if not path.exists())  # what looks alike may be something else
    target.write_bytes(data)
    notes = ROOT / "out" / "fuzz-inputs" / "found.jsonl"
    with notes.open("a") as file:
        file.write(json.dumps({"file": target.name, "detail": detail, "pid": os.getpid()}) + "\n")
    print(f"found: {signature} ({target.name})", flush=True)


if __name__ == "__main__":
    main()
