"""``python -m assembly.interference file.step``: which parts of a CAD file cross, touch, or nearly do.

In the library it is the function of the same name that is meant: where somebody imports this module, it can be called
as that.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Any

from assembly.errors import AssemblyError
from assembly.step import read_step
from assembly.studies.interference.report import TOUCHING, interference

__all__ = ["main"]

ABOUT = """\
Reads a STEP file and prints a row for every pair of parts that cross, touch, or are nearer to each other than the
margin: how near or how deep, on which faces, and whether that is proved. Exits with 1 where parts cross or are inside
of each other, or pairs were not searched, and with 2 where the file cannot be read."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m assembly.interference", description=ABOUT)
    parser.add_argument("file", help="a STEP file")
    parser.add_argument("--margin", type=float, default=0.0, help="pairs nearer than this are listed; 0 if not given")
    parser.add_argument(
        "--unit", default="mm", help="of the margin and all lengths: mm (the default), um, cm, m, in, ft"
    )
    about = f"what parts may be in each other and still touch, in parts of the assembly's size; {TOUCHING:g}"
    parser.add_argument("--touching", type=float, default=TOUCHING, help=about)
    parser.add_argument("--time-limit", type=float, help="seconds for the search")
    parser.add_argument("--lenient", action="store_true", help="leave out faces that cannot be read, with a warning")
    parser.add_argument("--csv", metavar="FILE", help="write the rows there, too")
    parser.add_argument("--html", metavar="FILE", help="write a picture there, to turn around in a browser")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the report of a file; 0 where no parts cross, 1 where some do or may, 2 where there is no report."""
    wanted = _parser().parse_args(arguments)
    try:
        bodies = read_step(wanted.file, unit=wanted.unit, strict=not wanted.lenient)
        report = interference(bodies, margin=wanted.margin, touching=wanted.touching, time_limit=wanted.time_limit)
        print(report)
        if wanted.csv is not None:
            report.to_csv(wanted.csv)
        if wanted.html is not None:
            from assembly.view import save_html

            save_html(wanted.html, report.scene, interference=report)
    except (AssemblyError, ImportError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return int(any(row.kind in ("crossing", "enclosed", "undecided") for row in report))


class _Callable(ModuleType):
    """A module that is called as the function of its name: `import` puts it in the function's place."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return interference(*arguments, **options)


if __name__ == "__main__":
    raise SystemExit(main())
sys.modules[__name__].__class__ = _Callable
