"""How accurate: errors a pair of shapes and a constraint, worst and median, written to ``docs/accuracy.md``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity.extrema.pairs import PairStatus
from benchmarks.figures import figure
from benchmarks.hands import NEAR, WIRE, linked_rings
from benchmarks.hidden import JOINTS, Hidden
from benchmarks.scenes import bicubic, linked_wires, placed, random_pose

ABOUT = """\
Pairs: one surface is placed on the other so that two random points face each other at the gap, with any spin; the pair
is looked for from one percent of the domain beside it in every parameter. Errors are the largest difference of gap and
points from where they were placed, over the larger size. What is not CONVERGED is counted apart, and what is another
extremal pair: a random spin may make the pair one of a continuum, or one of two beside each other. Constraints: scenes
with hidden poses that hold, solved from 0.2 beside them in lengths and radians; errors are distances and cosines of
frames in the world, over a size of one, computed from the poses alone. `docs/accuracy.md` has all of it as a table."""

Array = NDArray[np.float64]
PAGE = Path(__file__).resolve().parent.parent / "docs" / "accuracy.md"
HEADING = """\
# Accuracy

Written by `python -m benchmarks`; do not edit. Errors are measured against where things were placed, by code that
shares nothing with what is measured but the evaluation of surfaces."""
GAPS = (0.1, 1e-6, 0.0, -1e-4)


def _shapes() -> dict[str, asm.NurbsSurface]:
    return {
        "sphere": asm.shapes.sphere(1.0),
        "cylinder": asm.shapes.cylinder(0.5, 2.0),
        "cone": asm.shapes.cone(0.8, 0.3, 1.5),
        "torus": asm.shapes.torus(1.0, 0.3),
        "rational bicubic": bicubic(2),
    }


def _pairs(f: asm.NurbsSurface, g: asm.NurbsSurface, gap: float, count: int) -> tuple[Array, int]:
    """Errors of the pairs that converged, and of how many."""
    rng = np.random.default_rng(11)
    domains = np.array([*f.domain, *g.domain])
    size = max(f.size, g.size)
    errors = []
    for _ in range(count):
        share = rng.uniform(0.15, 0.85, 4)
        x = domains[:, 0] + share * np.ptp(domains, axis=1)
        q_f = random_pose(rng)
        q_g = placed(f, g, x, q_f, gap, rng.uniform(0.0, 2.0 * np.pi))
        start = x + 0.01 * rng.choice([-1.0, 1.0], 4) * np.ptp(domains, axis=1)
        pair = asm.proximity.extremal_pair(f, q_f, g, q_g, start)
        if pair.status is not PairStatus.CONVERGED:
            continue
        points = []
        for surface, q, at in ((f, q_f, x[:2]), (g, q_g, x[2:])):
            points.append(Rotation.from_quat(q[3:], scalar_first=True).apply(surface.evaluate(*at)) + q[:3])
        off = _off(pair, gap, points)
        # Near a fold there is a second extremal pair beside the one that was placed, and either may be found.
        other = off > 1e-9 * size and _off(asm.proximity.extremal_pair(f, q_f, g, q_g, x), gap, points) < 1e-12 * size
        if not other:
            errors.append(off / size)
    return np.array(errors), count


def _off(pair: asm.ContactPair, gap: float, points: list[Array]) -> float:
    return max(abs(pair.gap - gap), float(np.abs(pair.points - np.array(points)).max()))


def _joints(kind: Any, count: int) -> tuple[Array, int]:
    errors = []
    for seed in range(count):
        hidden = Hidden([seed, 7], 3, 2, kinds=[kind])
        solution = hidden.scene.solve()
        if solution.success:
            errors.append(hidden.violation(solution.q))
    return np.array(errors), count


def _contacts(count: int) -> tuple[Array, int]:
    """Gaps of three linked wires, found again without the loop."""
    wires = linked_wires(count, grasped=False)
    errors = []
    for q, starts in zip(wires.q, wires.starts, strict=True):
        solution = wires.scene.solve(q, starts=starts)
        if solution.success:
            errors.append(max(abs(pair.gap) for pair in solution.contacts.values()) / wires.scene.packed().scale)
    return np.array(errors), count


def _clearances(count: int) -> tuple[Array, int]:
    """Crossings of linked rings by the oracle of center lines, none of them looked for by the library."""
    rings = linked_rings(count, NEAR)
    rings.drag.scene.constrain(asm.Clearance())
    errors = []
    for q, target in zip(rings.q, rings.targets, strict=True):
        rings.drag.grip.target = target
        solution = rings.drag.scene.solve(q)
        if solution.success:
            errors.append(max(0.0, -rings.drag.deepest(solution.q)))
    return np.array(errors), count


def rows(quick: bool) -> list[dict[str, Any]]:
    """A row a pair of shapes and gap, and a constraint: samples, converged, median and worst error."""
    count = 2 if quick else 200
    shapes = list(_shapes().items())
    found = []
    for i, (one, f) in enumerate(shapes):
        for other, g in shapes[i:]:
            for gap in GAPS[::2] if quick else GAPS:
                found.append((f"{one}, {other}", f"gap {gap:g}", *_pairs(f, g, gap, count)))
    makers: dict[str, Callable[[int], tuple[Array, int]]] = {
        "Contact": _contacts,
        "Clearance": _clearances,
    }
    for kind in JOINTS:
        found.append((kind.__name__, "joint", *_joints(kind, count)))
    for name, make in makers.items():
        found.append((name, "wires" if name == "Contact" else "rings near their targets", *make(min(count, 50))))
    return [
        {
            "what": what,
            "conditions": where,
            "samples": of,
            "converged": len(errors),
            "median": float(np.median(errors)) if len(errors) else float("nan"),
            "worst": float(errors.max()) if len(errors) else float("nan"),
        }
        for what, where, errors, of in found
    ]


def page(found: list[dict[str, Any]], about: str = ABOUT) -> str:
    """The table as Markdown."""
    lines = ["| what | conditions | samples | converged | median error | worst error |", "| --- " * 6 + "|"]
    for row in found:
        cells = [row[key] for key in ("what", "conditions", "samples", "converged")]
        cells += [f"{row[key]:.1e}" for key in ("median", "worst")]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n\n".join([HEADING, about, "\n".join(lines)]) + "\n"


def run(quick: bool) -> dict[str, Any]:
    """The table, and what of it has a goal."""
    found = rows(quick)
    if not quick:
        PAGE.write_text(page(found))
    pairs = [row for row in found if row["conditions"].startswith("gap")]
    others = [row for row in found if row not in pairs]
    joints = [row for row in others if row["conditions"] == "joint"]
    return {
        "about": ABOUT,
        "rows": found,
        "figures": [
            figure("pairs of shapes: worst error of those that converged", "error",
                   max(row["worst"] for row in pairs), reach=1e-10),
            figure("pairs of shapes: median of medians", "error",
                   float(np.median([row["median"] for row in pairs])), reach=1e-14),
            figure("pairs of shapes: converged to where they were placed", "count",
                   sum(row["converged"] for row in pairs), of=sum(row["samples"] for row in pairs)),
            figure("joints: worst error", "error", max(row["worst"] for row in joints), reach=1e-11),
            figure("joints: solved", "count", sum(row["converged"] for row in joints),
                   of=sum(row["samples"] for row in joints)),
            figure("contacts of wires: worst gap over the size", "error", others[-2]["worst"], reach=1e-12),
            figure(f"clearances of rings: deepest crossing (radius {WIRE:g} is that of clips)", "error",
                   others[-1]["worst"], reach=1e-9),
        ],
    }  # fmt: skip
