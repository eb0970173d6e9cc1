"""All checks of the project: ``python -m tests [arguments for pytest]``."""

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
    ["-m", "pytest"],
)


def main(arguments: list[str]) -> int:
    """Run every check, the tests last; the number of those that failed."""
    failed = 0
    for check in CHECKS:
        command = [*check, *arguments] if check[-1] == "pytest" else check
        print(f"\n$ python {shlex.join(command)}", flush=True)
        failed += subprocess.run([sys.executable, *command], cwd=ROOT, check=False).returncode != 0
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
