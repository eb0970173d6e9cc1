"""What the loop is told and what it tells: its settings, its results, its outcomes."""

from __future__ import annotations

from assembly._record import place_of, record_dtype, record_view, size_of

# Outcomes; `solution.Status` gives each a sentence. RUNNING is none of them.
SOLVED, INFEASIBLE, STALLED, ITERATION_LIMIT, CONTACT_LOST, OUT_OF_TIME, RUNNING = 0, 1, 2, 3, 4, 5, 6
# SOLVED by first derivatives, but no factorization told that no curvature is negative (`solve/loop/inertia.py`).
UNSURE = 100
# Scattered bodies were gathered, and turns are to be chosen where they are now.
GATHERED = 101
# Settings, in scaled lengths.
# Whether all that moved is looked at once more before a pose counts as solved. Of a tick: whether it is one, which ends
# at a pose that holds after so many iterations, and at the last one that held where it ends otherwise; how long it may
# take (0: as long as it takes). Whether the end is tested for a minimum. Of a tick: where in the state the rows are
# that the last one left (0: nowhere). Whether nothing is asked for but that constraints hold: the least move is a wish.
# Whether a tick whose time is spent where its pose does not hold leaves that pose for the next one to go on from. What
# rows that repeat each other may disagree by (`solve/attempts/fit.py`). What bodies may be in each other where a solve
# begins, and may stay.
# The address at which a solve asks whether it is to go on (0: nowhere). Whether a solve ends early whose bodies go away
# without bound.
STRAYS = 18
SETTINGS_RECORD = record_dtype(
    "f8",
    feasibility=1,
    stationarity=1,
    iterations=1,
    penalty=1,
    penalty_floor=1,
    radius=1,
    gather=1,
    free_trims=1,
    last_look=1,
    tick=1,
    budget=1,
    second_order=1,
    recall=1,
    any_pose=1,
    carries=1,
    fit=1,
    touching=1,
    ask_address=2,
)
settings_at = record_view(SETTINGS_RECORD)
FEASIBILITY = place_of(SETTINGS_RECORD, "feasibility")
STATIONARITY = place_of(SETTINGS_RECORD, "stationarity")
ITERATIONS = place_of(SETTINGS_RECORD, "iterations")
PENALTY = place_of(SETTINGS_RECORD, "penalty")
PENALTY_FLOOR = place_of(SETTINGS_RECORD, "penalty_floor")
RADIUS = place_of(SETTINGS_RECORD, "radius")
GATHER = place_of(SETTINGS_RECORD, "gather")
FREE_TRIMS = place_of(SETTINGS_RECORD, "free_trims")
LAST_LOOK = place_of(SETTINGS_RECORD, "last_look")
TICK = place_of(SETTINGS_RECORD, "tick")
BUDGET = place_of(SETTINGS_RECORD, "budget")
SECOND_ORDER = place_of(SETTINGS_RECORD, "second_order")
RECALL = place_of(SETTINGS_RECORD, "recall")
ANY_POSE = place_of(SETTINGS_RECORD, "any_pose")
CARRIES = place_of(SETTINGS_RECORD, "carries")
FIT = place_of(SETTINGS_RECORD, "fit")
TOUCHING = place_of(SETTINGS_RECORD, "touching")
ASK_AT = place_of(SETTINGS_RECORD, "ask_address")
SETTINGS = size_of(SETTINGS_RECORD)
# Whether the end is tested for a minimum (TESTED: and saddles are left before they are reached to the last digit).
TESTED, REACHED = 1.0, 2.0
# Whether scattered bodies are gathered (ASSEMBLES: and the loop ends there).
GATHERS, ASSEMBLES = 1.0, 2.0
# Results at the end of the state.
# Of a tick: whether it ended at a pose that held before; whether its end is a minimum (0: not tested, 1; -1: no), and
# of a solve what its factorizations told (`solve/loop/inertia.py`); by how much the Hessian of a tick's first step was
# shifted,
# which tells the next one where to begin; one more than the steps it has done, if the next one is to go on with it (0:
# it ended).
RESULTS_RECORD = record_dtype(
    "f8",
    status=1,
    count=1,
    objective=1,
    violation=1,
    dual=1,
    culprit=1,
    improper=1,
    scatter=1,
    held=1,
    curved=1,
    first_shift=1,
    carried=1,
)
results_at = record_view(RESULTS_RECORD)
STATUS = place_of(RESULTS_RECORD, "status")
COUNT = place_of(RESULTS_RECORD, "count")
OBJECTIVE = place_of(RESULTS_RECORD, "objective")
VIOLATION = place_of(RESULTS_RECORD, "violation")
DUAL = place_of(RESULTS_RECORD, "dual")
CULPRIT = place_of(RESULTS_RECORD, "culprit")
IMPROPER = place_of(RESULTS_RECORD, "improper")
SCATTER = place_of(RESULTS_RECORD, "scatter")
HELD = place_of(RESULTS_RECORD, "held")
CURVED = place_of(RESULTS_RECORD, "curved")
FIRST_SHIFT = place_of(RESULTS_RECORD, "first_shift")
CARRIED = place_of(RESULTS_RECORD, "carried")
HISTORY = 7  # figures an iteration: objective, feasibility, stationarity, mu, regularization, step length, radius
# Rounding of poses far from the origin, in parts of that.
ROUNDING = 4e-16
# How far bodies may be expected to move to mend what rows are off, lengths over the size and radians.
NEIGHBORHOOD = 0.02
# More than this is no rounding that a solution may have.
MOST_ROUNDING = 1e-6
# A pair this near to a fold (det H over |H|^2) gets its coordinates as unknowns.
FREE_BELOW = 0.02
