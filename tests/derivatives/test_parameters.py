"""Numbers that are set anew: the scene has the bits of one that is built with them, and bad values raise."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.packing.scene import REFERENCE
from assembly.constraints.program.records import VERSION
from tests.derivatives.sensitivity_scenes import CASES

EACH = [(name, k) for name, case in CASES.items() for k in range(len(case().wrt))]


@pytest.mark.parametrize(("name", "k"), EACH)
def test_bits_are_those_of_a_scene_that_is_built_with_the_number(name, k):
    case, fresh = CASES[name](), CASES[name]()
    q0 = case.scene.q
    assert case.scene.solve(q0).success
    for factor in (1.01, 1.013):
        value = case.wrt[k].value * factor or 0.01 * factor
        case.wrt[k].value = value
        again = case.scene.solve(q0)
    fresh.wrt[k].value = value
    built = fresh.scene.solve(q0)
    pools = [np.delete(solution._packed.pool, VERSION) for solution in (again, built)]
    assert np.array_equal(*pools)
    assert again.status is built.status and np.array_equal(again.q, built.q)
    assert case.wrt[k].value == value


def test_a_warm_solve_after_the_first_has_the_number_of_now():
    """Solves that go on from a solution by the loop alone notice a number that was set since."""
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", position=(3, 0, 0))
    hinge = asm.Revolute(ground.frame(at=(3, 0, 0)), arm, "hinge", angle=0.3)
    scene = asm.Assembly([ground, arm])
    scene.constrain(hinge)
    place, solution = asm.Parameter(hinge.frame_a, "origin", "x"), scene.solve()
    for value in (3.1, 3.2, 2.9):
        place.value = value
        solution = scene.solve(solution)
        assert solution.pose(arm).position[0] == pytest.approx(value, abs=1e-12)


def test_the_size_may_change_with_every_frame():
    """Frames of a mechanism are placed and turned at random; lengths in the pool are those over the size of now."""

    def made():
        ground, small, large = asm.Body("ground", fixed=True), asm.Body("small"), asm.Body("large", position=(3, 0, 0))
        rack, carriage = asm.Body("rack", position=(3, 2, 0)), asm.Body("carriage", position=(6, 3, 0.5))
        wheel = asm.Body("wheel", asm.shapes.box(1.0, 0.4, 0.2))
        scene = asm.Assembly([ground, small, large, rack, carriage, wheel])
        one, two = asm.Revolute(ground, small, "one"), asm.Revolute(ground.frame(at=(3, 0, 0)), large, "two")
        x = (1, 0, 0)
        slide = asm.Prismatic(ground.frame(at=(3, 2, 0), z=x), rack.frame(z=x), "slide", limits=(-90.0, 90.0))
        gear, pinion = (
            asm.Gear(one, two, -0.5, "gear", offset=0.1),
            asm.RackPinion(two, slide, -2.0, "pinion", offset=0.2),
        )
        deck = asm.Planar(ground, carriage, "deck", offset=0.5)
        rod = asm.Distance(rack.frame((0.5, 0, 0)), carriage.frame((0, 0.2, 0)), 3.0, "rod")
        fixed = asm.Fixed(small.frame(), wheel, "fixed")
        scene.constrain(one, two, slide, gear, pinion, deck, rod, fixed)
        joints = one, two, slide, deck, rod, fixed
        frames = [frame for joint in joints for frame in (joint.frame_a, joint.frame_b)]
        fields = [("origin", "x"), ("origin", "y"), ("turn", "z")]
        return scene, [asm.Parameter(frame, *field) for frame in frames for field in fields]

    rng = np.random.default_rng(2)
    scene, numbers = made()
    scene.solve()
    sizes, set_anew = [], {}
    for _ in range(30):
        for k in rng.choice(len(numbers), 2, replace=False).tolist():
            is_place = "turn" not in numbers[k].name
            set_anew[k] = rng.normal() * (4.0 if is_place else 1e-3)
            numbers[k].value = set_anew[k]
        other, others = made()
        for k, value in set_anew.items():
            others[k].value = value
        packed, built = scene.packed(), other.packed()
        packed.refresh()
        built.refresh()
        # Neither versions, nor where the last solve began.
        told = np.concatenate([[VERSION], packed.following])
        assert len(packed.following) == 5 * REFERENCE
        assert np.array_equal(np.delete(packed.rows_pool, told), np.delete(built.rows_pool, told))
        assert packed.asked_units == built.asked_units and packed._reads == [
            (*mine[:1], *each[1:]) for mine, each in zip(packed._reads, built._reads, strict=True)
        ]
        assert [unit for *_, unit in packed._values] == [unit for *_, unit in built._values]
        assert np.array_equal(packed._standing_lengths, built._standing_lengths)
        sizes.append(packed.scale)
    assert len(set(sizes)) > 10
    assert scene.packed().number_places._rescaled.is_possible
