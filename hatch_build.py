"""Puts compiled kernels into the package when it is built: see `assembly/kernels/ship.py`.

``ASSEMBLY_KERNELS`` in the environment says which: ``native`` for this machine's processor (also if it is not set),
``portable`` for any of its kind, as wheels for others need, ``0`` for none. An editable install has none.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

KINDS = ("native", "portable", "0")
# What kernels are compiled with, of what the package depends on.
COMPILING = ("llvmlite", "numba", "numpy", "scipy", "tqdm")


def wanted() -> str:
    """Which kernels are to be built."""
    kind = os.environ.get("ASSEMBLY_KERNELS") or "native"
    if kind not in KINDS:
        raise ValueError(f"ASSEMBLY_KERNELS is {kind!r}; expected one of {', '.join(KINDS)}")
    return kind


class Kernels(BuildHookInterface):
    """Compiles the kernels in a process of its own, in parallel, before files are gathered."""

    def dependencies(self) -> list[str]:
        """What pip puts into the environment of the build, besides hatchling."""
        if wanted() == "0":
            return []
        required = self.metadata.core.dependencies
        return [line for line in required if re.match(r"[\w-]+", line)[0] in COMPILING]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and add what was compiled to the files of the wheel."""
        if version == "editable" or wanted() == "0":
            return
        root = Path(self.root)
        entries = root / "build" / "entries"
        shutil.rmtree(entries, ignore_errors=True)
        # pip says by PYTHONPATH where the environment of the build is.
        path = os.pathsep.join([str(root), *filter(None, [os.environ.get("PYTHONPATH")])])
        variables = {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(root / "build" / "kernels")}
        command = [sys.executable, "-m", "assembly.kernels.ship", str(entries)]
        subprocess.run(command, cwd=root, env={**os.environ, **variables}, check=True)
        build_data["force_include"][str(entries)] = "assembly/_entries"
        build_data["pure_python"] = False
        build_data["infer_tag"] = True
