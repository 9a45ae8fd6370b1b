"""Journals: a run on disk in progress, readable and resumable after any interruption.

A journal is a file that only grows: a heading, which says whose run it is, then the rows that were kept since the last
entry, with a snapshot of where the run stood. Each entry has its length and a checksum, and is on the disk before the
next one begins; what an interruption left unfinished at the end is not read. Nothing in it is ever executed.
"""

import hashlib
import json
import os
import struct
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, final

import numpy as np

from ephs.semantics.bundles.bundle import Array
from ephs.solve.posing.errors import OptionError, Outcome, SolveError
from ephs.solve.result.durable import sync_folder
from ephs.solve.result.record import UNSOLVED, RunRecord, joined
from ephs.solve.running.snapshot import Snapshot, parts

FORMAT = 5
MAGIC = b"ephs run"
EVERY = 0.5
"""Seconds between two entries."""
_FRAME = struct.Struct("<8sQ16s")
_DTYPES = ("<f8", "<i8", "|b1", "<c16")


@final
@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """Content of a journal.

    Parameters
    ----------
    heading
        Whose run it is.
    rows
        What was kept, up to the last entry; None where there is nothing yet.
    snapshot
        Where the run stood at the last entry that says so, and ``certain``, the rows up to there: a run goes on from
        it. None where it has to begin anew.
    end
        Bytes up to there.
    stats
        What the run had done by the last entry.
    """

    heading: Mapping[str, Any]
    rows: RunRecord | None
    snapshot: Snapshot | None
    certain: RunRecord | None
    end: int
    stats: Mapping[str, Any]


@final
@dataclass(frozen=True, slots=True)
class Journal:
    """Location of a run's journal.

    Parameters
    ----------
    path
        The file. One that holds the same run, unfinished, is continued.
    note
        What else its heading is to say, as JSON can hold it.
    """

    path: Path
    note: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, given: "Journal | str | os.PathLike[str] | None") -> "Journal | None":
        """From the user's option."""
        return given if given is None or isinstance(given, Journal) else cls(Path(given))

    def open(self, heading: Mapping[str, Any]) -> "Written":
        """Create the journal, or read its part of this run.

        Raises
        ------
        OptionError
            The file is no journal, is another run's, or is being written by another process.
        """
        said = {"format": FORMAT, **heading, "note": self.note}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        file = open(self.path, "a+b", buffering=0)  # noqa: SIM115 - it stays open for the run
        try:
            _lock(file, self.path)
            if _unborn(self.path):
                file.truncate(0)
                written = Written(self.path, file, None)
                written.append(json.dumps(said).encode())
                sync_folder(self.path.parent)
                return written
            found = read_journal(self.path)
            _same(self.path, found.heading, said)
            file.truncate(found.end)
            return Written(self.path, file, found)
        except BaseException:
            file.close()
            raise


@final
class Written:
    """The journal of a run in progress.

    Attributes
    ----------
    snapshot
        Where an earlier part of the run stood, None where there is none; and ``rows``, what it kept.
    """

    def __init__(self, path: Path, file: BinaryIO, found: Contents | None) -> None:
        self._path, self._file = path, file
        self._good = found.end if found else 0
        self._latest = time.monotonic()
        self.snapshot = found.snapshot if found else None
        self.rows = found.certain if found else None

    @property
    def due(self) -> bool:
        """Whether it is time for an entry."""
        return time.monotonic() - self._latest > EVERY

    def write(self, rows: RunRecord | None, snapshot: Snapshot | None, stats: Mapping[str, Any]) -> None:
        """Write an entry to the disk: new rows, the state of the run, its counts so far.

        Raises
        ------
        SolveError
            It cannot be written; the file stays as it was.
        """
        try:
            self.append(_encoded({"rows": parts(rows), "snapshot": snapshot, "stats": stats}))
        except OSError as error:
            raise SolveError(Outcome.UNWRITTEN, "", f"{self._path}: {error.strerror or error}", error) from error

    def append(self, payload: bytes) -> None:
        """Bytes as an entry.

        Raises
        ------
        OSError
            They cannot be written.
        """
        whole = memoryview(_FRAME.pack(MAGIC, len(payload), _digest(payload)) + payload)
        try:
            at = 0
            while at < len(whole):
                at += self._file.write(whole[at:]) or 0
            os.fsync(self._file.fileno())
        except BaseException:  # a full disk, or Ctrl-C: no incomplete entry may precede the next one
            self._file.truncate(self._good)
            raise
        self._good += len(whole)
        self._latest = time.monotonic()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_journal(path: str | os.PathLike[str]) -> Contents:
    """Complete entries of a journal.

    Raises
    ------
    OptionError
        The file is no journal.
    """
    file = Path(path)
    rows: list[RunRecord] = []
    heading: Any = None
    snapshot: Snapshot | None = None
    stats, certain, end = UNSOLVED, 0, 0
    try:
        for payload, after in _payloads(file):
            if heading is None:
                heading, end = json.loads(payload), after
                if not _whole(heading):
                    break
                continue
            entry = _decoded(payload)
            stats = entry["stats"]
            if entry["rows"] is not None:
                rows.append(RunRecord(**entry["rows"]))
            if entry["snapshot"] is not None:
                snapshot, certain, end = entry["snapshot"], len(rows), after
    except (ValueError, KeyError, TypeError, RecursionError) as error:  # with a valid checksum
        raise OptionError("journal", str(file), f"a journal that ephs wrote ({error})") from error
    if not _whole(heading):
        raise OptionError("journal", str(file), f"a journal of a run, format {FORMAT}")
    return Contents(heading, joined(rows), snapshot, joined(rows[:certain]), end, stats)


def _whole(heading: Any) -> bool:
    """Whether it identifies its run, as `Journal.open` requires."""
    wanted = {"format": int, "name": str, "model": str, "run": dict, "note": dict}
    told = isinstance(heading, dict) and all(isinstance(heading.get(key), kind) for key, kind in wanted.items())
    return told and heading["format"] == FORMAT and {"form", "inputs"} <= set(heading["run"])


def _unborn(file: Path) -> bool:
    """Whether its heading is incomplete: writing was interrupted there."""
    with open(file, "rb") as stream:
        first = stream.read(_FRAME.size)
    if len(first) < _FRAME.size:
        return MAGIC.startswith(first[: len(MAGIC)])
    magic, length, _ = _FRAME.unpack(first)
    return magic == MAGIC and file.stat().st_size < _FRAME.size + length


def _payloads(file: Path) -> Iterator[tuple[bytes, int]]:
    """(payload, bytes up to its end) of each whole entry."""
    size = file.stat().st_size
    with open(file, "rb") as stream:
        while stream.tell() + _FRAME.size <= size:
            magic, length, digest = _FRAME.unpack(stream.read(_FRAME.size))
            if magic != MAGIC or stream.tell() + length > size:
                return
            payload = stream.read(length)
            if _digest(payload) != digest:
                return
            yield payload, stream.tell()


def _same(path: Path, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    """Refuse another run's journal.

    Raises
    ------
    OptionError
        It names what differs.
    """
    before, now = _flat(found.get("run")), _flat(json.loads(json.dumps(wanted["run"])))
    for key in dict.fromkeys([*now, *before]):
        if before.get(key) != now.get(key):
            told = f"the journal of this run; its {key} is {_short(before.get(key))}, here it is {_short(now.get(key))}"
            raise OptionError("journal", str(path), told)


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    """Entries of nested mappings by dotted keys."""
    if not isinstance(value, dict):
        return {key: value}
    return {k: v for name, item in value.items() for k, v in _flat(item, f"{key}.{name}" if key else name).items()}


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _digest(payload: bytes) -> bytes:
    return hashlib.blake2b(payload, digest_size=16).digest()


def _encoded(tree: Snapshot) -> bytes:
    """The length of a JSON text, the text, in which arrays are numbered, then the arrays' bytes."""
    arrays: list[Array] = []

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            arrays.append(np.ascontiguousarray(value))
            return {"array": len(arrays) - 1, "dtype": value.dtype.str, "shape": value.shape}
        if isinstance(value, Mapping):
            return {"map": {str(key): plain(item) for key, item in value.items()}}
        if isinstance(value, list | tuple):
            return [plain(item) for item in value]
        return value.item() if isinstance(value, np.generic) else value

    text = json.dumps(plain(tree)).encode()
    return b"".join([struct.pack("<Q", len(text)), text, *(array.tobytes() for array in arrays)])


def _decoded(payload: bytes) -> Any:
    (length,) = struct.unpack_from("<Q", payload)
    at = 8 + length

    def whole(value: Any) -> Any:
        nonlocal at
        if isinstance(value, list):
            return [whole(item) for item in value]
        if not isinstance(value, dict):
            return value
        if "map" in value:
            return {key: whole(item) for key, item in value["map"].items()}
        if value["dtype"] not in _DTYPES:
            raise ValueError(f"an array of {value['dtype']}")
        dtype, shape = np.dtype(value["dtype"]), tuple(int(n) for n in value["shape"])
        count = int(np.prod(shape, dtype=object)) if shape else 1
        array = np.frombuffer(payload, dtype, count, at).reshape(shape).copy()
        at += array.nbytes
        return array

    return whole(json.loads(payload[8 : 8 + length]))


def _lock(file: BinaryIO, path: Path) -> None:
    """Refuse a journal that another process writes."""
    if os.name != "posix":
        return
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise OptionError("journal", str(path), "a file that no other run is writing") from error
