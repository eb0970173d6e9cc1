"""Mechanisms that repeat themselves, with an error in one place, as files have them; and their rows, written anew."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import assembly as asm

STEP, DEPENDENT = 1e-5, 1e-3


def _closed(links, poses, error):
    """The scene of a list of joints (kind, name, a, b), frames as (body, at, z), and the bodies' first poses."""
    bodies = {
        name: asm.Body(name, fixed=name == "ground") for name in dict.fromkeys(s[0] for l in links for s in l[2:4])
    }
    for name, (x, y, turn) in poses.items():
        bodies[name].pose = asm.Pose((x, y, 0.0), (np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)))
    scene = asm.Assembly(bodies.values())
    for k, (kind, name, a, b, *settings) in enumerate(links):
        wrong = error if k == len(links) - 1 else {}
        frames = [bodies[a[0]].frame(at=a[1], z=a[2], x=a[3]), _frame(bodies[b[0]], b, wrong)]
        scene.constrain(kind(*frames, name, **(settings[0] if settings else {})))
    return scene


def _frame(body, side, wrong):
    """A frame with an error: shifted along its own axes, or tilted about its own y."""
    z, x = (np.asarray(v, dtype=float) / np.linalg.norm(v) for v in side[2:4])
    y = np.cross(z, x)
    shift = np.asarray(wrong.get("shift", np.zeros(3)))
    tilt = wrong.get("tilt", 0.0)
    at = np.asarray(side[1], dtype=float) + shift @ np.array([x, y, z])
    # x is given, too: left to itself it may be another axis for another z.
    return body.frame(at=at, z=np.cos(tilt) * z + np.sin(tilt) * x, x=np.cos(tilt) * x - np.sin(tilt) * z)


Z, X = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


def _side(body, at, z=Z, x=X):
    return body, at, z, x


def four_bar(error, driven=True):
    drive = {"angle": 0.5} if driven else {}
    poses = {} if driven else {"crank": (0.05, 0.1, 0.5), "rod": (1.8, 1.0, -0.1), "rocker": (6.1, 0.0, 1.8)}
    return _closed(
        [
            (asm.Revolute, "drive", _side("ground", (0, 0, 0)), _side("crank", (0, 0, 0)), drive),
            (asm.Revolute, "elbow", _side("crank", (2, 0, 0)), _side("rod", (0, 0, 0))),
            (asm.Revolute, "wrist", _side("rod", (5, 0, 0)), _side("rocker", (4, 0, 0))),
            (asm.Revolute, "swing", _side("ground", (6, 0, 0)), _side("rocker", (0, 0, 0))),
        ],
        poses,
        error,
    )


def free_four_bar(error):
    return four_bar(error, driven=False)


def parallelogram(error):
    return _closed(
        [
            (asm.Revolute, "first", _side("ground", (0, 0, 0)), _side("a", (0, 0, 0)), {"angle": 0.7}),
            (asm.Revolute, "second", _side("ground", (4, 0, 0)), _side("b", (0, 0, 0))),
            (asm.Revolute, "third", _side("ground", (2, 0, 0)), _side("c", (0, 0, 0))),
            (asm.Revolute, "first top", _side("coupler", (0, 0, 0)), _side("a", (2, 0, 0))),
            (asm.Revolute, "second top", _side("coupler", (4, 0, 0)), _side("b", (2, 0, 0))),
            (asm.Revolute, "third top", _side("coupler", (2, 0, 0)), _side("c", (2, 0, 0))),
        ],
        {},
        error,
    )


def fixed_twice(error):
    return _closed(
        [
            (asm.Fixed, "once", _side("ground", (0, 0, 0)), _side("plate", (0, 0, 0))),
            (asm.Fixed, "twice", _side("ground", (1, 2, 0)), _side("plate", (1, 2, 0))),
        ],
        {"plate": (0.3, 0.2, 0.1)},
        error,
    )


def two_slides(error):
    return _closed(
        [
            (asm.Prismatic, "left", _side("ground", (0, 0, 0)), _side("table", (0, 0, 0))),
            (asm.Prismatic, "right", _side("ground", (2, 1, 0)), _side("table", (2, 1, 0))),
        ],
        {"table": (0.1, 0.2, 0.1)},
        error,
    )


def double_hinge(error):
    return _closed(
        [
            (asm.Revolute, "low", _side("ground", (0, 0, 0)), _side("door", (0, 0, 0))),
            (asm.Revolute, "high", _side("ground", (0, 0, 2)), _side("door", (0, 0, 2))),
        ],
        {"door": (0.0, 0.0, 0.4)},
        error,
    )


def bennett(error):
    long, short, alpha = 3.0, 2.0, 1.0
    beta = np.arcsin(np.sin(alpha) * short / long)
    far, near = ((0.0, -np.sin(t), np.cos(t)) for t in (alpha, beta))
    return _closed(
        [
            (asm.Revolute, "one", _side("ground", (long, 0, 0), far), _side("a", (0, 0, 0)), {"angle": 0.9}),
            (asm.Revolute, "two", _side("a", (short, 0, 0), near), _side("b", (0, 0, 0))),
            (asm.Revolute, "three", _side("b", (long, 0, 0), far), _side("c", (0, 0, 0))),
            (asm.Revolute, "four", _side("ground", (0, 0, 0)), _side("c", (short, 0, 0), near)),
        ],
        {},
        error,
    )


# What each has of freedoms.
MECHANISMS: dict[Callable, int] = {
    four_bar: 0,
    free_four_bar: 1,
    parallelogram: 0,
    fixed_twice: 0,
    two_slides: 1,
    double_hinge: 1,
    bennett: 0,
}


def _turn(quaternion):
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rows(scene, size, places, turns):
    """All rows at positions (n, 3) and rotations (n, 3, 3), lengths over a size, by the joints' definitions."""
    index = {body: k for k, body in enumerate(scene.bodies)}
    found = []
    for joint in scene.constraints:
        (i, a), (j, b) = ((index[frame.body], frame) for frame in (joint.frame_a, joint.frame_b))
        first, second = turns[i] @ a.axes, turns[j] @ b.axes
        apart = (places[j] - places[i] + turns[j] @ b.origin - turns[i] @ a.origin) / size
        found += list(apart if not isinstance(joint, asm.Prismatic) else apart @ first[:, :2])
        tilt = first[:, :2].T @ second[:, 2]
        cosine = first[:, 2] @ second[:, 2]
        sine = np.linalg.norm(tilt)
        found += list(tilt * (np.arctan2(sine, cosine) / sine if sine > 0.0 else 1.0))
        turn = np.arctan2(
            first[:, 1] @ second[:, 0] - first[:, 0] @ second[:, 1],
            first[:, 0] @ second[:, 0] + first[:, 1] @ second[:, 1],
        )
        if isinstance(joint, (asm.Fixed, asm.Prismatic)):
            found.append(turn)
        elif getattr(joint, "angle", None) is not None:
            found.append(turn - joint.angle)
    return np.array(found)


def least_squares_step(scene, size, q):
    """The step of a Newton's method toward the least sum of squared rows at poses q, twists of the bodies that move.

    Motions that the rows leave free, but for the error, are none.
    """
    moving = [k for k, body in enumerate(scene.bodies) if not body.fixed]
    places, turns = q[:, :3].copy(), np.array([_turn(row) for row in q[:, 3:]])

    def at(k, i, step):
        moved, turned = places.copy(), turns.copy()
        if i < 3:
            moved[k, i] += step * size
        else:
            axis = np.zeros((3, 3))
            j, l = (i - 2) % 3, (i - 1) % 3
            axis[j, l], axis[l, j] = -1.0, 1.0
            turned[k] = (np.eye(3) + np.sin(step) * axis + (1.0 - np.cos(step)) * axis @ axis) @ turns[k]
        return rows(scene, size, moved, turned)

    here = rows(scene, size, places, turns)
    jacobian = np.array([(at(k, i, STEP) - at(k, i, -STEP)) / (2.0 * STEP) for k in moving for i in range(6)]).T
    return here, np.linalg.lstsq(jacobian, -here, rcond=DEPENDENT)[0]


def contradiction(rng):
    """A scene two of whose constraints ask for different things, by 3e-5 of its size or more; bodies stand anywhere."""
    off = 10.0 ** rng.uniform(-4.5, 0.0)
    ground = asm.Body("ground", fixed=True)
    count = int(rng.integers(2, 5))
    bodies = [asm.Body(f"body {k}", asm.shapes.box(2, 2, 2), rng.uniform(-2, 2, 3)) for k in range(count)]
    chain = [ground, *bodies]
    f, g = (body.frame(at=rng.uniform(-2, 2, 3), z=rng.normal(size=3)) for body in chain[:2])
    value = float(rng.uniform(-1.0, 1.0))
    kind = int(rng.integers(6))
    if kind == 0:
        way = rng.normal(size=3)
        at = f.origin + 4.0 * off * way / np.linalg.norm(way)
        rows = [asm.Fixed(f, g, "one"), asm.Fixed(ground.frame(at=at, z=f.axes[:, 2], x=f.axes[:, 0]), g, "other")]
    elif kind == 1:
        lengths = rng.uniform(0.5, 2.0, count)
        ends = zip(chain[:-1], chain[1:], lengths, strict=True)
        rows = [asm.Distance(a.point(0, 0, 0), b.point(0, 0, 0), float(length)) for a, b, length in ends]
        far = float(lengths.sum() * (1.0 + off))
        rows.append(asm.Distance(ground.point(0, 0, 0), bodies[-1].point(0, 0, 0), far, "too far"))
    elif kind == 2:
        angles = rng.uniform(-1.0, 1.0, count)
        ends = zip(chain[:-1], chain[1:], angles, strict=True)
        rows = [asm.Revolute(a, b, angle=float(angle)) for a, b, angle in ends]
        rows.append(asm.Revolute(bodies[-1], ground, "last", angle=float(off - angles.sum())))
    elif kind == 3:
        ratio = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 2.0))
        first = asm.Revolute(ground, bodies[0], "first", angle=value)
        second = asm.Revolute(ground, bodies[1], "second", angle=ratio * value + off)
        rows = [first, second, asm.Gear(first, second, ratio)]
    elif kind == 4:
        rows = [asm.Prismatic(f, g, slide=value), asm.Cylindrical(f, g, slide=value + 3.0 * off)]
    else:
        rows = [asm.Spherical(f, g), asm.Revolute(f, g), asm.Angle(f, g, min(3.0 * off, 2.5))]
    scene = asm.Assembly([ground, *(body for body in bodies if any(body in row.bodies for row in rows))])
    scene.constrain(*rows)
    for body in scene.bodies[1:]:
        turn = rng.normal(size=4)
        body.pose = asm.Pose(body.pose.position, turn / np.linalg.norm(turn))
    return scene
