"""Each mate in all that a scene is for: a hand that moves, mobility, files, copies, another solver."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.constraint import RowConstraint
from assembly.constraints.model.contact import Contact
from assembly.solve.measure import JointRow
from tests.laws.mate_scenes import MATES, scene_of, unit

every_mate = pytest.mark.parametrize("name", MATES)
GRIP = (0.7, 0.3, 0.9)


def residual(scene, solution):
    """The largest violation of all rows by their definitions, and of contacts by their pairs."""
    places, q, worst = {id(body): k for k, body in enumerate(scene.bodies)}, np.array(solution.q), 0.0
    for item in scene.constraints:
        if isinstance(item, Contact):
            gap = solution.contacts[item.name].gap
            worst = max(worst, -gap if item.unilateral else abs(gap))
        assert isinstance(item, (Contact, RowConstraint))
        for equation in getattr(item, "equations", ()):
            at = tuple(
                (places[id(part.frames.frame_a.body)], places[id(part.frames.frame_b.body)])
                for _, part in equation.terms
            )
            # No mate here counts turns.
            found = JointRow(equation, at, 1.0).residual(q, {})
            worst = max(worst, -found if equation.one_sided else abs(found))
    return worst


@every_mate
@pytest.mark.parametrize("grip", ["point", "frame"])
@pytest.mark.parametrize("iterations", [2, 30])
def test_rows_hold_at_every_tick_of_a_hand(name, grip, iterations):
    scene, held = scene_of(name)
    size = scene.packed().scale
    tracker = scene.tracker(held.point(*GRIP) if grip == "point" else held.frame(GRIP), iterations=iterations)
    start, steps = held.pose.apply(np.array(GRIP)), []
    for t in np.append(np.linspace(0, 4, 80), np.full(40, 4.0)):
        place = start + np.array([2 * np.sin(t), 1.5 * np.sin(1.3 * t), 1.2 * np.sin(0.7 * t)])
        half = 0.4 * np.sin(t)
        turn = unit(np.cos(half), *(np.sin(half) * unit(0.3, 0.5, 0.8)))
        steps.append(tracker.step(place if grip == "point" else asm.Pose(place, turn)))
        # Ticks hold to 1.25e-12 of the size and of how far the hand is, and the definitions to their own rounding.
        assert residual(scene, steps[-1].solution) < 2e-12 * size
    # Two steps a tick are on their way for long where a mate does not let the hand go where it is.
    assert {step.status.name for step in steps} <= {"FOLLOWED", "APPROACHING"}
    assert iterations == 2 or steps[-1].status.name == "FOLLOWED"
    nearest = [item.name for item in scene.constraints if getattr(item, "asked_axes", "") == "nearest"]
    assert list(steps[-1].solution.axes) == nearest and len({str(step.solution.axes) for step in steps}) == 1


@every_mate
def test_what_is_left_free(name):
    scene, _ = scene_of(name)
    mobility = scene.mobility(scene.solve())
    assert mobility.dof == MATES[name][1] and mobility.redundant == []


@every_mate
def test_scenes_come_back_from_files_and_pickles(name, tmp_path):
    bodies, constraints, _ = MATES[name][0]()
    scene = asm.Assembly(bodies)
    scene.constrain(*constraints)
    scene.save(tmp_path / "scene.json")
    first = scene.solve()
    for again in (asm.load(tmp_path / "scene.json"), pickle.loads(pickle.dumps(scene))):
        assert list(map(repr, again.constraints)) == list(map(repr, scene.constraints))
        assert (again.solve().q == first.q).all() and again.solve().axes == first.axes


@every_mate
def test_another_solver_agrees(name):
    scene, held = scene_of(name)
    rng = np.random.default_rng(5)
    target = asm.Pose(held.pose.position + 0.5 * rng.normal(size=3), unit(*(held.pose.quaternion + 0.1)))
    scene.minimize(asm.FrameDistance(held.frame(), target), asm.Posture(scene.q, weight=0.1))
    first = scene.solve()
    second = asm.reference.solve(scene)
    assert first.success and second.success and abs(first.q - second.q).max() < 1e-6
