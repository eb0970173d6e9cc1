"""All checks of the project: ``python -m tests [arguments for pytest]``.

Kernels and byte code are compiled first, once, for all processes that run tests, while the other checks run.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CHECKS = (
    ["-m", "ruff", "check", "."],
    ["-m", "mypy"],
    ["-c", "from importlinter.cli import lint_imports_command as lint_imports; lint_imports()"],
    ["-m", "pytest", "-n", "auto", "--dist", "worksteal", "--durations", "20"],
)


def main(arguments: list[str]) -> int:
    """Run every check, the tests last; the number of those that failed."""
    failed = 0
    # Tests start a hundred interpreters that import the library.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run([sys.executable, "-m", "compileall", "-q", "assembly", "benchmarks", "tests"], cwd=ROOT, check=True)
    compiling = subprocess.Popen([sys.executable, "-m", "assembly.kernels", "--compile"], cwd=ROOT)
    for check in CHECKS:
        command = check
        if "pytest" in check:
            command = [*check, *arguments]
            failed += compiling.wait() != 0
        print(f"\n$ python {shlex.join(command)}", flush=True)
        done = subprocess.run([sys.executable, *command], cwd=ROOT, env=environment, check=False)
        failed += done.returncode != 0
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
