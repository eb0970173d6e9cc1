"""Near contacts that find no place among those of a clearance: the solve ends at once and begins again with more."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly import solving as module


def pair(slots, lift=0.0):
    holes = [(x, y, 2.0) for x in (-15.0, -5.0, 5.0, 15.0) for y in (-8.0, 8.0)]
    others = [(x, y, 2.0) for x in (-10.0, 0.0, 10.0) for y in (0.0,)]
    a = asm.Body("a", asm.shapes.plate(40, 30, 5, holes), fixed=True)
    b = asm.Body("b", asm.shapes.plate(40, 30, 5, others), (1.0, 0.5, 5.0 + lift))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Clearance(slots=slots))
    return scene, b


@pytest.fixture
def attempts(monkeypatch):
    """How many steps each attempt of the loop made."""
    made, attempt = [], module.attempt

    def counted(*arguments):
        outcome = attempt(*arguments)
        made.append(len(outcome.history))
        return outcome

    monkeypatch.setattr(module, "attempt", counted)
    return made


def drawn(slots):
    """A plate that is drawn down onto another one, and lies flush in the end.

    It is where both are flush that a solve begins, unless topology is to be kept.
    """
    scene, b = pair(slots, 0.5)
    for x, y in ((15.0, 10.0), (-15.0, 10.0), (0.0, -10.0)):
        scene.minimize(asm.PointDistance(b.point(x, y, 0.0), (1.0 + x, 0.5 + y, 4.0)))
    return scene


def test_contacts_of_a_start_that_holds_are_given_four_times_as_many_places(attempts):
    scene, _ = pair(4)
    solution = scene.solve()
    assert solution.success and np.array_equal(solution.q, scene.q) and scene._crowding == 1
    assert len(solution.contacts) > 4
    # Four places and sixteen are too few for eleven rims. No loop was asked to find a pose.
    assert scene._crowding == 16 and attempts == []


def test_with_places_enough_there_is_no_more(attempts):
    scene, _ = pair(400)
    solution = scene.solve()
    assert solution.success and len(solution.contacts) > 4
    assert scene._crowding == 1 and attempts == []


def test_steps_are_not_made_that_would_be_thrown_away(attempts):
    scene = drawn(12)
    solution = scene.solve(keep_topology=True)
    assert solution.success and scene._crowding > 1
    assert solution.q[1, 2] == pytest.approx(5.0, abs=1e-8)
    *given_up, last = attempts
    assert given_up and max(given_up) <= last


def test_what_grew_is_kept(attempts):
    scene = drawn(12)
    scene.solve(keep_topology=True)
    attempts.clear()
    scene.solve(keep_topology=True)
    assert len(attempts) == 1


def test_the_end_does_not_depend_on_how_many_places_it_began_with():
    few, many = (drawn(slots).solve(keep_topology=True) for slots in (12, 400))
    assert few.success and many.success
    assert few.q[1] == pytest.approx(many.q[1], abs=1e-7)
