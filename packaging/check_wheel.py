"""Whether an installed package solves at once: three paper clips, and not one kernel compiled.

Run it where the package is installed, outside the checkout, with an empty cache: ``python check_wheel.py``.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time

# An empty user's cache: what is found came with the package.
os.environ["NUMBA_CACHE_DIR"] = tempfile.mkdtemp()
BEGIN = time.perf_counter()

import assembly as asm  # noqa: E402  # the time that importing takes is a part of what is told


def chain() -> asm.Assembly:
    """Three paper clips that touch, drawn to a point."""
    clip = asm.shapes.paper_clip(length=33.0, width=8.0, wire_radius=0.5)
    red = asm.Body("red", clip, fixed=True)
    green = asm.Body("green", clip, position=(-7.0, 5.0, -23.0), quaternion=(0.904, 0.279, 0.144, 0.289))
    blue = asm.Body("blue", clip, position=(4.0, 3.0, -28.0), quaternion=(0.649, -0.063, -0.147, 0.744))
    scene = asm.Assembly([red, green, blue])
    scene.constrain(asm.Contact(red, green), asm.Contact(green, blue), asm.Contact(red, blue))
    scene.minimize(asm.PointDistance(blue.point(0, 0, -15), target=(12.0, 4.0, -40.0)))
    return scene


def main() -> int:
    """Solve, and tell what was compiled and how long it took; 1 if something was compiled or not solved."""
    solution = chain().solve()
    seconds = time.perf_counter() - BEGIN
    from assembly._kernel.decorator import ENTRIES

    compiled = sorted(
        str(entry.compiled.__qualname__) for entry in ENTRIES.values() if entry.compiled.stats.cache_misses
    )
    print(f"{asm.__file__}: {solution.status.name}, the first solve {seconds:.2f} s after the start")
    print(f"compiled: {', '.join(compiled) or 'nothing'}")
    return 0 if solution.success and not compiled else 1


if __name__ == "__main__":
    sys.exit(main())
