"""Whether the library works alone, beside CadQuery and beside build123d, each in an environment of its own.

    python packaging/check_cad.py FOLDER [alone] [cadquery] [build123d]

makes the environments that are not in the folder yet, installs the library's dependencies there, and runs the tests
that need them on this checkout. Kernels are compiled where there are none; NUMBA_CACHE_DIR says where they are kept.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
STEP = ["tests/step/test_read.py", "tests/step/test_write.py", "tests/step/test_without_occt.py", "tests/cad"]
# What is installed besides the dependencies, and what is tested.
ENVIRONMENTS = {
    "alone": ([], [*STEP, "tests/view"]),
    "cadquery": (["cadquery==2.8.*"], [*STEP, "tests/examples/test_cadquery_solver.py"]),
    "build123d": (["build123d==0.13.*"], STEP),
}
ENVIRONMENTS["cadquery"][1].append("tests/examples/test_cadquery_bracket.py")


def python_of(folder: Path) -> Path:
    """The interpreter of an environment."""
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def made(folder: Path, packages: list[str]) -> Path:
    """An environment with the library's dependencies and these packages, made if it is not there; its interpreter."""
    python = python_of(folder)
    if not python.exists():
        project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
        wanted = [*project["dependencies"], *packages, "pytest", "pytest-xdist", "hypothesis", "hatchling"]
        if not packages:
            wanted += project["optional-dependencies"]["step"]
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
        subprocess.run([str(python), "-m", "pip", "install", "-q", *wanted], check=True)
    return python


def main(folder: str, *names: str) -> int:
    """Check the environments of these names, all by default; how many failed."""
    unknown = [name for name in names if name not in ENVIRONMENTS]
    if unknown:
        print(f"{unknown[0]!r} is none of {', '.join(ENVIRONMENTS)}")
        return 1
    failed = 0
    for name in names or ENVIRONMENTS:
        packages, tests = ENVIRONMENTS[name]
        python = made(Path(folder).resolve() / name, packages)
        print(f"{name}: {python}", flush=True)
        pip = subprocess.run([str(python), "-m", "pip", "check"])
        tested = subprocess.run([str(python), "-m", "pytest", "-q", *tests], cwd=ROOT)
        failed += pip.returncode != 0 or tested.returncode != 0
    print(f"environments that failed: {failed}")
    return failed


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
