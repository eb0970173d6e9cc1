"""How times grow: with the control net of a surface, with contacts, with bodies, and with facets."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import assembly as asm
from assembly.geometry.faces.face import Face
from assembly.proximity.bvh.facet_tree import FacetTree
from assembly.proximity.extrema.face_face import LAST_TURN
from benchmarks import linkages
from benchmarks.facets import CLIP_RADIUS, CLIPS, Descents, walk
from benchmarks.figures import figure
from benchmarks.pairs import Solver
from benchmarks.pictures import curve, exponent
from benchmarks.scenes import dome_pairs
from benchmarks.timing import compare

ABOUT = """\
Exponents are of the power of N that fits the medians. Nets: warm pairs of rational bicubic domes, as in a solve, so
many that their tables stay in the cache, or do not, from one percent of the patch away; two surfaces over nets of N x N
control points, and rough ones: each net has its own, whose third derivatives jump at every knot, and takes more steps
where one percent is some spans. Contacts: a chain of tori, each to touch the one before, from poses next to touching; a
step is a call over the steps it took. Bodies: cubes standing on one another, a tree of ball joints, and a square grid
of balls held at distances, moved off and solved again: of a grid even the best order of elimination leaves N log N
entries, and takes N^1.5 to find them. Facets: two paper clips, linked and touching; all pairs of patches that may hold
a contact within a quarter of the wire's radius, from call to call bodies move by a fiftieth of it. A descent goes
through as many pairs on every level where patches are smaller than what is near: time is linear in the logarithm of N
from there on, and tenfolds add as much. The first levels have fewer pairs."""

Array = NDArray[np.float64]
Times = list[tuple[float, float]]
# A step of a chain moves each body by about this part of its size.
NUDGE = 1e-3


def _times(solve: Callable[[], Any], repeats: int) -> tuple[float, float, int, bool]:
    """Medians of a call and of the kernel in it, its iterations, and whether all were solved."""
    solve()
    solutions = []
    calls = compare({"call": lambda: solutions.append(solve())}, repeats=repeats, duration=1e-4)[0]["seconds"]
    solved = all(solution.success for solution in solutions)
    return calls, statistics.median(s.seconds for s in solutions), max(1, solutions[-1].iterations), solved


def chain_of_contacts(count: int) -> asm.Assembly:
    """Tori in a row, each next to touching the one before."""
    rng = np.random.default_rng(5)
    wire = asm.shapes.torus(1.0, 0.3)
    bodies = [asm.Body("0", wire, fixed=True)]
    for k in range(1, count + 1):
        tilt = (*(0.1 * rng.normal(size=3)),)
        pose = asm.Pose.from_axis_angle((1.0, tilt[0], tilt[1]), 0.5 + tilt[2])
        bodies.append(asm.Body(str(k), wire, (2.62 * k, 0.0, 0.0), pose.quaternion))
    scene = asm.Assembly(bodies)
    scene.constrain(
        *(asm.Contact(a, b, f"touch {k}") for k, (a, b) in enumerate(zip(bodies, bodies[1:], strict=False)))
    )
    return scene


def tree(count: int) -> asm.Assembly:
    """Links on ball joints, two on each."""
    rng = np.random.default_rng(2)
    bodies = [asm.Body("0", fixed=True)]
    bodies += [asm.Body(str(k), position=2.0 * rng.normal(size=3)) for k in range(1, count)]
    scene = asm.Assembly(bodies)
    for k in range(1, count):
        end = bodies[(k - 1) // 2].point(0.5 if k % 2 else -0.5, 0.0, 0.5)
        scene.constrain(asm.Spherical(end, bodies[k].point(0.0, 0.0, -0.5), f"ball {k}"))
    return scene


def grid(count: int) -> asm.Assembly:
    """A square of about so many bodies, each held at a distance from its neighbors."""
    side = max(2, round(count**0.5))
    rng = np.random.default_rng(1)
    at = {
        (i, j): asm.Body(f"{i} {j}", None, (i, j, 0.0) + 0.02 * rng.normal(size=3), fixed=i == j == 0)
        for i in range(side)
        for j in range(side)
    }
    scene = asm.Assembly(list(at.values()))
    for (i, j), body in at.items():
        for step in ((1, 0), (0, 1)):
            other = at.get((i + step[0], j + step[1]))
            if other is not None:
                ends = body.point(0.4 * step[0], 0.4 * step[1], 0.0), other.point(-0.4 * step[0], -0.4 * step[1], 0.0)
                scene.constrain(asm.Distance(*ends, 0.2, f"{i} {j} {step}"))
    return scene


def nudged(scene: asm.Assembly) -> Callable[[], asm.Solution]:
    """Solves again from poses a little off the solution."""
    home = scene.solve()
    q = home.q.copy()
    rng = np.random.default_rng(7)
    q[1:, :3] += NUDGE * rng.normal(size=(len(q) - 1, 3))
    starts = {name: pair.parameters for name, pair in home.contacts.items()}
    return partial(scene.solve, q, starts=starts)


def _nets(quick: bool) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    sizes = (4, 8, 32) if quick else (4, 8, 16, 32, 64, 128, 200)
    few, many = sizes[0], sizes[-1]
    solvers = {n: Solver(dome_pairs(16, net=n, of=few), 0.01, LAST_TURN) for n in sizes}
    solvers |= {-n: Solver(dome_pairs(16, net=n), 0.01, LAST_TURN) for n in (few, many)}
    rows = compare({str(n): solver for n, solver in solvers.items()}, repeats=5 if quick else 25)
    seconds = {n: row["seconds"] / solvers[n].count for n, row in zip(solvers, rows, strict=True)}
    steps = {n: solver(1) / len(solver.sizes) for n, solver in solvers.items()}
    times: Times = [(n, seconds[n]) for n in sizes]
    smooth, rough = seconds[many] / seconds[few], seconds[-many] / seconds[-few]
    what = f"pairs, nets of {many}^2 over {few}^2"
    figures = [
        figure(f"{what}, the same surface", "ratio", smooth, reach=1.3),
        figure("pairs, exponent in N, the same surface", "ratio", exponent(*zip(*times, strict=True)), reach=0.1),
        figure(f"{what}, rough ones", "ratio", rough),
        figure(
            f"{what}, rough ones, a step of Newton's method", "ratio", rough * steps[-few] / steps[-many], reach=1.3
        ),
    ]
    return figures, curve("A warm pair, a surface over N x N points", "N", "seconds", {"a pair": times})


def _scenes(
    what: str, make: Callable[[int], Any], sizes: Sequence[int], repeats: int, reach: float, each: bool
) -> tuple[list[dict[str, Any]], dict[str, Times]]:
    """Figures of a series of scenes; `each`: a step's times, not the whole call's."""
    calls: Times = []
    kernels: Times = []
    solved = 0
    for n in sizes:
        call, kernel, count, done = _times(make(n), repeats)
        solved += done
        share = count if each else 1
        calls.append((n, call / share))
        kernels.append((n, kernel / share))
    last = kernels[-1][1]
    figures = [
        figure(f"{what}: sizes that are solved", "count", solved, of=len(sizes), reach=len(sizes)),
        figure(f"{what}, {sizes[-1]:,}: {'a step' if each else 'a solve'}, in the kernel", "seconds", last),
        figure(f"{what}, exponent of the kernel", "ratio", exponent(*zip(*kernels, strict=True)), reach=reach),
        figure(f"{what}, exponent of a call", "ratio", exponent(*zip(*calls, strict=True)), reach=reach),
    ]
    return figures, {what: kernels}


def _facets(quick: bool) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    sizes = (100, 1_000) if quick else (100, 1_000, 10_000, 100_000, 1_000_000)
    poses = list(walk(CLIPS, 100 if quick else 400, 0.02 * CLIP_RADIUS, 15.0))
    clip = (Face(asm.shapes.paper_clip(length=33.0, width=8.0, wire_radius=CLIP_RADIUS)),)
    descents = [Descents([tree, tree]) for tree in (FacetTree.of(clip, count=n // 2) for n in sizes)]
    reach = 0.25 * CLIP_RADIUS
    # In turns: a slow spell of the machine meets all sizes.
    looks = [
        compare(
            {f"{n}": partial(d.pairs, q, reach) for n, d in zip(sizes, descents, strict=True)}, repeats=5, duration=1e-5
        )
        for q in poses
    ]
    times: Times = [(n, statistics.median(rows[k]["seconds"] for rows in looks)) for k, n in enumerate(sizes)]
    counts = [statistics.median(d.pairs(q, reach) for q in poses) for d in descents]
    few, many = f"{sizes[0]:,}", f"{sizes[-1]:,}"
    figures = [
        figure(f"clips of {many} facets each: who is near whom", "seconds", times[-1][1]),
        figure(f"who is near whom, {many} facets over {few}", "ratio", times[-1][1] / times[0][1]),
        figure(f"who is near whom, {many} facets over {few}: pairs found", "ratio", counts[-1] / counts[0]),
    ]
    if len(sizes) > 2:
        (_, least), (_, middle), (_, most) = times[-3:]
        # One where times grow as the logarithm of N; 10^p where they grow as N^p.
        what = "who is near whom, what the last tenfold of facets adds over what the one before adds"
        figures.append(figure(what, "ratio", (most - middle) / (middle - least), reach=1.2))
    return figures, curve("Two clips of N facets: who is near whom", "N", "seconds", {"a look": times})


def run(quick: bool) -> dict[str, Any]:
    """Exponents and curves."""
    nets, net_curve = _nets(quick)
    repeats = 2 if quick else 7
    contacts, one = _scenes(
        "contacts in a chain", lambda n: nudged(chain_of_contacts(n)), (1, 4, 16) if quick else (1, 4, 16, 64, 200),
        repeats, 1.15, True,
    )  # fmt: skip
    sizes = (2, 8, 32) if quick else (2, 8, 32, 128, 500, 2_000)
    scenes: list[tuple[list[dict[str, Any]], dict[str, Times]]] = [
        _scenes("bodies, a chain of cubes", lambda n: linkages.boxes(n, 3).solve, sizes, repeats, 1.15, False),
        _scenes("bodies, a tree of links", lambda n: tree(n).solve, sizes, repeats, 1.15, False),
        _scenes("bodies, a square grid", lambda n: nudged(grid(n)), (4, *sizes[1:]), repeats, 1.15, True),
    ]
    lines = {name: line for _figures, found in scenes for name, line in found.items()}
    facets, facet_curve = _facets(quick)
    return {
        "about": ABOUT,
        "figures": [*nets, *contacts, *(row for found, _lines in scenes for row in found), *facets],
        "curves": [
            net_curve,
            curve("Contacts in a chain, a step in the kernel", "contacts", "seconds", one),
            curve("Bodies, in the kernel", "bodies", "seconds", lines),
            facet_curve,
        ],
    }
