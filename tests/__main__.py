"""All checks of the project: ``python -m tests [arguments for pytest]``.

The large kernels are compiled meanwhile, once, for all processes that run tests.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CHECKS = (
    ["-m", "ruff", "check", "."],
    ["-m", "mypy"],
    ["-c", "from importlinter.cli import lint_imports_command as lint_imports; lint_imports()"],
    ["-m", "pytest", "-n", "auto", "--dist", "worksteal", "--durations", "25"],
)


def main(arguments: list[str]) -> int:
    """Run every check, the tests last; the number of those that failed."""
    failed = 0
    warming = [subprocess.Popen([sys.executable, "-m", "tests.warm", part], cwd=ROOT) for part in ("scenes", "queries")]
    for check in CHECKS:
        command = check
        if "pytest" in check:
            command = [*check, *arguments]
            failed += sum(process.wait() != 0 for process in warming)
        print(f"\n$ python {shlex.join(command)}", flush=True)
        failed += subprocess.run([sys.executable, *command], cwd=ROOT, check=False).returncode != 0
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
