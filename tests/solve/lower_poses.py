"""Random scenes, and lower poses beside an end that hold: by kinematics, rows and a Newton of their own.

Nothing is shared with the library but the poses it returns. Every function takes poses with leading axes, (..., n, 7),
so that derivatives are differences of one call. Scenes are chains of bodies on joints with limits, perhaps closed,
whose last body is a ball that a fixed ball or a floor touches or keeps off; and ellipsoids that stand on a floor.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

import assembly as asm

# Rows hold to this after a projection, whose steps are no longer than a radian or the size.
HOLDS, STEPS = 1e-11, 12
# Differences.
H = 1e-5
# How far neighbors are looked for; the farther ones of a way are not behind a rise.
SHARES = (3e-4, 3e-3, 3e-2, 1e-1)


def product(a, b):
    """Of quaternions."""
    a0, a1, a2, a3 = np.moveaxis(a, -1, 0)
    b0, b1, b2, b3 = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
            a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
            a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
            a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
        ],
        -1,
    )


def matrix(e):
    """The rotation of a unit quaternion."""
    w, x, y, z = np.moveaxis(e, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def moved(q, twists):
    """Poses (n, 7) after twists (..., n, 6), turns in the world's axes."""
    turn = twists[..., 3:]
    angle = np.linalg.norm(turn, axis=-1, keepdims=True)
    e = np.concatenate([np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi) * turn], -1)
    r = product(e, np.broadcast_to(q[..., 3:], e.shape))
    return np.concatenate([q[..., :3] + twists[..., :3], r / np.linalg.norm(r, axis=-1, keepdims=True)], -1)


@dataclass
class Frame:
    body: int
    origin: np.ndarray
    axes: np.ndarray

    def at(self, q):
        turn = matrix(q[..., self.body, 3:])
        return q[..., self.body, :3] + turn @ self.origin, turn @ self.axes


@dataclass
class Joint:
    """A joint by its name, with limits of its angle or its slide."""

    kind: str
    a: Frame
    b: Frame
    limits: tuple = (None, None)
    near: float = 0.0

    def equal(self, q):
        (pa, a), (pb, b) = self.a.at(q), self.b.at(q)
        apart = np.einsum("...ji,...j->...i", a, pb - pa)
        across = np.cross(a[..., 2], b[..., 2])
        swing = np.stack([(a[..., 0] * across).sum(-1), (a[..., 1] * across).sum(-1)], -1)
        if self.kind == "spherical":
            return apart
        if self.kind == "universal":
            return np.concatenate([apart, (a[..., 2] * b[..., 2]).sum(-1, keepdims=True)], -1)
        if self.kind == "revolute":
            return np.concatenate([apart, swing], -1)
        rows = [apart[..., :2], swing]
        if self.kind == "prismatic":
            rows.append((a[..., 1] * b[..., 0]).sum(-1, keepdims=True))
        return np.concatenate(rows, -1)

    def value(self, q):
        (pa, a), (pb, b) = self.a.at(q), self.b.at(q)
        if self.kind == "prismatic":
            return np.einsum("...i,...i->...", a[..., 2], pb - pa)
        value = np.arctan2((a[..., 1] * b[..., 0]).sum(-1), (a[..., 0] * b[..., 0]).sum(-1))
        return value + 2 * np.pi * np.round((self.near - value) / (2 * np.pi))

    def above(self, q):
        low, high = self.limits
        parts = [[] if low is None else [self.value(q) - low], [] if high is None else [high - self.value(q)]]
        return np.stack(sum(parts, []), -1) if sum(parts, []) else np.zeros((*q.shape[:-2], 0))


@dataclass
class Touch:
    """A gap: of two balls, or of an ellipsoid over the floor z = level (radii along its axes, a ball's are equal)."""

    body: int
    radii: np.ndarray
    other: int | None = None
    radius: float = 0.0
    level: float = 0.0
    one_sided: bool = True

    def gap(self, q):
        if self.other is not None:
            apart = np.linalg.norm(q[..., self.body, :3] - q[..., self.other, :3], axis=-1)
            return (apart - self.radii[0] - self.radius)[..., None]
        down = matrix(q[..., self.body, 3:])[..., 2, :]
        reach = np.sqrt(((self.radii * down) ** 2).sum(-1))
        return (q[..., self.body, 2] - reach - self.level)[..., None]

    def equal(self, q):
        return self.gap(q)[..., :0] if self.one_sided else self.gap(q)

    def above(self, q):
        return self.gap(q) if self.one_sided else self.gap(q)[..., :0]


@dataclass
class Model:
    """A scene as it is judged: its rows, and one term."""

    count: int
    rows: list
    body: int
    point: np.ndarray
    target: np.ndarray
    sign: float = 1.0
    turn: np.ndarray | None = None
    lever: float = 0.7
    moving: list = field(default_factory=list)

    def equal(self, q):
        return np.concatenate([row.equal(q) for row in self.rows], -1)

    def above(self, q):
        return np.concatenate([row.above(q) for row in self.rows], -1)

    def value(self, q):
        p = q[..., self.body, :3] + matrix(q[..., self.body, 3:]) @ self.point
        value = ((p - self.target) ** 2).sum(-1)
        if self.turn is not None:
            off = product(q[..., self.body, 3:], self.turn * np.array([1.0, -1.0, -1.0, -1.0]))
            value = value + self.lever**2 * 4.0 * (off[..., 1:] ** 2).sum(-1)
        return self.sign * value

    def violation(self, q):
        return max(np.abs(self.equal(q)).max(initial=0.0), -self.above(q).min(initial=0.0))

    def move(self, q, x):
        twists = np.zeros((*x.shape[:-1], self.count, 6))
        twists[..., self.moving, :] = x.reshape(*x.shape[:-1], len(self.moving), 6)
        return moved(q, twists)

    def slope(self, function, q):
        """Derivatives of values (k,) by twists, (k, 6 m)."""
        steps = H * np.eye(6 * len(self.moving))
        return np.moveaxis((function(self.move(q, steps)) - function(self.move(q, -steps))) / (2 * H), 0, -1)

    def onto_rows(self, q):
        """The nearest pose that holds, or None."""
        before = np.inf
        for _ in range(STEPS):
            above = self.above(q)
            broken = above < 0.0
            off = np.concatenate([self.equal(q), above[broken]])
            worst = np.abs(off).max(initial=0.0)
            if worst < 1e-13 or (worst < HOLDS and worst > 0.3 * before):
                return q
            slopes = np.vstack([self.slope(self.equal, q), self.slope(self.above, q)[broken]])
            x = np.linalg.lstsq(slopes, -off, rcond=1e-8)[0]
            if not np.isfinite(x).all() or np.abs(x).max(initial=0.0) > 1.0:
                return None
            q, before = self.move(q, x), worst
        return q if worst < HOLDS else None


def lowest_neighbor(model, q, rng, tries):
    """How much lower a pose beside q is that holds, at most: along curvature of its own, and along random motions."""
    q = model.onto_rows(q)
    if q is None:
        return 0.0
    value = float(model.value(q))
    slopes = model.slope(model.equal, q)
    _, sizes, right = np.linalg.svd(slopes, full_matrices=True)
    free = right[int((sizes > 1e-7 * max(sizes.max(initial=0.0), 1e-30)).sum()) :].T
    if not free.shape[1]:
        return 0.0

    def at(x):
        p = model.onto_rows(model.move(q, free @ x))
        return np.inf if p is None else float(model.value(p))

    d = free.shape[1]
    ways = list(rng.normal(size=(tries, d)))
    step, unit = 2e-3, np.eye(d)
    single = np.array([(at(step * e), at(-step * e)) for e in unit[: d if d <= 6 else 0]])
    if len(single) and np.isfinite(single).all():
        bend = np.diag(0.5 * (single.sum(axis=1) - 2.0 * value))
        for i in range(d):
            for j in range(i):
                bend[i, j] = at(step * (unit[i] + unit[j])) - single[i, 0] - single[j, 0] + value
        if np.isfinite(bend).all():
            least = np.linalg.eigh(bend + bend.T)[1][:, :2].T
            ways += [*least, *-least]
    lowest = 0.0
    for way in ways:
        for share in SHARES:
            there = at(share * way / np.linalg.norm(way))
            if there > value + 1e-12 * max(1.0, abs(value)):
                break
            lowest = max(lowest, value - there)
    return lowest


def unit_quaternion(rng):
    e = rng.normal(size=4)
    return e / np.linalg.norm(e)


AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
KINDS = {
    "revolute": asm.Revolute,
    "spherical": asm.Spherical,
    "universal": asm.Universal,
    "prismatic": asm.Prismatic,
    "cylindrical": asm.Cylindrical,
}
ROOT = np.sqrt(0.5)
LIMITS = [(0.0, None), (None, 0.0), (0.0, 1.5), (-1.5, 0.0), (-0.5, 0.5), (-1.0, 2.0)]


def frame_of(bodies, k, origin, z):
    frame = bodies[k].frame(at=origin, z=z)
    return frame, Frame(k, np.array(frame.origin), np.array(frame.axes))


def chain(rng, exact):
    """A scene and its model: links on joints; exact ones stand along x, with all that is theirs on x or in planes."""
    count = int(rng.integers(1, 5))
    planar = rng.random() < 0.5
    touches = rng.random() < 0.5
    bodies, rows, constraints, kinds = [asm.Body("ground", fixed=True)], [], [], []
    x, at = np.zeros(3), np.zeros(3)
    radius = 0.3
    for k in range(count):
        kind = "revolute" if planar else rng.choice(["revolute"] * 5 + list(KINDS)[1:])
        kind = "revolute" if count == 1 and kind == "cylindrical" else kind
        shape = asm.shapes.sphere(radius) if touches and k == count - 1 else None
        if exact:
            link = np.array([1.0 if rng.random() < 0.6 else 0.7, 0.0, 0.0])
            za = zb = AXES[0] if planar else AXES[rng.integers(2)]
            if kind == "prismatic":
                za = zb = AXES[rng.integers(3)]
            if kind == "universal":
                za, zb = AXES[0], AXES[1]
            body = asm.Body(f"link {k}", shape, position=x)
        else:
            angle = rng.uniform(0.0, 3.0)
            link = np.array([rng.uniform(0.4, 1.2), 0.0, 0.0]) if planar else 0.7 * rng.normal(size=3)
            za, zb = (AXES[0], AXES[0]) if planar else rng.normal(size=(2, 3))
            e = (np.cos(angle), 0.0, 0.0, np.sin(angle)) if planar else unit_quaternion(rng)
            body = asm.Body(f"link {k}", shape, position=x + 0.2 * rng.normal(size=3), quaternion=e)
        bodies.append(body)
        (a, own_a), (b, own_b) = frame_of(bodies, k, at, za), frame_of(bodies, k + 1, np.zeros(3), zb)
        limits = (None, None)
        if kind in ("revolute", "prismatic") and rng.random() < 0.35:
            limits = (
                LIMITS[rng.integers(6)] if exact else tuple(sorted(rng.uniform(-2.5, 2.5, 2)) + np.array([0.0, 0.2]))
            )
        settings = {"limits": limits} if kind in ("revolute", "prismatic") else {}
        constraints.append(KINDS[kind](a, b, f"joint {k}", **settings))
        rows.append(Joint(kind, own_a, own_b, limits))
        kinds.append(kind)
        x, at = x + link, link
    here = x - link
    if touches:
        add_touch(rng, exact, bodies, rows, constraints, here, radius)
    elif count >= 2 and rng.random() < 0.3:
        where = x if exact else x + 0.3 * rng.normal(size=3) * ([1, 1, 0] if planar else 1)
        (a, own_a), (b, own_b) = frame_of(bodies, 0, where, AXES[0]), frame_of(bodies, count, at, AXES[0])
        constraints.append(asm.Spherical(a, b, "closing"))
        rows.append(Joint("spherical", own_a, own_b))
    bounded = all(kind in ("revolute", "spherical", "universal") for kind in kinds)
    sign = -1.0 if bounded and rng.random() < 0.2 else 1.0
    target = 1.5 * rng.normal(size=3) * ([1, 1, 0] if planar else 1)
    if exact:
        far = rng.choice([0.0, 0.5, x[0], x[0] + 1.0, 0.3 * x[0]])
        target = np.array([rng.choice([-1.0, 1.0]) * far, 0.0, 0.0])
    return finish(rng, exact, bodies, rows, constraints, (count, at, target, sign))


def floor(level, is_solid):
    """A floor at a level: a sheet, which has two sides, or the top of a plate, which a clearance keeps bodies off."""
    if is_solid:
        return asm.Body("floor", asm.shapes.box(40.0, 40.0, 4.0), fixed=True, position=(0.0, 0.0, level - 2.0))
    return asm.Body("floor", asm.shapes.plane(40.0, 40.0), fixed=True, position=(0.0, 0.0, level))


def add_touch(rng, exact, bodies, rows, constraints, here, radius):
    """Something that the last body, a ball at `here`, touches at an exact start, or is near."""
    pick = rng.random()
    if rng.random() < 0.5:
        level = -radius if exact else -radius - rng.uniform(0.1, 0.6)
        bodies.append(floor(level, 0.4 <= pick < 0.75))
        row = Touch(len(bodies) - 2, np.full(3, radius), level=level)
    else:
        size = rng.choice([0.3, 0.8])
        away = np.array([1.0, 0.0, 0.0]) if exact else rng.normal(size=3)
        apart = radius + size + (0.0 if exact else rng.uniform(0.1, 0.6))
        place = here + apart * away / np.linalg.norm(away)
        bodies.append(asm.Body("rock", asm.shapes.sphere(size), fixed=True, position=place))
        row = Touch(len(bodies) - 2, np.full(3, radius), other=len(bodies) - 1, radius=size)
    if pick < 0.4:
        constraints.append(asm.Contact(bodies[-1], bodies[-2], "touch", unilateral=True))
    elif pick < 0.75:
        constraints.append(asm.Clearance([bodies[-1], bodies[-2]]))
    else:
        row.one_sided = False
        constraints.append(asm.Contact(bodies[-1], bodies[-2], "touch"))
    rows.append(row)


def standing(rng, exact):
    """An ellipsoid on a floor, held to it or not, drawn at one of its points; exact ones stand on an end of an axis."""
    radii = rng.choice([0.5, 0.8, 1.3], 3, replace=False)
    e = unit_quaternion(rng)
    if exact:
        e = np.array([[1, 0, 0, 0], [np.sqrt(0.5), np.sqrt(0.5), 0, 0], [np.sqrt(0.5), 0, np.sqrt(0.5), 0]])[
            rng.integers(3)
        ]
    height = np.sqrt(((radii * matrix(np.array(e))[2]) ** 2).sum())
    egg = asm.Body("egg", asm.shapes.ellipsoid(*radii), position=(0.0, 0.0, height), quaternion=e)
    one_sided = rng.random() < 0.6
    is_clearance = one_sided and rng.random() < 0.5
    bodies = [floor(0.0, is_clearance), egg]
    constraints = [asm.Clearance() if is_clearance else asm.Contact(bodies[0], egg, "touch", unilateral=one_sided)]
    rows = [Touch(1, radii, one_sided=one_sided)]
    point = np.zeros(3) if exact or rng.random() < 0.5 else 0.5 * rng.normal(size=3)
    target = np.array([0.0, 0.0, rng.choice([-2.0, -0.5, 0.0])]) if exact else 1.5 * rng.normal(size=3)
    return finish(rng, exact, bodies, rows, constraints, (1, point, target, 1.0))


def finish(rng, exact, bodies, rows, constraints, term):
    """The scene of these, and the model of it."""
    body, point, target, sign = term
    scene = asm.Assembly(bodies)
    scene.constrain(*constraints)
    moving = [k for k, other in enumerate(bodies) if not other.fixed]
    model = Model(len(bodies), rows, body, np.array(point, float), np.array(target, float), sign, moving=moving)
    if rng.random() < 0.75 or sign < 0.0:
        term = asm.PointDistance(bodies[body].point(*point), target)
    else:
        model.turn = np.eye(4)[[0, 3, 1][rng.integers(3)]] if exact else unit_quaternion(rng)
        term = asm.FrameDistance(bodies[body].frame(at=point), asm.Pose(target, model.turn), length=model.lever)
    (scene.minimize if sign > 0.0 else scene.maximize)(term)
    return scene, model


def random_scene(rng, exact):
    """One of all kinds."""
    return standing(rng, exact) if rng.random() < 0.2 else chain(rng, exact)
