"""Results recorded to the last bit: a change of the code's form alone can be told from one of what it computes.

``python -m tests.recorded.recording FILE`` runs all cases and writes their results; without a name, over those that are
kept beside this file: only where a change of bits is meant, and is said in the change.

Kernels run as compiled for the portable processor, and OpenBLAS and NumPy with what every such processor has, so that
two machines with the same versions have the same bits.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
KEPT = HERE / "results.json"
# What NumPy would use beyond AVX2 and fused multiply-add.
_BEYOND = "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V4"
Numbers = dict[str, str | list[str]]


def _written(value: Any) -> str | list[str]:
    """Numbers with all their bits, in hexadecimal."""
    if isinstance(value, str):
        return value
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    rows = value if isinstance(value, (list, tuple)) else [value]
    return [float(x).hex() for row in rows for x in np.ravel(np.asarray(row, dtype=float))]


def results(groups: Iterable[str] | None = None) -> dict[str, dict[str, Numbers]]:
    """All cases of this process: group, name of the case, its numbers."""
    from tests.recorded import motions, queries, solves

    makers = [
        *(solves.joints, solves.objectives, solves.contacts, solves.clearances, solves.many_bodies),
        *(motions.ticks, motions.managers, motions.features, motions.controllers),
        *(queries.distances, queries.batches, queries.pairs, queries.features),
    ]
    told: dict[str, dict[str, Numbers]] = {}
    for maker in makers:
        group = f"{maker.__module__.rpartition('.')[2]} {maker.__name__}"
        if groups is None or group in groups:
            cases: Iterable[tuple[str, Mapping[str, Any]]] = maker()
            told[group] = {case: {k: _written(v) for k, v in numbers.items()} for case, numbers in cases}
    return told


def versions() -> dict[str, str]:
    """What must be the same for the same bits."""
    from assembly._kernel.toolchain import toolchain

    libraries = {name: version(name) for name in ("numba", "llvmlite", "numpy", "scipy", "casadi")}
    return {"toolchain": toolchain(), "machine": platform.machine(), "system": platform.system(), **libraries}


def run_apart(file: Path) -> None:
    """Run all cases in a process for the portable processor, and write their results."""
    from assembly._kernel.targets import PORTABLE_VARIABLES

    portable = {**PORTABLE_VARIABLES, "OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "1"}
    environment = {**os.environ, **portable, "NPY_DISABLE_CPU_FEATURES": _BEYOND, "ASSEMBLY_RECORD": str(file)}
    subprocess.run([sys.executable, "-m", "tests.recorded.recording"], env=environment, cwd=HERE.parents[1], check=True)


if __name__ == "__main__":
    if "ASSEMBLY_RECORD" in os.environ:
        text = json.dumps({"versions": versions(), "results": results()}, indent=0)
        Path(os.environ["ASSEMBLY_RECORD"]).write_text(text + "\n", encoding="utf-8")
    else:
        run_apart(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else KEPT)
