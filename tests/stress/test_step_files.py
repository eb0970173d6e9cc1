"""Damaged STEP files are refused by name, or read without the faces that are gone; nothing else gets out."""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("OCP", reason='STEP files need OCCT: pip install "assembly-solver[step]"')

# These import OCCT, whose absence is said above.
from tests.step.models import MODELS  # noqa: E402
from tests.step.test_read import File  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent.parent
# Models of a file: few, so that one is read in some hundredths of a second.
WHOLE = (("box", "cone"), ("drilled cylinder",), ("torus", "vase"), ("part of a vase", "slice of a sphere"))
# Seconds a damaged file may take, which is read in another process; whole ones take some hundredths.
LONGEST = 300


def truncated(rng, text):
    return text[: rng.integers(len(text))]


def swapped(rng, text):
    """A few characters change places."""
    letters = list(text)
    for _ in range(rng.integers(1, 20)):
        i, j = rng.integers(len(letters), size=2)
        letters[i], letters[j] = letters[j], letters[i]
    return "".join(letters)


def overwritten(rng, text):
    """A few characters become any others, also such as no STEP file has."""
    letters = list(text)
    for _ in range(rng.integers(1, 20)):
        letters[rng.integers(len(letters))] = chr(rng.integers(256))
    return "".join(letters)


def entities(text):
    return list(re.finditer(r"^#\d+ ?=.*?;$", text, re.MULTILINE | re.DOTALL))


def without_entities(rng, text):
    found = entities(text)
    gone = {int(k) for k in rng.integers(len(found), size=rng.integers(1, 5))}
    for k in sorted(gone, reverse=True):
        text = text[: found[k].start()] + text[found[k].end() :]
    return text


def redirected(rng, text):
    """A few references go to other entities."""
    found = list(re.finditer(r"#\d+", text))
    for k in sorted(rng.integers(len(found), size=rng.integers(1, 5)), reverse=True):
        other = found[rng.integers(len(found))].group()
        text = text[: found[k].start()] + other + text[found[k].end() :]
    return text


DAMAGES = (truncated, swapped, overwritten, without_entities, redirected)


class Reader:
    """A child that reads files, started again where one has ended it."""

    def __init__(self, *arguments):
        self.arguments = arguments
        self.process = None

    def read(self, path):
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "tests.stress.step_damage", *self.arguments],
                cwd=ROOT,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
        self.process.stdin.write(json.dumps(str(path)) + "\n")
        self.process.stdin.flush()
        answered, _, _ = select.select([self.process.stdout], [], [], LONGEST)
        if not answered:
            self.process.kill()
            self.close()
            return f"no answer in {LONGEST} seconds"
        line = self.process.stdout.readline()
        if line:
            return json.loads(line)
        return f"the process ended with {self.close()}"

    def close(self):
        """End the child; its exit code."""
        if self.process is None:
            return 0
        child, self.process = self.process, None
        with contextlib.suppress(BrokenPipeError):
            child.stdin.close()
        child.stdout.close()
        return child.wait(LONGEST)


@pytest.fixture(scope="module")
def reader(whole, times, tmp_path_factory):
    """A child for all damages: to start one, and to have it import OCCT, takes a second.

    So do the processes of the library that read damaged files, which are forks of the child but in long runs.
    """
    child = Reader(*(["forked"] if times == 1 else []))
    # A whole file is read in the child itself, whose forks have then what they need.
    path = tmp_path_factory.mktemp("first") / "whole.step"
    path.write_text(whole[0])
    assert child.read(path) == "read"
    yield child
    child.close()


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Texts of files of several models, whole."""
    texts = []
    for k, names in enumerate(WHOLE):
        path = tmp_path_factory.mktemp("whole") / f"{k}.step"
        file = File()
        for name in names:
            file.part(MODELS[name](), name)
        file.write(path)
        texts.append(path.read_text())
    return texts


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_damaged_files_are_read_or_refused(damage, whole, reader, times, tmp_path):
    rng = np.random.default_rng(len(damage.__name__))
    path = tmp_path / "damaged.step"
    outcomes = Counter()
    # Each is read in a process of its own. Of some at least one has to be read.
    mostly_whole = damage in (without_entities, redirected)
    for _ in range(5 * times if times > 1 or mostly_whole else 1):
        text = damage(rng, whole[rng.integers(len(whole))])
        path.write_bytes(text.encode("latin-1"))
        outcomes[reader.read(path)] += 1
        if times == 1 and outcomes["read"]:
            break
    assert set(outcomes) <= {"read", "refused"}, outcomes
    if mostly_whole:
        # Most of such a file is whole.
        assert outcomes["read"]
