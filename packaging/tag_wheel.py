"""``python tag_wheel.py WHEEL FOLDER``: a wheel for Linux is given the platform that llvmlite's wheels have.

auditwheel, which does this for other packages, looks at shared libraries. This package has none: its machine code is
loaded by llvmlite, and calls what llvmlite and Numba bring.
"""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
from pathlib import Path


def main(wheel: Path, folder: Path) -> None:
    """Write the wheel with its new name into the folder."""
    tag = f"manylinux_2_28_{platform.machine()}"
    command = [sys.executable, "-m", "wheel", "tags", "--remove", "--platform-tag", tag, str(wheel)]
    (name,) = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    shutil.move(wheel.with_name(name), folder / name)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
