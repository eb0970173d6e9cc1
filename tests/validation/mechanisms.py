"""What the validations share: driving a mechanism by warm starts, and reading angles off its poses.

A solve holds every row to 2e-13 of the scene's size (`Options.tolerance`). The linkages here are away from their
singular poses, where a pose is off by a few times what its rows are: hence a CLOSE of 1e-12 of the size, and radians.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

CLOSE = 1e-12


def planar(name, at=(0.0, 0.0), angle=0.0, fixed=False):
    """A body in the plane z = 0."""
    turn = asm.Pose.from_axis_angle((0, 0, 1), angle)
    return asm.Body(name, position=(at[0], at[1], 0.0), quaternion=turn.quaternion, fixed=fixed)


def shake(bodies, amount, seed=0):
    """Move bodies a little, so that a first solve has something to do."""
    rng = np.random.default_rng(seed)
    for body in bodies:
        if not body.fixed:
            off = asm.Pose.from_axis_angle(rng.normal(size=3), amount * rng.uniform(-1, 1))
            pose = body.pose @ off
            body.pose = asm.Pose(pose.position + amount * rng.uniform(-1, 1, 3), pose.quaternion)


def drive(scene, freedom, values, solution=None):
    """A solution at every value, each started from the one before; all are solved."""
    solutions = []
    for value in values:
        freedom.value = float(value)
        solution = scene.solve(solution)
        assert solution.success, f"{freedom!r}: {solution.message}"
        solutions.append(solution)
    return solutions


def degrees(turns, step=5, start=0.0):
    """Values of a drive over whole turns [rad]."""
    return start + np.radians(np.arange(0, 360 * turns + step, step))


def poses(solutions, body):
    """Poses of a body, (n, 7)."""
    return np.array([solution.pose(body).q for solution in solutions])


def positions(solutions, body):
    return poses(solutions, body)[:, :3]


def rotations(solutions, body):
    """Rotation matrices (n, 3, 3), from their quaternions: R v = v + 2 u x (w v + u x v)."""
    w, u = poses(solutions, body)[:, 3, None, None], poses(solutions, body)[:, 4:]
    cross = np.cross(u[:, None, :], np.eye(3)).transpose(0, 2, 1)
    return np.eye(3) + 2.0 * (w * cross + cross @ cross)


def places(solutions, point):
    """World coordinates of a body's point."""
    return positions(solutions, point.body) + rotations(solutions, point.body) @ point.coordinates


def angles(solutions, joint, unwrap=True):
    """Turn of x_b from x_a about z_a, by the poses alone; continuous over the solutions."""
    a, b = (rotations(solutions, frame.body) @ frame.axes for frame in (joint.frame_a, joint.frame_b))
    x_b = b[:, :, 0]
    found = np.arctan2((a[:, :, 1] * x_b).sum(axis=1), (a[:, :, 0] * x_b).sum(axis=1))
    return np.unwrap(found) if unwrap else found


class Counter:
    """A rack that a joint's angle moves: where it stands tells the angle the solver has, and on which turn.

    Poses of the joint's own bodies tell an angle only up to whole turns.
    """

    def __init__(self, ground, joint, size=1.0, start=0.0):
        self.rack = asm.Body(f"counter of {joint.name}", position=(0, 0, size * start))
        guide = asm.Prismatic(ground, self.rack)
        self.constraints = (guide, asm.RackPinion(joint, guide, size, f"counting {joint.name}"))
        self.joint, self.size = joint, size

    def read(self, solutions):
        """The angle by the rack, and by what the solutions say of it, which is the same."""
        read = positions(solutions, self.rack)[:, 2] / self.size
        said = [solution.values[f"{self.joint.name}.angle"] for solution in solutions[::-24]]
        assert np.abs(read[::-24] - said).max() < CLOSE
        return read


def assert_came_back(first, last, size=1.0, bodies=None):
    """Poses are those of the start, quaternions with their signs: a body that turned twice has gone through -e to e.

    Of the first so many bodies, or of all.
    """
    difference = np.abs(last.q - first.q)[:bodies]
    assert difference[:, :3].max() < CLOSE * size
    assert difference[:, 3:].max() < CLOSE


def loop_of_revolutes(lengths, twists, turns):
    """A closed chain of hinges by its Denavit-Hartenberg data: link, then hinge, link, ... the first link fixed.

    Link k carries hinge k at its origin, about z, and hinge k + 1 at its length along x, about z turned by its twist
    about x. `turns` are angles of hinges 1 to n-1 at the start, that of hinge 0 closes the chain.
    """
    links, joints = [], []
    pose = asm.Pose()
    for k, (length, twist) in enumerate(zip(lengths, twists, strict=True)):
        if k > 0:
            pose = pose @ asm.Pose.from_axis_angle((0, 0, 1), turns[k - 1])
        links.append(asm.Body(f"link {k}", position=pose.position, quaternion=pose.quaternion, fixed=k == 0))
        pose = pose @ asm.Pose.from_axis_angle((1, 0, 0), twist, (length, 0, 0))
    for k in range(len(links)):
        before, after = links[k - 1], links[k]
        length, twist = lengths[k - 1], twists[k - 1]
        out = before.frame((length, 0, 0), (0, -np.sin(twist), np.cos(twist)), (1, 0, 0))
        joints.append(asm.Revolute(out, after.frame(), f"hinge {k}"))
    return links, joints
