"""Settings, results and outcomes of the loop."""

from __future__ import annotations

from assembly._record import place_of, record_dtype, record_view, size_of

# Outcomes; `solution.Status` gives each a sentence. RUNNING is none of them.
SOLVED, INFEASIBLE, STALLED, ITERATION_LIMIT, CONTACT_LOST, OUT_OF_TIME, RUNNING = 0, 1, 2, 3, 4, 5, 6
# SOLVED by first derivatives, but no factorization told that no curvature is negative (`solve/loop/inertia.py`).
UNSURE = 100
# Scattered bodies were assembled, and turns are to be chosen where they are now.
GATHERED = 101
# What a solve or a tick is asked for. Lengths are scaled.
SETTINGS_RECORD = record_dtype(
    "f8",
    feasibility=1,  # largest violation that counts as none [scaled length, radian]
    stationarity=1,  # largest dual residual that counts as none
    iterations=1,  # steps at most
    penalty=1,  # mu of the first step
    penalty_floor=1,  # mu falls to this, and farther where rows need it
    radius=1,  # length of the first step at most
    gather=1,  # whether scattered bodies are gathered: 0 (where all else fails), NEVER, GATHERS or ASSEMBLES
    lift_trims=1,  # 1: contacts of trims that count get their coordinates as unknowns
    final_update=1,  # 1: all pairs that moved are updated once more before a pose counts as solved
    tick=1,  # 1: ends at a pose that holds after so many iterations, else at the last one that held
    budget=1,  # of a tick: how long it may take [ns]; 0: as long as it takes
    second_order=1,  # whether the end is tested for a minimum: 0, TESTED or REACHED
    any_pose=1,  # 1: nothing is asked for but that constraints hold; the least move is a soft objective
    carries=1,  # 1: a tick whose time is spent where its pose does not hold leaves that pose to the next one
    fit=1,  # what rows that repeat each other may disagree by (`solve/attempts/fit.py`)
    touching=1,  # depth that bodies may be in each other by where a solve begins, and may stay
    ask_address=1,  # kernel that is asked whether to go on (`solve/interruption.py`); 0: none
    strays=1,  # 1: ends early where bodies go away without bound
    places=1,  # 1: ends where near contacts find no place among those of clearances (it begins again with more)
)
settings_at = record_view(SETTINGS_RECORD)
FEASIBILITY = place_of(SETTINGS_RECORD, "feasibility")
STATIONARITY = place_of(SETTINGS_RECORD, "stationarity")
ITERATIONS = place_of(SETTINGS_RECORD, "iterations")
PENALTY = place_of(SETTINGS_RECORD, "penalty")
PENALTY_FLOOR = place_of(SETTINGS_RECORD, "penalty_floor")
RADIUS = place_of(SETTINGS_RECORD, "radius")
GATHER = place_of(SETTINGS_RECORD, "gather")
LIFT_TRIMS = place_of(SETTINGS_RECORD, "lift_trims")
FINAL_UPDATE = place_of(SETTINGS_RECORD, "final_update")
TICK = place_of(SETTINGS_RECORD, "tick")
BUDGET = place_of(SETTINGS_RECORD, "budget")
SECOND_ORDER = place_of(SETTINGS_RECORD, "second_order")
ANY_POSE = place_of(SETTINGS_RECORD, "any_pose")
CARRIES = place_of(SETTINGS_RECORD, "carries")
FIT = place_of(SETTINGS_RECORD, "fit")
ALLOWED_OVERLAP = place_of(SETTINGS_RECORD, "touching")
ASK_ADDRESS = place_of(SETTINGS_RECORD, "ask_address")
STRAYS = place_of(SETTINGS_RECORD, "strays")
PLACES = place_of(SETTINGS_RECORD, "places")
SETTINGS = size_of(SETTINGS_RECORD)
# Whether the end is tested for a minimum (TESTED: and saddles are left before they are reached to the last digit).
TESTED, REACHED = 1.0, 2.0
# Whether scattered bodies are assembled (ASSEMBLES: and the loop ends there).
NEVER, GATHERS, ASSEMBLES = -1.0, 1.0, 2.0
# Results at the end of the state.
RESULTS_RECORD = record_dtype(
    "f8",
    status=1,  # an outcome
    count=1,  # iterations
    objective=1,  # scaled value
    violation=1,  # largest one, in the user's lengths
    dual=1,  # dual residual
    culprit=1,  # contact that has no pair; -1: none
    improper=1,  # contacts at which surfaces cross
    scatter=1,  # 1: bodies were scattered at the start
    last_feasible=1,  # of a tick, 1: it ended at a pose that held before
    curved=1,  # whether the end is a minimum (0: not tested, 1: yes, -1: no); of a solve: see `inertia.py`
    first_shift=1,  # shift of the Hessian in a tick's first step, where the next one begins
    carried=1,  # one more than the steps done, if the next tick is to go on from here; 0: it ended
)
results_at = record_view(RESULTS_RECORD)
COUNT = place_of(RESULTS_RECORD, "count")
OBJECTIVE = place_of(RESULTS_RECORD, "objective")
VIOLATION = place_of(RESULTS_RECORD, "violation")
DUAL = place_of(RESULTS_RECORD, "dual")
CULPRIT = place_of(RESULTS_RECORD, "culprit")
IMPROPER = place_of(RESULTS_RECORD, "improper")
SCATTER = place_of(RESULTS_RECORD, "scatter")
LAST_FEASIBLE = place_of(RESULTS_RECORD, "last_feasible")
CURVED = place_of(RESULTS_RECORD, "curved")
CARRIED = place_of(RESULTS_RECORD, "carried")
HISTORY = 7  # figures an iteration: objective, feasibility, stationarity, mu, regularization, step length, radius
