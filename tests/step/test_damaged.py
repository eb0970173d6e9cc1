"""Files damaged at random: each gives bodies or an error that names it, no process of the user dies, nothing hangs.

Every file is read in a fork that stands for the user's process; the second process of the reader is a fork of that one.
"""

from __future__ import annotations

import os
import pickle
import resource
import signal
import time
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import assembly as asm
from assembly.step import StepError, reader
from assembly.step.occt import occt
from tests.step import forked
from tests.step.models import box, cylinder
from tests.step.test_read import File

pytest.importorskip("OCP")
# Mutations with --long, and seconds of a processor that one may take; other programs may be busy meanwhile.
MUTATIONS, LIMIT, BUSY = 5000, 10, 6.0
# A plain run does every fiftieth; each has its own seed.
PLAIN = 50


def sources(folder):
    """Texts of files: a nested assembly with colors, faces of every kind, and a part in another unit."""
    file = File()
    pin, plate, group = file.part(cylinder(0.5, 3.0), "pin"), file.part(box(), "plate"), file.group("pair")
    file.paint(pin, (0.8, 0.4, 0.2))
    file.put(group, pin, asm.Pose((1.0, 2.0, 3.0)))
    file.put(group, plate, asm.Pose())
    file.write(folder / "pair.step", "INCH")
    thing = asm.shapes.joined(
        asm.shapes.plate(8.0, 6.0, 1.0, [(0.0, 0.0, 1.0)]),
        [asm.Face(asm.shapes.torus(9.0, 1.0)), asm.Face(asm.shapes.paper_clip())],
        asm.shapes.solid_cylinder(0.5, 9.0),
    )
    asm.write_step(folder / "thing.step", asm.Body("thing", thing, color=(0.5, 0.5, 0.5)))
    return [(folder / name).read_bytes() for name in ("pair.step", "thing.step")]


def damaged(text, random):
    """A text with one to three damages: of characters, numbers, statements, references, its end."""
    for _ in range(random.integers(1, 4)):
        # Most of what is damaged is of shapes.
        at = int(random.integers(text.find(b"DATA;"), len(text)))
        kind = random.integers(8)
        if kind == 0:
            text = text[:at] + bytes([random.integers(256)]) + text[at + 1 :]
        elif kind == 1:
            text = text[:at] + text[at + int(random.integers(1, 200)) :]
        elif kind == 2:
            text = text[:at]
        elif kind == 3:
            text = text[:at] + text[at : at + int(random.integers(1, 400))] + text[at:]
        else:
            begin = text.find(b"#" if kind < 6 else b".", at) + 1
            end = begin
            while begin and end < len(text) and text[end : end + 1].isdigit():
                end += 1
            if end > begin:
                # Another number: a reference to another statement, or a value.
                value = b"%d" % random.integers(1, 600) if kind < 7 else b"%dE%d" % tuple(random.integers(0, 99, 2))
                text = text[:begin] + value + text[end:]
    return text


def outcome(path):
    """What a fork that reads a file comes to: bodies, an error, how it died, or that it did not end."""
    inlet, outlet = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        try:
            os.close(inlet)
            nowhere = os.open(os.devnull, os.O_RDWR)
            for stream in range(3):
                os.dup2(nowhere, stream)
            warnings.simplefilter("ignore")
            reader.subprocess = forked.processes
            # Both processes have as much.
            resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT + 1))
            found = _read(path)
            os.write(outlet, pickle.dumps(found))
        finally:
            os._exit(0)
    os.close(outlet)
    end, ended = time.monotonic() + BUSY * LIMIT, 0
    while not ended and time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        time.sleep(0.002)
    if not ended:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    said = os.read(inlet, 60_000) if ended else b""
    os.close(inlet)
    if not ended:
        return f"more than {BUSY * LIMIT:g} seconds"
    return pickle.loads(said) if said else f"ended by {os.waitstatus_to_exitcode(status)}"


def _read(path):
    try:
        bodies = asm.read_step(path, strict=False)
        assert bodies and all(np.isfinite(side.face.area()) for body in bodies for side in body.faces)
    except StepError as error:
        return "error" if Path(path).name in str(error) else f"an error without the file's name: {error}"
    except Exception as error:  # Whatever else is raised is wrong.
        return f"{type(error).__name__}: {error}"
    return "bodies"


def test_damaged_files_give_bodies_or_a_clear_error(tmp_path, request):
    occt()
    texts = sources(tmp_path)
    for name in ("pair.step", "thing.step"):
        assert _read(tmp_path / name) == "bodies"
    path = tmp_path / "damaged.step"
    wrong, count = [], Counter()
    for seed in range(0, MUTATIONS, 1 if request.config.getoption("--long") else PLAIN):
        random = np.random.default_rng(seed)
        path.write_bytes(damaged(texts[seed % 2], random))
        found = outcome(path)
        count[found if found in ("bodies", "error") else "wrong"] += 1
        if found not in ("bodies", "error"):
            wrong.append((seed, found))
    assert not wrong, wrong[:10]
    # Both happen: damage is neither always fatal nor never.
    assert count["bodies"] > 0 and count["error"] > 0, count
