"""Random extremal pairs, made by placing g on f: any shape, any gap, any pose, both orientations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.motion import RelativePose
from assembly.proximity.manager.extrema import Extrema
from assembly.proximity.manager.posed_pair import PosedPair
from tests.laws.witness import Pairs, Stack, rotated


def dome(rng, counts=(6, 7), degree=(3, 3)):
    """A rational cap of radii 2 to 5 over a skewed, bent and unevenly spaced net."""
    x = np.sort(np.linspace(-1.0, 1.0, counts[0]) + rng.uniform(-0.06, 0.06, counts[0]))[:, None]
    y = np.sort(np.linspace(-1.0, 1.0, counts[1]) + rng.uniform(-0.06, 0.06, counts[1]))[None, :]
    skew = rng.uniform(-0.8, 0.8)
    x, y = x + skew * y + 0.1 * y * y, y - 0.1 * x * x + 0.0 * x
    a, b = 1.0 / rng.uniform(2.0, 5.0, 2)
    z = -0.5 * (a * x * x + b * y * y) + rng.uniform(-0.004, 0.004, x.shape)
    knots = []
    for n, p in zip(counts, degree, strict=True):
        inner = np.linspace(0.0, 1.0, n - p + 1)[1:-1] + rng.uniform(-0.05, 0.05, n - p - 1)
        low, length = rng.uniform(-2.0, 2.0), rng.uniform(0.5, 4.0)
        knots.append(low + length * np.concatenate([np.zeros(p + 1), inner, np.ones(p + 1)]))
    weights = rng.uniform(0.85, 1.15, counts) if rng.random() < 0.6 else None
    return NurbsSurface(np.stack([x, y, z], 2), knots, degree, weights)


def quadratic(rng):
    """A torus or an ellipsoid."""
    if rng.random() < 0.5:
        minor = rng.uniform(0.4, 1.5)
        return shapes.torus(minor * rng.uniform(1.8, 4.0), minor)
    return shapes.ellipsoid(*rng.uniform(0.6, 2.0, 3))


def radius(surface):
    """The length the gap is measured by: a dome's radius of curvature, a tube's, an ellipsoid's smallest axis."""
    if surface.degree != (2, 2):
        return 2.0
    extent = np.ptp(surface.control_points, axis=(0, 1)) / 2.0
    return float(extent.min())


def inside(rng, surface):
    """Parameters in the middle of a span, so that differences do not step over a knot; off the poles."""
    out = []
    for k in range(2):
        at = surface.breaks()[k]
        # The middle spans of a dome: its edge is nearly flat to nothing.
        i = rng.integers(1, at.size - 2) if at.size > 3 and surface.degree != (2, 2) else rng.integers(at.size - 1)
        out.append(at[i] + rng.uniform(0.25, 0.75) * (at[i + 1] - at[i]))
    return out


def random_quaternion(rng):
    e = rng.normal(size=4)
    return e / np.linalg.norm(e) * (1.0 if rng.random() < 0.5 else rng.uniform(0.3, 3.0))


def quaternion_of(matrix):
    """Unit quaternion of a rotation matrix: the eigenvector of Bar-Itzhack's matrix."""
    m = matrix
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] - m[1, 2]],
            [0, m[1, 1] - m[0, 0] - m[2, 2], m[2, 1] + m[1, 2], m[0, 2] - m[2, 0]],
            [0, 0, m[2, 2] - m[0, 0] - m[1, 1], m[1, 0] - m[0, 1]],
            [0, 0, 0, np.trace(m)],
        ]
    )
    x, y, z, w = np.linalg.eigh(k, UPLO="U")[1][:, -1]
    return np.array([w, x, y, z])


def frame_at(face, u, v):
    """Point and axes (tangent, second tangent, outward normal as columns) in body axes."""
    p, su, sv = face.surface.evaluate(u, v, 1)
    n = face.sign * np.cross(su, sv)
    n /= np.linalg.norm(n)
    t = su / np.linalg.norm(su)
    return p, np.stack([t, np.cross(n, t), n], 1)


def placed(face_f, uv_f, q_f, face_g, uv_g, gap, spin, same_side=False):
    """The pose of g that makes (uv_f, uv_g) an extremal pair with this gap, normals opposed or (same_side) equal."""
    p, a = frame_at(face_f, *uv_f)
    r, b = frame_at(face_g, *uv_g)
    c, s = np.cos(spin), np.sin(spin)
    turn = np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]])
    if same_side:
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    world = np.stack([rotated(q_f[None], column[None])[0] for column in a.T], 1)
    matrix = world @ turn @ b.T
    at = rotated(q_f[None], p[None])[0] + q_f[:3] + gap * world[:, 2]
    return np.concatenate([at - matrix @ r, quaternion_of(matrix)])


@dataclass(frozen=True)
class Group:
    """Pairs whose surfaces have the same degrees: the faces, poses (rows, 14), parameters (rows, 4) and gaps."""

    f: list[Face]
    g: list[Face]
    q: np.ndarray
    x: np.ndarray
    gap: np.ndarray
    pairs: Pairs

    def speeds(self):
        """|f_u|, |f_v|, |g_u|, |g_v|: lengths a unit of parameter, (rows, 4)."""
        parts = self.pairs.frames(self.x, self.q)
        return np.stack([np.linalg.norm(parts[k], axis=1) for k in (1, 2, 4, 5)], 1)

    def take(self, rows):
        return Group(
            [self.f[i] for i in rows],
            [self.g[i] for i in rows],
            self.q[rows],
            self.x[rows],
            self.gap[rows],
            self.pairs.take(rows),
        )

    def arguments(self, i):
        return self.f[i], self.q[i, :7], self.g[i], self.q[i, 7:]


def random_gap(rng, length):
    kind = rng.random()
    if kind < 0.15:
        return 0.0
    if kind < 0.25:
        return float(rng.choice([-1e-6, 1e-6, -1e-3, 1e-3])) * length
    return rng.uniform(-0.3, 3.0) * length


def random_group(seed, kind_f, kind_g, count):
    """Pairs of two kinds of shapes that are well away from singular (paper 001 bounds nothing near those)."""
    rng = np.random.default_rng(seed)
    makers = {"dome": dome, "high": lambda r: dome(r, (7, 8), (4, 5)), "quadratic": quadratic}
    pool = {kind: [makers[kind](rng) for _ in range(12)] for kind in {kind_f, kind_g}}
    faces = {kind: [Face(s, reversed=r) for s in pool[kind] for r in (False, True)] for kind in pool}
    many = 2 * count
    f = [faces[kind_f][rng.integers(24)] for _ in range(many)]
    g = [faces[kind_g][rng.integers(24)] for _ in range(many)]
    q, x, gap = np.empty((many, 14)), np.empty((many, 4)), np.empty(many)
    for i in range(many):
        x[i] = inside(rng, f[i].surface) + inside(rng, g[i].surface)
        gap[i] = random_gap(rng, min(radius(f[i].surface), radius(g[i].surface)))
        q[i, :7] = np.concatenate([rng.uniform(-3.0, 3.0, 3), random_quaternion(rng)])
        q[i, 7:] = placed(
            f[i], x[i, :2], q[i, :7], g[i], x[i, 2:], gap[i], rng.uniform(0.0, 6.3), same_side=rng.random() < 0.25
        )
        q[i, 10:] *= np.linalg.norm(random_quaternion(rng))
    stacks = [Stack([face.surface for face in side], [face.sign for face in side]) for side in (f, g)]
    group = Group(f, g, q, x, gap, Pairs(*stacks))
    rates = group.pairs.jacobian(x, q) * group.speeds()[:, :, None]
    # Rates of points over their surfaces for unit velocities: they grow without bound toward singular pairs.
    tame = np.flatnonzero(np.abs(rates).max(axis=(1, 2)) < 30.0)
    assert tame.size >= count, f"{tame.size} of {many} random pairs are away from singular ones"
    return group.take(tame[:count])


def posed(store, turn, shift, surfaces=(-1, -1), shells=(-1, -1), trees=(-1, -1)):
    """A posed pair of bodies, of which kernels read no more than the pose and the shapes."""
    pose = RelativePose(turn, shift)
    return PosedPair(
        store, pose, surfaces, shells, trees, (-1, -1), (0.0, 0.0), bodies=(0, 1), poses=None, track_solids=0
    )


def list_of(rows, count):
    """Rows of extrema as a list of the first `count`."""
    return Extrema(rows, np.array([count]), None, None)
