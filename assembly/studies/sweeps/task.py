"""What is sent to a worker. Nothing imported here loads Numba, so the worker can be told which kernels to load."""

from __future__ import annotations

import os
import pickle
import platform
import sys
import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from assembly.studies.sweeps.work import ChunkDone

__all__ = ["compute", "portable_variables"]

# The studies that this process worked for last, unpickled.
_known: dict[str, Any] = {}
MOST_KNOWN = 2
# Threads take turns: what was set anew is counted for the process (`kinematics/changes.py`), and most of a row is
# Python.
_turn = threading.RLock()


def portable_variables() -> dict[str, str]:
    """Environment variables of kernels that round the same on all processors of a kind.

    Those of `assembly._kernel.targets`, which nobody can import without Numba, who reads them when it is imported.
    """
    is_x86 = platform.machine().lower() in ("x86_64", "amd64")
    return {"NUMBA_CPU_NAME": "x86-64-v3" if is_x86 else "generic", "NUMBA_CPU_FEATURES": ""}


def compute(job: bytes, key: str, chunk: bytes) -> ChunkDone:
    """Solve a chunk of a study's runs, in any process or thread.

    Parameters
    ----------
    job : bytes
        The scene, its parameters and the measures, pickled.
    key : str
        Of these bytes: a worker that has them unpickled already does not do it again.
    chunk : bytes
        The runs, pickled.
    """
    if "numba" not in sys.modules:
        os.environ.update(portable_variables())
    from assembly.studies.sweeps.work import Worker

    with _turn:
        if key not in _known:
            while len(_known) >= MOST_KNOWN:
                del _known[next(iter(_known))]
            _known[key] = Worker(pickle.loads(job))
        done: ChunkDone = _known[key].compute(pickle.loads(chunk))
        if done.interrupted:
            # It was stopped amid a row, wherever that left the numbers of its scene.
            del _known[key]
        return done
