"""Clearances promise that bodies do not cross: random scenes, judged by closed forms.

Solves from all kinds of starts, and ticks of hands that jump or go slowly through: where they say that they hold, no
body is in another one by more than 1e-9 of the larger one's size (`clearance_scenes.TOUCHING`). To say that they do
not hold is never wrong here, but it must not be the rule: hence the shares.
"""

from __future__ import annotations

from tests.validation.clearance_scenes import solved, tracked


def test_what_is_solved_is_clear(cases):
    outcomes = [solved(number) for number in range(cases(40, 3000))]
    assert [outcome for outcome in outcomes if not outcome.is_right] == []
    assert sum(outcome.is_solved for outcome in outcomes) >= 0.7 * len(outcomes)


def test_ticks_that_hold_are_clear(cases):
    outcomes = [tracked(number) for number in range(cases(10, 500))]
    assert [(outcome, outcome.wrong) for outcome in outcomes if outcome.wrong] == []
    assert sum(outcome.begins for outcome in outcomes) >= 0.7 * len(outcomes)
