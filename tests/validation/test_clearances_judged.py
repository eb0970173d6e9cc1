"""Clearances promise that bodies do not cross: random scenes, judged by closed forms.

Solves from all kinds of starts, and ticks of hands that jump or go slowly through: where they say that they hold, no
body is in another one by more than 1e-9 of the larger one's size (`clearance_scenes.TOUCHING`). To say that they do
not hold is never wrong here, but it must not be the rule: hence the shares.
"""

from __future__ import annotations

from tests.validation.clearance_scenes import PROMISE_NOTHING, solved, tracked

# Where ends that cross are not told by the extrema of distances: a thin plate, all of whose surface near a round body
# is pierced; a sheet; edges of concave bodies.
HARD_SOLVES = (14, 39, 79, 105, 258, 286, 406, 759, 797, 839, 858)
# Corners of thin plates that are deep in a body, which leave the plate at once on their way out; and ends that an
# objective leads through a sheet or a thin plate.
DEEP_CORNERS, LED_THROUGH = (75, 85, 123, 157, 191, 211, 235, 431), (17, 31, 79, 357, 409)
HARD_TRACKS = (35, 18, 67, 2, 15, 19, 30, 34)


def test_what_is_solved_is_clear(cases):
    outcomes = [solved(number) for number in range(cases(20, 3000))]
    assert [outcome for outcome in outcomes if not outcome.is_right] == []
    assert sum(outcome.is_solved for outcome in outcomes) >= 0.85 * len(outcomes)


def test_what_is_solved_is_clear_where_it_is_hard():
    assert [outcome for outcome in map(solved, HARD_SOLVES) if not outcome.is_right] == []


def test_corners_of_thin_plates_are_rows():
    assert [outcome.number for outcome in map(solved, DEEP_CORNERS) if not outcome.is_solved] == []


def test_what_an_objective_leads_through_is_parted(cases):
    numbers = LED_THROUGH[: cases(2, len(LED_THROUGH))]
    outcomes = [solved(number) for number in numbers]
    assert [outcome.number for outcome in outcomes if not (outcome.is_solved and outcome.is_right)] == []


def test_ticks_that_hold_are_clear(cases):
    outcomes = [tracked(number) for number in range(cases(2, 500))]
    assert {outcome.number: (outcome.pair, outcome.wrong) for outcome in outcomes if outcome.wrong} == {}
    assert sum(outcome.begins for outcome in outcomes) >= 0.9 * len(outcomes)
    told = [status for outcome in outcomes for status in outcome.statuses]
    assert sum(status not in PROMISE_NOTHING for status in told) >= 0.9 * len(told)


def test_ticks_that_hold_are_clear_where_it_is_hard(cases):
    outcomes = [tracked(number) for number in HARD_TRACKS[: cases(3, len(HARD_TRACKS))]]
    assert {outcome.number: (outcome.pair, outcome.wrong) for outcome in outcomes if outcome.wrong} == {}
