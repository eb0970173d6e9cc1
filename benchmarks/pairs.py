"""What an extremal pair of two surfaces costs, apart, touching and interpenetrating, and what its derivatives do."""

from __future__ import annotations

import statistics
from typing import Any

import numpy as np
from numpy.typing import NDArray

import assembly as asm
from assembly.proximity.extrema.face_face import CONVERGED, LAST_TURN
from assembly.proximity.extrema.rates import RECORD
from benchmarks.figures import figure
from benchmarks.kernels import all_derivatives, contact_jacobians, evaluate_pairs, solve_pairs
from benchmarks.peers import occt_pairs, occt_points
from benchmarks.scenes import Pairs, dome_pairs, torus_pairs
from benchmarks.timing import compare, measure

ABOUT = """\
Warm: two rational bicubic domes, started 1 percent of the patch away in every parameter; poses are part of the time.
"To the last bit" iterates until nothing moves, as `extremal_pair` does; "as in a solve" carries the frame along the
last step instead of evaluating it again. At contact: 60 pairs of different tori at strict minima of their distance,
placed at the gap and started 0.01 off in every parameter; right is within 1e-12 of where they were placed, in gap and
points (OCCT: the unsigned distance alone, within 1e-9). OCCT is called from Python."""

Array = NDArray[np.float64]
GAPS = (0.1, 1e-6, 0.0, -1e-6, -1e-4, -1e-3, -1e-2)
# Runs of every pair before the next one's turn, so that its surfaces are in the cache as they are in a solve.
TIMES = 10


class Solver:
    """The kernel on a set of pairs, from starts that are off by `offset` each way at random."""

    def __init__(self, pairs: Pairs, offset: float, close: float) -> None:
        self.pairs = pairs
        self.table, self.pool, self.records = pairs.packed()
        self.close = close
        count = len(pairs.surfaces)
        # Pairs solved by a call.
        self.count = count * TIMES
        self.sizes = np.array([min(f.size, g.size) for f, g in pairs.surfaces])
        signs = np.random.default_rng(3).choice([-1.0, 1.0], (count, 4))
        periods = np.array([[high - low for side in pair for low, high in side.domain] for pair in pairs.surfaces])
        closed = np.array([[flag for side in pair for flag in side.closed] for pair in pairs.surfaces])
        moved = pairs.parameters + offset * signs
        self.starts = np.where(closed, moved % periods, moved)
        self.parameters = np.empty((count, 4))
        self.gaps = np.empty(count)
        self.statuses = np.empty(count, np.int64)

    def __call__(self, times: int = TIMES) -> int:
        return int(
            solve_pairs(
                self.table,
                self.pool,
                self.records,
                self.pairs.q,
                self.starts,
                self.sizes,
                self.close,
                times,
                self.parameters,
                self.gaps,
                self.statuses,
            )
        )

    def right(self) -> int:
        """How many are where they were placed, to 1e-12."""
        self(1)
        points = self.pairs.points(self.parameters) - self.pairs.points(self.pairs.parameters)
        off = np.maximum(np.abs(points).max(axis=(1, 2)), np.abs(self.gaps - self.pairs.gap))
        return int(((self.statuses == CONVERGED) & (off <= 1e-12)).sum())


def _occt(solver: Solver) -> tuple[float | None, int | None]:
    """OCCT on the same pairs: the median time of one, and how many distances are right to 1e-9."""
    searches = occt_pairs(solver.pairs.surfaces, solver.pairs.q, solver.starts)
    if searches is None:
        return None, None
    seconds = [measure(search, repeats=3, duration=1e-4).seconds for search in searches]
    found = [occt_points(search()) for search in searches]
    # It knows no sign, and at a touch its points run along the surfaces while the distance is right already.
    distances = [float("nan") if pair is None else float(np.linalg.norm(pair[1] - pair[0])) for pair in found]
    right = int((np.abs(np.array(distances) - abs(solver.pairs.gap)) <= 1e-9).sum())
    return statistics.median(seconds), right


def _warm(quick: bool) -> list[dict[str, Any]]:
    count = 16 if quick else 64
    pairs = dome_pairs(count)
    exact, carried = Solver(pairs, 0.01, 0.0), Solver(pairs, 0.01, LAST_TURN)
    surface_f, surface_g = pairs.surfaces[0]
    q_f, q_g = pairs.q[0]
    occt = {"OCCT GenLocateExtSS": _occt(exact)[0]}
    rows = compare(
        {
            "exact": exact,
            "carried": carried,
            "python": lambda: asm.proximity.extremal_pair(surface_f, q_f, surface_g, q_g, exact.starts[0]),
        },
        repeats=5 if quick else 25,
    )
    seconds = {row["who"]: row["seconds"] for row in rows}
    each = {who: seconds[who] / (count * TIMES) for who in ("exact", "carried")}
    # Started at the pair itself, Newton can only polish.
    converged = Solver(pairs, 0.0, 0.0)
    iterations = {solver.close: solver(1) / count for solver in (exact, carried)}
    converged(1)
    errors = {s.close: float(np.abs(s.parameters - converged.parameters).max()) for s in (exact, carried)}
    gaps = float(np.abs(carried.gaps - converged.gaps).max())
    return [
        figure("warm, to the last bit, inside a kernel", "seconds", each["exact"], reach=0.5e-6, peers=occt),
        figure("warm, to the last bit: error in parameters", "error", errors[0.0], reach=1e-13),
        figure("warm, to the last bit: Newton steps", "ratio", iterations[0.0]),
        figure("warm, as in a solve, inside a kernel", "seconds", each["carried"], reach=0.5e-6, peers=occt),
        figure("warm, as in a solve: error in parameters", "error", errors[LAST_TURN], reach=1e-13),
        figure("warm, as in a solve: error in the gap", "error", gaps, reach=1e-13),
        figure("warm, as in a solve: Newton steps", "ratio", iterations[LAST_TURN]),
        figure("warm, one call from Python", "seconds", seconds["python"], peers=occt),
    ]


def _at_contact(quick: bool) -> list[dict[str, Any]]:
    count = 10 if quick else 60
    solvers = {gap: Solver(torus_pairs(count, gap), 0.01, 0.0) for gap in GAPS}
    theirs = {gap: _occt(solver) for gap, solver in solvers.items()}
    ours = compare({f"{gap:g}": solver for gap, solver in solvers.items()}, repeats=5 if quick else 25)
    apart = theirs[GAPS[0]][0]
    figures = []
    for gap, row in zip(GAPS, ours, strict=True):
        seconds, right = theirs[gap]
        ratio = None if seconds is None or apart is None else seconds / apart
        where, each = f"{count} torus pairs, gap {gap:g}", row["seconds"] / (count * TIMES)
        placed = solvers[gap].right()
        figures += [
            figure(f"{where}: right", "count", placed, of=count, reach=count, peers={"OCCT": right}),
            figure(f"{where}: a pair", "seconds", each, peers={"OCCT": seconds}),
        ]
        if gap != GAPS[0]:
            # 5 percent is what medians of two equal loops scatter by.
            time = f"{where}: time over that apart"
            figures.append(figure(time, "ratio", row["ratio"], reach=1.05, peers={"OCCT": ratio}))
    return figures


def _derivatives(quick: bool) -> list[dict[str, Any]]:
    count = 16 if quick else 64
    pairs = dome_pairs(count)
    table, pool, records = pairs.packed()
    size = min(surface.size for surface in pairs.surfaces[0])
    record, row = np.empty((1, RECORD)), np.empty(12)
    first, hessian = np.zeros((5, 14)), np.zeros((12, 12))
    q, x = pairs.q, pairs.parameters
    rows = compare(
        {
            "surfaces": lambda: evaluate_pairs(table, pool, records, x, TIMES),
            "jacobian": lambda: contact_jacobians(table, pool, records, q, x, size, TIMES, record, row, first),
            "all": lambda: all_derivatives(table, pool, records, q, x, size, TIMES, first, hessian),
        },
        repeats=5 if quick else 25,
    )
    each = {row["who"]: row["seconds"] / (count * TIMES) for row in rows}
    contact_jacobians(table, pool, records[-1:], q[-1:], x[-1:], size, 1, record, row, first)
    wanted = asm.proximity.contact_jacobian(pairs.surfaces[-1][0], q[-1, 0], pairs.surfaces[-1][1], q[-1, 1], x[-1])
    beyond = each["jacobian"] - each["surfaces"]
    return [
        figure("the two surface evaluations of a pair", "seconds", each["surfaces"]),
        figure("contact Jacobian (4, 14) beyond them, poses included", "seconds", beyond, reach=0.25e-6),
        figure("Jacobian, gap gradient and gap Hessian (12, 12), all in all", "seconds", each["all"]),
        figure(
            "timed Jacobian against `contact_jacobian`", "error", float(np.abs(first[:4] - wanted).max()), reach=1e-12
        ),
    ]


def run(quick: bool) -> dict[str, Any]:
    """Times a pair, errors and counts."""
    return {"about": ABOUT, "figures": _warm(quick) + _derivatives(quick) + _at_contact(quick)}
