"""Finished parts of a study on disk: a manifest that identifies the study, and a file of lines for each chunk.

A part is written beside its place and moved there as a whole, and says at its end how many rows it has. So a process
that is killed leaves whole parts, and at most one unfinished file, which the next one removes; what a power failure
tore has no such end, and its rows are solved again.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.studies.sweeps.chain import Start
from assembly.studies.sweeps.table import Table
from assembly.studies.sweeps.work import ChunkDone, Rows

__all__ = ["Folder"]

Array = NDArray[np.float64]
MANIFEST, LOCK, PART, UNFINISHED = "manifest.json", "lock", "part-", "unfinished-"


class Folder:
    """The folder of one study; one process at a time writes to it.

    Parameters
    ----------
    path : str or path
        Made if it is not there.
    manifest : mapping
        What the study is of, as JSON has it.

    Attributes
    ----------
    kernels : str
        The processor that kernels of the parts were compiled for; empty without parts.

    Raises
    ------
    InputError
        It is the folder of another study, or another process is at it.
    """

    def __init__(self, path: str | os.PathLike[str], manifest: Mapping[str, Any]) -> None:
        self.path = Path(path)
        if self.path.exists() and not self.path.is_dir():
            raise InputError(f"folder is {str(path)!r}, which is a file; expected a folder, or a name for one")
        self.path.mkdir(parents=True, exist_ok=True)
        self.kernels = ""
        self._lock = _locked(self.path)
        try:
            self._check(json.loads(json.dumps(manifest)))
            for left in self.path.glob(f"{UNFINISHED}*"):
                left.unlink()
            # Never a name that was there before: what was read is not written over.
            numbers = [int(path.stem.removeprefix(PART)) for path in self._parts()]
            self._next = max(numbers, default=-1) + 1
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let another process have it."""
        self._lock.close()

    def read(self, table: Table) -> None:
        """Take over what is finished."""
        for path in self._parts():
            done = self._part(path, table)
            if done is not None:
                table.take(done)

    def write(self, done: ChunkDone, table: Table) -> None:
        """Keep a chunk."""
        self.kernels = done.kernels
        lines = _lines(done, table)
        text = "\n".join([json.dumps({"kernels": done.kernels}), *lines, json.dumps({"rows": len(lines)})])
        self._put(f"{PART}{self._next:06d}.jsonl", text + "\n")
        self._next += 1

    def _parts(self) -> list[Path]:
        return sorted(path for path in self.path.glob(f"{PART}*.jsonl") if path.stem.removeprefix(PART).isdigit())

    def _check(self, manifest: dict[str, Any]) -> None:
        """Write the manifest, or compare it with the one that is there."""
        there = self.path / MANIFEST
        if not there.exists():
            if self._parts():
                raise InputError(
                    f"folder {str(self.path)!r} has parts of a study and no {MANIFEST}; expected another one"
                )
            self._put(MANIFEST, json.dumps(manifest, indent=1) + "\n")
            return
        try:
            before = json.loads(there.read_text(encoding="utf-8"))
        except ValueError:
            before = None
        if not isinstance(before, dict) or before.get("format") != manifest["format"]:
            raise InputError(f"folder {str(self.path)!r} has a {MANIFEST} of something else; expected that of a study")
        for key in {**manifest, **before}:
            if before.get(key) != manifest.get(key):
                raise InputError(
                    f"folder {str(self.path)!r} is of a study that differs in its {key}: "
                    f"{_shown(before.get(key))} there, {_shown(manifest.get(key))} here; "
                    "expected the same, or another folder"
                )

    def _put(self, name: str, text: str) -> None:
        """Write a file so that it is there as a whole or not at all."""
        # Nobody else writes here.
        place = self.path / f"{UNFINISHED}{name}"
        place.write_bytes(text.encode())
        os.replace(place, self.path / name)

    def _part(self, path: Path, table: Table) -> ChunkDone | None:
        """The runs of a part that are not done yet; None of one that is damaged."""
        found, rows = Rows(), list[int]()
        try:
            head, *lines, end = map(json.loads, path.read_text(encoding="utf-8").splitlines())
            if end != {"rows": len(lines)}:
                return None
            for line in lines:
                number = line["run"]
                if table.done[number]:
                    continue
                if not found.runs or found.runs[-1] != number:
                    found.runs.append(number)
                values = [math.nan if x is None else x for x in line["measures"]]
                found.add(line["status"], line.get("message", ""), line["iterations"], values)
                rows.append(line["row"])
                if "start" in line:
                    start = line["start"]
                    found.starts.setdefault(number, []).append(start and _read_start(start, table.values.shape[1]))
            # What a run is of is told by the plan.
            if not rows or rows != table.rows(found.runs).tolist():
                return None
            done = ChunkDone.of(found, 0.0, head["kernels"])
        except (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError):
            return None
        self.kernels = self.kernels or done.kernels
        return done


def _lines(done: ChunkDone, table: Table) -> list[str]:
    """A line of JSON for each row of a chunk, written by hand: most of it is the same in all of them."""
    measures = _measures(done.values)
    kinds = list(zip(done.status.tolist(), done.iterations.tolist(), strict=True))
    names = list(map(json.dumps, done.names))
    heads = {kind: f'"status": {names[kind[0]]}, "iterations": {kind[1]}, "measures": [' for kind in set(kinds)}
    lines: list[str] = []
    for number in done.runs:
        rows = table.runs[number].rows.tolist()
        run, own = f', "run": {number}, ', slice(len(lines), len(lines) + len(rows))
        lines += [
            f'{{"row": {row}{run}{heads[kind]}{told}]}}'
            for row, kind, told in zip(rows, kinds[own], measures[own], strict=True)
        ]
    for k, message in done.messages.items():
        lines[k] = f'{lines[k][:-1]}, "message": {json.dumps(message)}}}'
    at = 0
    for number in done.runs:
        for k, start in enumerate(done.starts.get(number, ()), at):
            lines[k] = f'{lines[k][:-1]}, "start": {_written_start(start)}}}'
        at += len(table.runs[number].rows)
    return lines


def _written_start(start: Start | None) -> str:
    """The bytes of a start's numbers and poses: in decimals these took as long as the lines of 30 rows."""
    if start is None:
        return "null"
    return f'"{np.concatenate([start.values, start.q.ravel()]).astype("<f8").tobytes().hex()}"'


def _read_start(text: str, parameters: int) -> Start:
    """The same read."""
    numbers = np.frombuffer(bytes.fromhex(text), dtype="<f8").astype(np.float64)
    return Start(numbers[:parameters], numbers[parameters:].reshape(-1, 7))


def _measures(values: Array) -> list[str]:
    """The measures (k, m) of each row, with commas; null for those that are not finite."""
    told = list(map(repr, values.ravel().tolist()))
    for k in np.flatnonzero(~np.isfinite(values)):
        told[k] = "null"
    count = values.shape[1]
    return told if count == 1 else [", ".join(told[k * count : (k + 1) * count]) for k in range(len(values))]


def _locked(path: Path) -> IO[str]:
    """A file of the folder that this process alone has; its lock ends with the process, however that ends."""
    file = open(path / LOCK, "w", encoding="ascii")  # noqa: SIM115  # open as long as it is locked
    with suppress(ImportError):
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            file.close()
            raise InputError(f"folder {str(path)!r} is written to by another process; expected one at a time") from None
    return file


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
