"""What the loop is told and what it tells: its settings, its results, its outcomes."""

from __future__ import annotations

# Outcomes; `solution.Status` gives each a sentence. RUNNING is none of them.
SOLVED, INFEASIBLE, STALLED, ITERATION_LIMIT, CONTACT_LOST, OUT_OF_TIME, RUNNING = 0, 1, 2, 3, 4, 5, 6
# SOLVED by first derivatives, but no factorization told that no curvature is negative (`solve/loop/inertia.py`).
UNSURE = 100
# Scattered bodies were gathered, and turns are to be chosen where they are now.
GATHERED = 101
# Settings, in scaled lengths.
FEASIBILITY, STATIONARITY, ITERATIONS, PENALTY, PENALTY_FLOOR, RADIUS, GATHER, FREE_TRIMS = 0, 1, 2, 3, 4, 5, 6, 7
# Whether all that moved is looked at once more before a pose counts as solved. Of a tick: whether it is one, which ends
# at a pose that holds after so many iterations, and at the last one that held where it ends otherwise; how long it may
# take (0: as long as it takes). Whether the end is tested for a minimum. Of a tick: where in the state the rows are
# that the last one left (0: nowhere). Whether nothing is asked for but that constraints hold: the least move is a wish.
# Whether a tick whose time is spent where its pose does not hold leaves that pose for the next one to go on from. What
# rows that repeat each other may disagree by (`solve/attempts/fit.py`). What bodies may be in each other where a solve
# begins, and may stay.
LAST_LOOK, TICK, BUDGET, SECOND_ORDER, RECALL, ANY_POSE, CARRIES, FIT, TOUCHING = 8, 9, 10, 11, 12, 13, 14, 15, 16
# The address at which a solve asks whether it is to go on (0: nowhere). Whether a solve ends early whose bodies go away
# without bound.
ASK_AT, STRAYS, SETTINGS = 17, 18, 19
# Whether the end is tested for a minimum (TESTED: and saddles are left before they are reached to the last digit).
TESTED, REACHED = 1.0, 2.0
# Whether scattered bodies are gathered (ASSEMBLES: and the loop ends there).
GATHERS, ASSEMBLES = 1.0, 2.0
# Results at the end of the state.
STATUS, COUNT, OBJECTIVE, VIOLATION, DUAL, CULPRIT, IMPROPER, SCATTER = 0, 1, 2, 3, 4, 5, 6, 7
# Of a tick: whether it ended at a pose that held before; whether its end is a minimum (0: not tested, 1; -1: no), and
# of a solve what its factorizations told (`solve/loop/inertia.py`); by how much the Hessian of a tick's first step was
# shifted,
# which tells the next one where to begin; one more than the steps it has done, if the next one is to go on with it (0:
# it ended).
HELD, CURVED, FIRST_SHIFT, CARRIED = 8, 9, 10, 11
HISTORY = 7  # figures an iteration: objective, feasibility, stationarity, mu, regularization, step length, radius
# Rounding of poses far from the origin, in parts of that.
ROUNDING = 4e-16
# How far bodies may be expected to move to mend what rows are off, lengths over the size and radians.
NEIGHBORHOOD = 0.02
# More than this is no rounding that a solution may have.
MOST_ROUNDING = 1e-6
# A pair this near to a fold (det H over |H|^2) gets its coordinates as unknowns.
FREE_BELOW = 0.02
