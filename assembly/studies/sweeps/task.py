"""What is sent to a worker. Nothing imported here loads Numba, so the worker can be told which kernels to load."""

from __future__ import annotations

import hashlib
import os
import pickle
import platform
import sys
import threading
from typing import TYPE_CHECKING, Any

from assembly._turn import in_child

if TYPE_CHECKING:
    from assembly.studies.sweeps.work import ChunkDone

__all__ = ["Parcel", "compute", "portable_variables"]

# The studies that this process worked for last, unpickled.
_known: dict[str, Any] = {}
MOST_KNOWN = 2
# Threads take turns: what was set anew is counted for the process (`kinematics/changes.py`), and most of a row is
# Python.
_turn = threading.RLock()


def _begin_in_child() -> None:
    global _turn
    _turn = threading.RLock()
    # Another thread may have been amid a chunk of one of them.
    _known.clear()


in_child(_begin_in_child)


class Parcel:
    """Bytes for a worker, and their name.

    Dask names what is submitted by a hash of its arguments, and hashes bytes as the text that they are printed as: 2 ms
    for a chunk of 6,000 rows. It asks arguments for a name of their own first.

    Attributes
    ----------
    content : bytes
    name : str
        Their SHA-256.
    """

    __slots__ = ("content", "name")

    def __init__(self, content: bytes) -> None:
        self.content, self.name = content, hashlib.sha256(content).hexdigest()

    def __dask_tokenize__(self) -> str:
        return self.name


def portable_variables() -> dict[str, str]:
    """Environment variables of kernels that round the same on all processors of a kind.

    Those of `assembly._kernel.targets`, which nobody can import without Numba, who reads them when it is imported.
    """
    is_x86 = platform.machine().lower() in ("x86_64", "amd64")
    return {"NUMBA_CPU_NAME": "x86-64-v3" if is_x86 else "generic", "NUMBA_CPU_FEATURES": ""}


def compute(job: Parcel, chunk: Parcel) -> ChunkDone:
    """Solve a chunk of a study's runs, in any process or thread.

    Parameters
    ----------
    job : Parcel
        The scene, its parameters and the measures, pickled: a worker that has those of this name does not unpickle them
        again.
    chunk : Parcel
        The runs, pickled.
    """
    if "numba" not in sys.modules:
        os.environ.update(portable_variables())
    from assembly.studies.sweeps.work import Worker

    with _turn:
        if job.name not in _known:
            while len(_known) >= MOST_KNOWN:
                del _known[next(iter(_known))]
            _known[job.name] = Worker(pickle.loads(job.content))
        done: ChunkDone = _known[job.name].compute(pickle.loads(chunk.content))
        if done.interrupted:
            # It was stopped amid a row, wherever that left the numbers of its scene.
            del _known[job.name]
        return done
