"""The closest features of two bodies: how many are right, what a search costs and what a tracked step costs."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes import solids
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity import FeatureStatus, FeatureTracker, closest_features, distance
from benchmarks.dense_distance import Sampled, circle_distance, least_distance
from benchmarks.figures import figure
from benchmarks.timing import measure

ABOUT = """\
Tori are judged by the distance of their circles, which has a closed form but for one angle; patches and solids by dense
samples inside their trims and on their boundaries, polished by scipy. Right is within 1e-12 of the size. Times are
medians over the pairs of one call from Python, the bodies packed; OCCT's (`BRepExtrema_DistShapeShape`) are of the same
pairs in the same run, its distances right within 1e-7. Certified distances are those of `proximity.distance`. A tracked
step moves a solid past another one by 1e-3."""

Array = NDArray[np.float64]
Faces = tuple[Face, ...]
Pair = tuple[Faces, Faces, Array]
_OCCT_RIGHT = 1e-7


def _circle(center: Array, radius: float) -> NurbsCurve:
    w = np.sqrt(0.5)
    points = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    return NurbsCurve(radius * np.array(points, float) + center, knots, 2, [1, w, 1, w, 1, w, 1, w, 1])


def random_patch(rng: np.random.Generator) -> Face:
    """A rational bicubic patch, wavy by a quarter of its extent, trimmed to a disc, by a hole, or both."""
    n, m = rng.integers(4, 8, 2)
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, n), np.linspace(-0.5, 0.5, m), indexing="ij")
    points = np.stack([x, y, rng.uniform(-0.25, 0.25, (n, m))], axis=-1) + rng.uniform(-0.03, 0.03, (n, m, 3))
    knots = [np.r_[[0.0] * 4, np.linspace(0.0, 1.0, k - 2)[1:-1], [1.0] * 4] for k in (n, m)]
    surface = NurbsSurface(points, knots, (3, 3), rng.uniform(0.6, 1.6, (n, m)))
    kind = rng.integers(3)
    if kind == 0:
        return Face(surface, _circle(rng.uniform(0.4, 0.6, 2), rng.uniform(0.2, 0.39)))
    if kind == 1:
        return Face(surface, None, [_circle(rng.uniform(0.3, 0.7, 2), rng.uniform(0.1, 0.25))])
    center = rng.uniform(0.45, 0.55, 2)
    hole = _circle(center + rng.uniform(-0.1, 0.1, 2), rng.uniform(0.05, 0.2))
    return Face(surface, _circle(center, rng.uniform(0.35, 0.44)), [hole])


def random_pose(rng: np.random.Generator, distance: float) -> Array:
    """A pose at a distance from the origin."""
    q = np.concatenate([rng.normal(size=3), rng.normal(size=4)])
    q[:3] *= distance / np.linalg.norm(q[:3])
    q[3:] /= np.linalg.norm(q[3:])
    return q


def _turn(q: Array) -> Array:
    return np.asarray(Rotation.from_quat(q[3:], scalar_first=True).as_matrix())


def _tori(count: int) -> tuple[list[Pair], list[float]]:
    rng = np.random.default_rng(21)
    pairs: list[Pair] = []
    wanted: list[float] = []
    while len(pairs) < count:
        minor = rng.uniform(0.1, 0.5, 2)
        major = minor * rng.uniform(1.3, 6.0, 2)
        q = random_pose(rng, rng.uniform(0.0, 1.2) * (major + minor).sum())
        distance = circle_distance(major[0], major[1], _turn(q), q[:3]) - minor.sum()
        if distance > 1e-6:
            f, g = (Face(shapes.torus(a, b)) for a, b in zip(major, minor, strict=True))
            pairs.append(((f,), (g,), q))
            wanted.append(distance)
    return pairs, wanted


def _apart(pairs: list[Pair], samples: int) -> tuple[list[Pair], list[float]]:
    """Those that do not cross, with their distances."""
    known: dict[int, Sampled] = {}
    kept, wanted = [], []
    for a, b, q in pairs:
        for body in (a, b):
            if id(body) not in known:
                known[id(body)] = Sampled(body, samples)
        distance = least_distance(known[id(a)], known[id(b)], _turn(q), q[:3])
        if distance > 1e-5:
            kept.append((a, b, q))
            wanted.append(distance)
    return kept, wanted


def _patches(count: int) -> list[Pair]:
    rng = np.random.default_rng(22)
    return [((random_patch(rng),), (random_patch(rng),), random_pose(rng, rng.uniform(0.4, 1.2))) for _ in range(count)]


def _solids(count: int) -> list[Pair]:
    rng = np.random.default_rng(23)
    bodies = [
        shapes.box(1.0, 1.3, 0.8),
        solids.solid_cylinder(0.5, 1.5),
        solids.plate(2.0, 1.5, 0.3, [(0.4, 0.3, 0.15), (-0.5, -0.2, 0.25)]),
        solids.plate_with_slot(2.0, 1.0, 0.3, 0.8, 0.3),
        solids.cam([1.0, 1.2, 0.8, 1.1, 0.9, 1.0], 0.4, 0.2),
    ]
    chosen = rng.integers(len(bodies), size=(count, 2))
    return [(bodies[i], bodies[j], random_pose(rng, rng.uniform(1.2, 2.5))) for i, j in chosen]


@cache
def _occt() -> Any | None:
    try:
        modules = [import_module(f"OCP.{name}") for name in ("BRepExtrema", "BRepPrimAPI", "TopLoc", "gp")]
    except ImportError:
        return None
    names: dict[str, Any] = {}
    for module in modules:
        names.update(vars(module))
    return type("Occt", (), {name: staticmethod(v) if callable(v) else v for name, v in names.items()})


def _occt_shape(faces: Faces) -> Any:
    with import_module("assembly.step.occt").quiet():
        return import_module("assembly.step.solids").sewn(faces, 1.0).shape


def _placed(o: Any, shape: Any, q: Array) -> Any:
    move = o.gp_Trsf()
    x, y, z, w, a, b, c = q.tolist()
    move.SetTransformation(o.gp_Quaternion(a, b, c, w), o.gp_Vec(x, y, z))
    return shape.Moved(o.TopLoc_Location(move))


def _occt_search(pair: Pair) -> Callable[[], float] | None:
    """OCCT's distance of a pair, or None where it is not installed."""
    o = _occt()
    if o is None:
        return None
    a, b, q = pair
    one, other = _occt_shape(a), _placed(o, _occt_shape(b), q)

    def search() -> float:
        found = o.BRepExtrema_DistShapeShape(one, other)
        return float(found.Value()) if found.IsDone() else float("nan")

    return search


def _judged(name: str, pairs: list[Pair], wanted: list[float], reach: float | None) -> list[dict[str, Any]]:
    """How many of the pairs are right, and the median time, for us and for OCCT."""
    right = 0
    times, theirs, their_right = [], [], 0
    for (a, b, q), least in zip(pairs, wanted, strict=True):
        size = sum(max(face.surface.size for face in body) for body in (a, b))
        found = closest_features(a, b, q_b=q)
        # Nearer than the dense search is right too: the points are points of the bodies.
        length = float(np.linalg.norm(found.points[1] - found.points[0]))
        off = abs(abs(found.gap) - length)
        right += int(found.status is FeatureStatus.APART and length <= least + 1e-12 * size and off < 1e-12 * size)
        times.append(measure(lambda a=a, b=b, q=q: closest_features(a, b, q_b=q), repeats=3, duration=1e-3).seconds)  # type: ignore[misc]  # defaults bind the loop's values
        search = _occt_search((a, b, q))
        if search is not None:
            their_right += int(abs(search() - min(least, length)) <= _OCCT_RIGHT * size)
            theirs.append(measure(search, repeats=2, duration=1e-3).seconds)
    peers: dict[str, float | None] = {"OCCT BRepExtrema": float(np.median(theirs)) if theirs else None}
    count: dict[str, float | None] = {"OCCT BRepExtrema": their_right if theirs else None}
    return [
        figure(f"{name}: right", "count", right, of=len(pairs), reach=len(pairs), peers=count),
        figure(f"{name}: a search", "seconds", float(np.median(times)), reach=reach, peers=peers),
        figure(f"{name}: the slowest search in twenty", "seconds", float(np.quantile(times, 0.95))),
    ]


def _certified(name: str, pairs: list[Pair], wanted: list[float]) -> list[dict[str, Any]]:
    """How many pairs have bounds within 1e-10 that hold the distance, and the median time once parts are kept."""
    right = 0
    times = []
    for (a, b, q), least in zip(pairs, wanted, strict=True):
        size = sum(max(face.surface.size for face in body) for body in (a, b))
        found = distance(a, b, poses=(None, q))
        length = float(np.linalg.norm(found.points[1] - found.points[0]))
        # Nearer than the dense search is right too: the points are points of the bodies.
        within = found.lower - 1e-12 * size <= min(least, length) and length <= found.upper + 1e-12 * size
        right += int(found.converged and within and found.upper <= least + 1e-10)
        times.append(measure(lambda a=a, b=b, q=q: distance(a, b, poses=(None, q)), repeats=3, duration=1e-3).seconds)  # type: ignore[misc]  # defaults bind the loop's values
    return [
        figure(f"{name}: certified to 1e-10", "count", right, of=len(pairs), reach=len(pairs)),
        figure(f"{name}: a certified distance, parts kept", "seconds", float(np.median(times))),
    ]


def _tracking(quick: bool) -> list[dict[str, Any]]:
    """A cylinder drawn over a plate and its rim."""
    steps = 200 if quick else 2000
    tracker = FeatureTracker(solids.plate(2.0, 1.5, 0.3), solids.solid_cylinder(0.3, 0.9))
    rows = np.zeros((steps, 7))
    rows[:, 0] = np.linspace(-1.0, 1.0, steps) * min(1.0, 5e-4 * steps)
    rows[:, 1:] = [0.1, 1.0, 0.9, 0.3, 0.1, 0.2]
    tracker.step(None, rows[0])
    place = iter(())

    def step() -> None:
        nonlocal place
        row = next(place, None)
        if row is None:
            place = iter((*rows, *rows[::-1]))
            row = rows[0]
        tracker.step(None, row)

    seconds = measure(step, repeats=5).seconds
    return [figure("a tracked step over faces and edges, one call from Python", "seconds", seconds, reach=10e-6)]


def run(quick: bool) -> dict[str, Any]:
    """Counts and times."""
    tori, exact = _tori(20 if quick else 1000)
    patches, near = _apart(_patches(8 if quick else 200), 20_000 if quick else 200_000)
    bodies, far = _apart(_solids(8 if quick else 100), 20_000 if quick else 100_000)
    figures = _judged("torus-torus", tori, exact, 1e-3)
    figures += _judged("trimmed patches", patches, near, 1e-3)
    figures += _judged("solids", bodies, far, None)
    for name, pairs, wanted in (
        ("torus-torus", tori, exact),
        ("trimmed patches", patches, near),
        ("solids", bodies, far),
    ):
        figures += _certified(name, pairs, wanted)
    return {"about": ABOUT, "figures": figures + _tracking(quick)}
