"""Bodies that are pulled one way come to rest where closed forms and IPOPT say, and what holds them carries them."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import rotation_matrix
from assembly.solve.scene import Status

G = 9.81


def floor():
    return asm.Body("floor", asm.shapes.box(10.0, 10.0, 1.0), (0.0, 0.0, -0.5), fixed=True)


def turned(seed):
    row = np.random.default_rng(seed).normal(size=4)
    return row / np.linalg.norm(row)


def test_a_pendulum_hangs_and_its_joint_carries_it():
    """From any angle but the top; a hinge along y."""
    ground = asm.Body("ground", fixed=True)
    for angle in (0.1, 1.5, -2.0, 3.0):
        half = 0.5 * angle
        link = asm.Body("link", asm.shapes.box(1.0, 0.2, 0.2), (7, 8, 9), (np.cos(half), 0, np.sin(half), 0), density=3)
        scene = asm.Assembly([ground, link])
        hinge = asm.Revolute(ground.frame((7.0, 8.0, 9.0), z=(0, 1, 0)), link.frame((-0.5, 0, 0), z=(0, 1, 0)))
        scene.constrain(hinge)
        scene.minimize(asm.Weight(link, weight=G))
        solution = scene.solve()
        assert solution.success
        # Stationary to 1e-10 of the objective's scale, whose curvature is of order one.
        np.testing.assert_allclose(solution.q[1, :3], (7.0, 8.0, 8.5), rtol=0, atol=1e-8)
        assert solution.objective == pytest.approx(0.12 * G * 8.5, rel=1e-12)
        force = solution.wrenches[hinge.name]["link"].force
        np.testing.assert_allclose(force, (0.0, 0.0, 0.12 * G), rtol=0, atol=1e-7)
        assert asm.reference.solve(scene).objective == pytest.approx(solution.objective, rel=1e-8)


def test_a_density_is_set_anew():
    """A scale of equal arms tips to the heavier side, wherever it is solved from, as a new one does."""

    def made(density):
        ground, beam = asm.Body("ground", fixed=True), asm.Body("beam")
        sides = [asm.Body(name, asm.shapes.box(1.0, 1.0, 1.0)) for name in ("left", "right")]
        sides[0].density = density
        scene = asm.Assembly([ground, beam, *sides])
        scene.constrain(asm.Revolute(ground.frame(z=(0, 1, 0)), beam.frame(z=(0, 1, 0)), "tilt", limits=(-0.5, 0.5)))
        for x, side in zip((-2.0, 2.0), sides, strict=True):
            scene.constrain(asm.Fixed(beam.frame((x, 0, 0)), side))
        scene.minimize(asm.Weight(sides))
        return scene

    scene = made(2.0)
    left = scene.body("left")
    first = scene.solve()
    assert first.values["tilt.angle"] == pytest.approx(-0.5, abs=1e-9)
    left.density = 0.5
    second = scene.solve(first)
    assert left.mass == pytest.approx(0.5, rel=1e-12) and second.success
    assert second.values["tilt.angle"] == pytest.approx(0.5, abs=1e-9)
    assert second.objective == pytest.approx(2.0 * np.sin(0.5) * (0.5 - 1.0), rel=1e-9)
    new = made(0.5).solve(first.q)
    np.testing.assert_allclose(second.q, new.q, rtol=0, atol=1e-9)
    assert asm.reference.solve(scene).objective == pytest.approx(second.objective, rel=1e-8)
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(asm.errors.InputError, match="density is"):
            left.density = wrong
    assert left.density == 0.5


@pytest.mark.parametrize("seed", range(4))
def test_a_box_falls_onto_a_floor(seed):
    """It lies on one of its faces, the lowest rest there is, or stands on a higher one: flat anyway."""
    box = asm.Body("box", asm.shapes.box(1.0, 1.5, 2.0), (0.3, -0.2, 2.0), turned(seed))
    scene = asm.Assembly([floor(), box])
    scene.constrain(asm.Clearance())
    scene.minimize(asm.Weight(box))
    solution = scene.solve()
    assert solution.success and solution.proved
    height = solution.q[1, 2]
    assert min(abs(height - half) for half in (0.5, 0.75, 1.0)) < 1e-8
    up = rotation_matrix(solution.q[1, 3:])[2]
    assert np.sort(np.abs(up))[1] < 1e-7
    assert solution.objective == pytest.approx(3.0 * height, rel=1e-12)


def test_what_nothing_holds_is_unbounded():
    ball = asm.Body("ball", asm.shapes.sphere(0.5), (0.0, 0.0, 3.0))
    scene = asm.Assembly([floor(), ball])
    scene.minimize(asm.Weight(ball))
    assert scene.solve().status is Status.UNBOUNDED
    scene.constrain(asm.Clearance())
    solution = scene.solve()
    assert solution.success and solution.q[1, 2] == pytest.approx(0.5, abs=1e-9)


def test_pulled_sideways_and_upward():
    """Direction has any length; maximizing lifts."""
    stop = asm.Body("stop", asm.shapes.sphere(1.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), (-1.0, 1.3, 0.2))
    scene = asm.Assembly([stop, ball])
    scene.constrain(asm.Contact(stop, ball))
    scene.minimize(asm.Weight(ball, (0.0, 300.0, 0.0)))
    solution = scene.solve()
    np.testing.assert_allclose(solution.q[1, :3], (0.0, 1.5, 0.0), atol=1e-6)
    lifted = asm.Assembly([stop, ball])
    lifted.constrain(asm.Contact(stop, ball))
    lifted.maximize(asm.Weight(ball))
    np.testing.assert_allclose(lifted.solve().q[1, :3], (0.0, 0.0, 1.5), atol=1e-6)


def test_bad_input():
    ball, bare = asm.Body("ball", asm.shapes.sphere(1.0)), asm.Body("bare")
    with pytest.raises(TypeError, match="bodies holds 'ball'; expected Body"):
        asm.Weight(["ball"])
    with pytest.raises(TypeError, match="bodies is 3; expected a Body or several"):
        asm.Weight(3)
    with pytest.raises(InputError, match=r"bodies are \[\]; expected distinct bodies, one at least"):
        asm.Weight([])
    with pytest.raises(InputError, match="expected distinct bodies"):
        asm.Weight([ball, ball])
    with pytest.raises(InputError, match="'bare' has no shape"):
        asm.Weight(bare)
    with pytest.raises(InputError, match="direction is"):
        asm.Weight(ball, (0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="weight is"):
        asm.Weight(ball, weight=-1.0)
    with pytest.raises(InputError, match="expected a body of this assembly"):
        asm.Assembly([ball]).minimize(asm.Weight(asm.Body("other", asm.shapes.sphere(1.0))))
