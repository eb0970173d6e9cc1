"""What a point of a rational bicubic surface costs, with all derivatives to order two."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.figures import figure
from benchmarks.kernels import lanes_along, points_along
from benchmarks.peers import homogeneous_spline, occt_evaluator
from benchmarks.scenes import bicubic
from benchmarks.timing import compare

ABOUT = """\
One surface of 8 x 8 control points. "Inside a kernel" is a loop along a closed path through most of its spans, where
all six vectors are added up; scipy evaluates the homogeneous numerator, the weight and their derivatives and leaves
out the quotient rule."""


def run(quick: bool) -> dict[str, Any]:
    """Times a point."""
    surface = bicubic(1)
    table, pool = surface.packed()
    t = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    u, v = 0.5 + 0.45 * np.cos(t), 0.5 + 0.45 * np.sin(2.0 * t)
    many = np.random.default_rng(0).uniform(0.0, 1.0, (10_000, 2))
    spline = homogeneous_spline(surface)
    repeats = 5 if quick else 25
    inside = compare(
        {"lanes": lambda: lanes_along(table, pool, u, v), "tuples": lambda: points_along(table, pool, u, v)},
        repeats=repeats,
    )
    called = compare(
        {
            "batch": lambda: surface.evaluate(many[:, 0], many[:, 1], 2),
            "scipy": lambda: spline(many),
        },
        repeats=repeats,
    )
    single = compare(
        {"ours": lambda: surface.evaluate(0.3, 0.6, 2), "occt": occt_evaluator(surface, 0.3, 0.6)}, repeats=repeats
    )
    seconds = {row["who"]: row["seconds"] for row in inside + called + single if "seconds" in row}
    a, au, av, auu, auv, avv = spline(many)
    # The quotient rule, so that the two can be compared.
    points = [a[:, :3] / a[:, 3:]]
    points += [(rate[:, :3] - rate[:, 3:] * points[0]) / a[:, 3:] for rate in (au, av)]
    for rate, first, second in ((auu, 0, 0), (auv, 0, 1), (avv, 1, 1)):
        low, high = (au, av)[first], (au, av)[second]
        mixed = low[:, 3:] * points[1 + second] + high[:, 3:] * points[1 + first] + rate[:, 3:] * points[0]
        points.append((rate[:, :3] - mixed) / a[:, 3:])
    deviation = max(
        float(np.abs(ours - theirs).max() / np.abs(theirs).max())
        for ours, theirs in zip(surface.evaluate(many[:, 0], many[:, 1], 2), points, strict=True)
    )
    figures = [
        figure("inside a kernel, as four-lane values", "seconds", seconds["lanes"] / t.size, reach=40e-9),
        figure("inside a kernel, as 3-tuples", "seconds", seconds["tuples"] / t.size, reach=40e-9),
        figure(
            "10,000 points in one call from Python, a point",
            "seconds",
            seconds["batch"] / len(many),
            reach=0.08e-6,
            peers={"scipy NdBSpline": seconds["scipy"] / len(many)},
        ),
        figure("one point in one call from Python", "seconds", seconds["ours"], peers={"OCCT D2": seconds.get("occt")}),
        figure("largest deviation from scipy, over the largest value", "error", deviation, reach=1e-12),
    ]
    return {"about": ABOUT, "figures": figures}
