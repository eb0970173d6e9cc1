"""What the benchmarks work on: surfaces, pairs placed at a given gap, and linked torus wires. All from fixed seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.constraints.model.objectives import PointDistance
from assembly.geometry.splines.bezier import insert
from assembly.geometry.splines.evaluate import BREAKS_U, BREAKS_V, CELLS, COEFFICIENTS

__all__ = [
    "Pairs",
    "Wires",
    "bicubic",
    "crossing",
    "dome_pairs",
    "linked",
    "linked_wires",
    "placed",
    "random_pose",
    "torus_pairs",
]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
MAJOR, MINOR = 1.0, 0.12
# Apart at the start by at least this.
CLEARANCE = 0.005


def bicubic(seed: int, flip: float = 1.0, net: int = 8) -> asm.NurbsSurface:
    """A rational bicubic dome over a net of `net`^2 points on [-1, 1]^2, with radii of curvature near one."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(*2 * [np.linspace(-1.0, 1.0, net)], indexing="ij")
    # Second differences of the net are what curvature is made of.
    rough = (8.0 / max(net, 8)) ** 2
    z = flip * (-0.5 * (x**2 + 0.8 * y**2) + 0.005 * rough * rng.standard_normal(x.shape))
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, net - 2), np.ones(3)])
    weights = 1.0 + rough * rng.uniform(-0.05, 0.05, x.shape)
    return asm.NurbsSurface(np.stack([x, y, z], 2), (knots, knots), (3, 3), weights)


def refined(surface: asm.NurbsSurface, net: int) -> asm.NurbsSurface:
    """The same surface over a net of `net`^2 points: knots are put in at even distances."""
    points = np.concatenate([surface.control_points * surface.weights[..., None], surface.weights[..., None]], axis=2)
    knots = []
    for axis in range(2):
        points, along = np.moveaxis(points, axis, 0), surface.knots[axis]
        more = net - len(points) + 1
        for k in range(1, more):
            points, along = insert(points, along, surface.degree[axis], k / more, 1)
        points = np.moveaxis(points, 0, axis)
        knots.append(along)
    return asm.NurbsSurface(points[..., :3] / points[..., 3:], knots, surface.degree, points[..., 3])


@dataclass(frozen=True)
class Pairs:
    """Extremal pairs whose parameters, points and gaps are known, because g was placed on f."""

    surfaces: list[tuple[asm.NurbsSurface, asm.NurbsSurface]]
    q: Array  # (n, 2, 7)
    parameters: Array  # (n, 4)
    gap: float

    def packed(self) -> tuple[Table, Array, Table]:
        """All surfaces as one table and one pool; the (n, 2) places of their records."""
        tables: list[Table] = []
        pools: list[Array] = []
        places: dict[asm.NurbsSurface, int] = {}
        length = size = 0
        for pair in self.surfaces:
            for surface in pair:
                if surface not in places:
                    table, pool = surface.packed()
                    table = table.copy()
                    table[[BREAKS_U, BREAKS_V, COEFFICIENTS, CELLS]] += size
                    places[surface] = length
                    tables.append(table)
                    pools.append(pool)
                    length, size = length + table.size, size + pool.size
        records = np.array([[places[surface] for surface in pair] for pair in self.surfaces])
        return np.concatenate(tables), np.concatenate(pools), records

    def points(self, parameters: Array) -> Array:
        """World points (n, 2, 3) of all pairs at parameters (n, 4)."""
        out = np.empty((len(self.surfaces), 2, 3))
        for i, pair in enumerate(self.surfaces):
            for k, surface in enumerate(pair):
                point = surface.evaluate(*parameters[i, 2 * k : 2 * k + 2])
                out[i, k] = Rotation.from_quat(self.q[i, k, 3:], scalar_first=True).apply(point) + self.q[i, k, :3]
        return out


def _frame(surface: asm.NurbsSurface, u: float, v: float) -> tuple[Array, Array]:
    """The point, and tangent, second tangent and outward normal as columns."""
    point, su, _ = surface.evaluate(u, v, 1)
    normal, tangent = surface.normal(u, v), su / np.linalg.norm(su)
    return point, np.column_stack([tangent, np.cross(normal, tangent), normal])


def placed(f: asm.NurbsSurface, g: asm.NurbsSurface, x: Array, q_f: Array, gap: float, spin: float) -> Array:
    """The pose of g at which x are the parameters of an extremal pair with this gap, normals opposed."""
    p, a = _frame(f, x[0], x[1])
    r, b = _frame(g, x[2], x[3])
    c, s = np.cos(spin), np.sin(spin)
    turn_f = Rotation.from_quat(q_f[3:], scalar_first=True)
    world = turn_f.as_matrix() @ a
    turn = Rotation.from_matrix(world @ np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]]) @ b.T)
    position = turn_f.apply(p) + q_f[:3] + gap * world[:, 2] - turn.apply(r)
    return np.concatenate([position, turn.as_quat(scalar_first=True)])


def random_pose(rng: np.random.Generator) -> Array:
    e = rng.normal(size=4)
    return np.concatenate([rng.uniform(-1.0, 1.0, 3), e / np.linalg.norm(e)])


def dome_pairs(count: int, seed: int = 1, net: int = 8, of: int | None = None) -> Pairs:
    """Pairs of two bicubic domes at gap 0.1, well inside both patches; `of` another net, refined, if that is given."""
    rng = np.random.default_rng(seed)
    f, g = (bicubic(k, net=of or net) for k in (2, 3))
    if of is not None:
        f, g = refined(f, net), refined(g, net)
    q, parameters = np.empty((count, 2, 7)), rng.uniform(0.25, 0.75, (count, 4))
    for i in range(count):
        q[i, 0] = random_pose(rng)
        q[i, 1] = placed(f, g, parameters[i], q[i, 0], 0.1, rng.uniform(0.0, 2.0 * np.pi))
    return Pairs([(f, g)] * count, q, parameters, 0.1)


def torus_pairs(count: int, gap: float, seed: int = 2) -> Pairs:
    """Pairs of different tori at strict minima of their distance; the same ones for every gap."""
    rng = np.random.default_rng(seed)
    surfaces: list[tuple[asm.NurbsSurface, asm.NurbsSurface]] = []
    q, parameters = np.empty((count, 2, 7)), np.empty((count, 4))
    while len(surfaces) < count:
        minor = rng.uniform(0.2, 0.6, 2)
        major = minor * rng.uniform(1.8, 4.0, 2)
        f, g = (asm.shapes.torus(*radii) for radii in zip(major, minor, strict=True))
        # Within one of the four arcs each way: where two meet, second derivatives jump and differences mean nothing.
        turns = 0.25 * (rng.integers(4, size=4) + rng.uniform(0.1, 0.9, 4))
        x = 2.0 * np.pi * turns * np.column_stack([major, minor]).ravel()
        spin, pose = rng.uniform(0.0, np.pi), random_pose(rng)
        forms = []
        for k, surface in enumerate((f, g)):
            point = surface.evaluate(x[2 * k], x[2 * k + 1])
            radius = np.hypot(point[0], point[1])
            # Curvatures along the parallel, which is the frame's tangent, and around the tube.
            forms.append(np.diag([(radius - major[k]) / (minor[k] * radius), 1.0 / minor[k]]))
        c, s = np.cos(spin), np.sin(spin)
        turn = np.array([[c, s], [s, -c]])
        if np.linalg.eigvalsh(forms[0] + turn @ forms[1] @ turn.T)[0] < 0.3:
            continue
        i = len(surfaces)
        parameters[i], q[i, 0] = x, pose
        q[i, 1] = placed(f, g, x, pose, gap, spin)
        surfaces.append((f, g))
    return Pairs(surfaces, q, parameters, gap)


def linked(a: Array, b: Array, radius: float = MAJOR) -> bool:
    """Whether two circles of one radius, in the planes z = 0 of poses a and b, are linked.

    They are where b passes through the disk of a an odd number of times, that is once: its height over the plane of a
    is h + m cos(t - t0), with two zeros or none.
    """
    turns = [Rotation.from_quat(pose[3:], scalar_first=True) for pose in (a, b)]
    height = (turns[0].inv() * turns[1]).as_matrix()[2]
    center = turns[0].inv().apply(b[:3] - a[:3])
    m = radius * np.hypot(height[0], height[1])
    if abs(center[2]) >= m:
        return False
    t = np.arctan2(height[1], height[0]) + np.arccos(-center[2] / m) * np.array([1.0, -1.0])
    circle = radius * np.column_stack([np.cos(t), np.sin(t), np.zeros(2)])
    places = turns[0].inv().apply(turns[1].apply(circle) + b[:3] - a[:3])
    return int((np.hypot(places[:, 0], places[:, 1]) < radius).sum()) == 1


def _circle(pose: Array, samples: int) -> Array:
    t = np.linspace(0.0, 2.0 * np.pi, samples, endpoint=False)
    circle = MAJOR * np.column_stack([np.cos(t), np.sin(t), np.zeros(samples)])
    return np.asarray(Rotation.from_quat(pose[3:], scalar_first=True).apply(circle) + pose[:3])


def _distance(a: Array, b: Array, samples: int = 400) -> float:
    """Between center lines, from samples: too large by 3e-4 at most where wires touch."""
    p, r = _circle(a, samples), _circle(b, samples)
    return float(np.linalg.norm(p[:, None] - r[None, :], axis=2).min())


def crossing(q: Array) -> bool:
    """Whether two wires are in one another somewhere, by more than the samples can err."""
    pairs = ((0, 1), (1, 2), (0, 2))
    return any(_distance(q[i], q[j]) < 2.0 * MINOR - CLEARANCE for i, j in pairs)


@dataclass(frozen=True)
class Wires:
    """Three torus wires, each linked with both others; the first one is fixed, the last one has a grasp point.

    `q` (n, 3, 7) are starts: random poses, linked, no wire in another. `grasp` (n, 3) is where the point starts.
    """

    scene: asm.Assembly
    objective: PointDistance | None
    q: Array
    grasp: Array
    starts: list[dict[str, Array]]

    def targets(self, distance: float, seed: int = 7) -> Array:
        """Targets that far from the grasp point: any way, but outward when the length of the chain is less."""
        way = np.random.default_rng(seed).normal(size=self.grasp.shape)
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        inward = (way * self.grasp).sum(axis=1, keepdims=True) < 0.0
        if distance >= 3.0:
            # A circle that passes through the first one's disk has no point 3 radii from its center.
            way = np.where(inward, -way, way)
        return self.grasp + distance * way


def linked_wires(count: int, grasped: bool = True, seed: int = 5) -> Wires:
    """`count` starts of the scene of three wires; without a grasp point, the objective is the least move."""
    rng = np.random.default_rng(seed)
    torus = asm.shapes.torus(MAJOR, MINOR)
    bodies = [asm.Body(name, torus, fixed=name == "first") for name in ("first", "second", "third")]
    scene = asm.Assembly(bodies)
    contacts = [asm.Contact(bodies[i], bodies[j]) for i, j in ((0, 1), (1, 2), (0, 2))]
    scene.constrain(*contacts)
    at = np.array([MAJOR, 0.0, 0.0])
    objective = asm.PointDistance(bodies[2].point(*at), at) if grasped else None
    if objective is not None:
        scene.minimize(objective)
    q = np.empty((count, 3, 7))
    for k in range(count):
        q[k, 0] = bodies[0].q
        q[k, 1] = _linked_pose(rng, q[k, :1])
        q[k, 2] = _linked_pose(rng, q[k, :2])
    turns = Rotation.from_quat(q[:, 2, 3:], scalar_first=True)
    starts = [_starts(contacts, [q[k, 0], q[k, 1], q[k, 2]], bodies) for k in range(count)]
    return Wires(scene, objective, q, turns.apply(at) + q[:, 2, :3], starts)


def _linked_pose(rng: np.random.Generator, others: Array) -> Array:
    """A random pose linked with all others and clear of them."""
    while True:
        e = rng.normal(size=4)
        pose = np.concatenate([rng.uniform(-1.6, 1.6, 3), e / np.linalg.norm(e)])
        if all(linked(other, pose) for other in others) and all(
            _distance(other, pose) > 2.0 * MINOR + CLEARANCE for other in others
        ):
            return pose


def _starts(contacts: Sequence[asm.Contact], q: Sequence[Array], bodies: Sequence[asm.Body]) -> dict[str, Array]:
    """Parameters of the nearest pair of every contact."""
    found = {}
    for contact in contacts:
        a, b = contact.bodies
        pose_a, pose_b = (q[bodies.index(body)] for body in (a, b))
        found[contact.name] = asm.proximity.extremal_pair(a.face(), pose_a, b.face(), pose_b).parameters
    return found
