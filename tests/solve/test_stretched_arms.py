"""Arms that hold at one pose only, stretched: no forces balance a load across them, and yet they are solutions."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm


def stretched(rng, closing):
    """A scene of a straight arm along x that just reaches, with a lever that turns about its tip; and the least value.

    What the lever is drawn by pulls across the arm, which cannot give way: it would have to be longer.
    """
    count = int(rng.integers(2, 6))
    lengths, apart, lever = rng.uniform(0.5, 1.5, count), rng.uniform(0.5, 1.5), rng.uniform(0.3, 1.5)
    is_spatial = rng.random() < 0.5
    ground = asm.Body("ground", fixed=True)
    bodies, joints = [ground], []
    before = ground.frame()
    for k in range(count):
        link = asm.Body(f"link {k}", position=(lengths[:k].sum(), 0.0, 0.0))
        z = (0.0, 1.0, 0.0) if is_spatial and k % 2 else (0.0, 0.0, 1.0)
        before = bodies[-1].frame(at=(lengths[k - 1] if k else 0.0, 0.0, 0.0), z=z)
        joints.append(asm.Revolute(before, link.frame(z=z), f"joint {k}"))
        bodies.append(link)
    reach = lengths.sum()
    angle = rng.uniform(-np.pi, np.pi)
    turn = (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle))
    shape = None if closing == "distance" else asm.shapes.sphere(0.4 * apart)
    bodies.append(asm.Body("lever", shape, position=(reach, 0.0, 0.0), quaternion=turn))
    joints.append(asm.Revolute(bodies[-2].frame(at=(lengths[-1], 0.0, 0.0)), bodies[-1].frame(), "tip"))
    center = (reach + apart, 0.0, 0.0)
    if closing == "distance":
        joints.append(asm.Distance(ground.frame(at=center), bodies[-1].frame(), apart, "closing"))
    else:
        bodies.append(asm.Body("rock", asm.shapes.sphere(0.6 * apart), fixed=True, position=center))
        joints.append(asm.Contact(bodies[-1], bodies[-2], "closing"))
    target = np.append(center[:2] + rng.uniform(-2.0, 2.0, 2), rng.uniform(-0.5, 0.5))
    scene = asm.Assembly(bodies)
    scene.constrain(*joints)
    lever_body = next(body for body in bodies if body.name == "lever")
    scene.minimize(asm.PointDistance(lever_body.point(lever, 0.0, 0.0), target))
    across = np.hypot(target[0] - reach, target[1])
    return scene, lever_body, (across - lever) ** 2 + target[2] ** 2


@pytest.mark.parametrize("closing", ["distance", "contact"])
def test_a_lever_on_an_arm_that_just_reaches_turns_to_its_target(closing, cases):
    for k in range(cases(12, 300)):
        scene, lever, best = stretched(np.random.default_rng([k, closing == "contact"]), closing)
        solution = scene.solve()
        assert solution.success, (k, solution.status)
        # Rows that are off by 1e-12 of the size let the arm bend by 1e-6, across which the lever pulls.
        reach = scene.packed().scale
        assert solution.objective == pytest.approx(best, abs=1e-5 * reach**2), k
        assert solution.pose(lever).position == pytest.approx(lever.pose.position, abs=1e-5 * reach), k
        again = scene.solve(solution)
        assert again.success and again.objective == pytest.approx(best, abs=1e-5 * reach**2), k
