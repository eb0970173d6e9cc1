"""A study in a process that is killed from outside.

The server of forks imports this ahead. By then the kernels are loaded, so that a process is at work in milliseconds,
where a fresh one takes seconds.
"""

from __future__ import annotations

import time
from pathlib import Path

import assembly as asm
from tests.studies.sweeps.sweep_scenes import narrow

# So short that each process writes several parts before it is killed.
CHUNK_SECONDS = 0.002

asm.study(*narrow(3))


def go_on(folder: str, rows: int) -> None:
    """Go on with a study until killed: also where it was done before that came, unless nothing was left to do."""
    parts = len(list(Path(folder).glob("part-*")))
    asm.study(*narrow(rows), folder=folder, chunk_seconds=CHUNK_SECONDS)
    if len(list(Path(folder).glob("part-*"))) > parts:
        time.sleep(600.0)
