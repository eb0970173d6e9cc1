"""The numbers that tune the loop of a solve, in one place.

Of each: its unit in brackets (none: a pure number), what it does, what happens if it is doubled, where it came from.
Lengths are parts of the scene's size, as all that the loop works with; multipliers and dual residuals are forces of an
objective of order one. "Chosen" is what follows from nothing: no record tells of other values that were tried. All are
constants of the compiled code, no settings of a user (those are in `settings.py`).
"""

from __future__ import annotations

# What rounding is. ---------------------------------------------------------------------------------------------------
# Rounding of poses far from the origin, in parts of that. Doubled: far scenes are held to half as many digits.
# From: about two roundings of a double, 2.2e-16 each.
ROUNDING = 4e-16
# [length] More than this is no rounding that a solution may have. Doubled: a scene 2.5e9 sizes from the origin may be
# off twice as much. Chosen.
MOST_ROUNDING = 1e-6
# A step of so many roundings of a coordinate at most is no move. Doubled: slopes are laid to rounding sooner. Chosen.
STEPS_OF_ROUNDING = 8.0
# [steps] After so many whole steps in a row that gain nothing of the slope, rounding may explain what is left of it.
# Doubled: such solves take 20 steps more. Chosen.
STANDS = 20
# What a step must gain of a dual residual: the part that may be left. Doubled every step gains: solves go on until
# steps lead away. Chosen.
GAIN = 0.5

# Contacts. -----------------------------------------------------------------------------------------------------------
# [det H over |H|^2] A pair this near to a fold gets its coordinates as unknowns. Doubled: more unknowns, steps of more
# contacts have rows of tangency. Chosen.
LIFT_BELOW = 0.02
# [length] A clearance's contact that no longer step, nor one halved so far (a share of the step), finds again is given
# up. Doubled, or HALVED halved: contacts that only switch are given up, or are waited for longer. Chosen.
LETS_GO, HALVED = 1e-5, 0.0625
# [length] Where solids are in each other by no more than this, the next update lists what is to part them. Doubled:
# solids may sink deeper before a step is cut. Chosen.
SLIGHTLY = 1e-5
# [length] A parameter along which a point moves less, from end to end, is one at a pole, and no unknown. Doubled:
# slivers of patches count as poles a little earlier. Chosen.
POLAR = 1e-6

# The step. -----------------------------------------------------------------------------------------------------------
# The least shift of the Hessian. Doubled: the last steps leave twice as much. From: about the root of a double's
# rounding.
LEAST_SHIFT = 1e-8
# Where rows alone count: the shift in parts of the largest violation, down to rounding. Doubled: more steps to where
# rows depend on each other; halved: longer ones, that overshoot. Chosen; rounding of a matrix of order one.
SHIFT, TINIEST_SHIFT = 1e-2, 1e-13
# [length] Rows are close to holding where they are off by less: there the shift above counts, and rows that depend on
# each other gain nothing any more. Doubled: the shift falls sooner. From: `LEAST_SHIFT` over `SHIFT`.
NEARLY_HELD = 1e-6
# [rounds] A step is computed so often for one-sided rows that it would break. Where they do not agree by then, it is
# the one without them: half of an exchange may lead uphill. Doubled: time where many rows depend on each other.
# From: random rows, 20 of rank 3 at a time, of which one in a hundred takes more than 40.
FORESEEN = 60
# [rounds] The same in ticks, in which all that are wrong change at once: with rows that agree, plates that are dragged
# over each other and a plug that leans in its seat are led less near to the hand. Doubled: a little time where rows
# change places. From: random rows, of which some take more than four rounds and a few in a hundred never agree.
FORESEEN_IN_TICKS = 12
# [steps] After so many feasible steps in a row that motion bounds cut by more than half, steps are damped, until one is
# cut less: they may be long in directions that no row and no objective resists, as a ring's spin about its own axis.
# Doubled: twice as many short steps. Chosen.
OFTEN = 25
# [radian] The largest component of a body's rotation vector in a straight step; its angle may be sqrt(3) times as much.
# Doubled: predictions of angles and contacts fail. From: half a turn, within which an angle is identified; a margin.
LARGEST_TURN = 1.0
# So often a step is shortened by a larger shift. Doubled: more factorizations a step. Chosen.
SHORTENINGS = 4
# [trials] Of a refused step: up to TO_ROWS are bent to where rows hold, then the straight one is tried anew, and up to
# BENT it is bent to what its linear model leaves of the rows; every third trial is straight. Doubled: time where rows
# bend, and more scenes end elsewhere. From: starts at exact saddles, of which half as many fail.
TO_ROWS, BENT = 2, 5
# [length] A step shorter than this decides nothing: the radius falls no farther, the search ends a billion times below.
# Doubled: the same. Chosen.
SHORTEST = 1e-6
# Where violations are stationary, this much curvature downward makes a saddle of it; a move of this size leads off it
# (KICK: length, radian). Doubled: weaker saddles are left alone; the move is longer. Chosen.
SADDLE, KICK = 1e-5, 1e-3
# So often at most a solve leaves a saddle of its violations. Doubled: later verdicts INFEASIBLE. Chosen.
KICKS = 3

# Steps by the factor that the last solve left (`chord.py`). -----------------------------------------------------------
# [steps] So many at most, each of which leaves at most CHORD_GAIN of the violation and of the dual residual; else the
# loop begins from where the solve began. Doubled: bad starts are given up later, slow ones are followed. Chosen.
CHORD_STEPS, CHORD_GAIN = 6, 0.25
# [steps] A tick that took at most so many leaves the factor that it began with. Doubled: ticks take more steps, and
# more of them make a factor. Chosen.
FEW_STEPS = 2
# [length, radian] The largest component of such a step. Doubled: longer moves are tried, in vain. Chosen.
CHORD_LONGEST = 0.2
# A first step that leads aside by at most ASIDE of itself, and is at most FARTHER times as long as the last solve's, is
# corrected as that was. Doubled: worse corrections count, which cost a step; rounding is enlarged by the square. From:
# at a quarter, half of what is of second order may be left.
ASIDE, FARTHER = 0.25, 10.0
# The shift of the Hessian in such a factor. Doubled: what is left after a step doubles. From: halves of what a step
# leaves anyway, for moves of a hundredth.
CHORD_SHIFT = 1e-5
# The penalty in a factor that is made after such a step. Doubled: what the next step, the last one, leaves of the rows
# doubles. From: that step changes multipliers by up to 1e-6, and is to leave rounding; rounding, times its inverse, is
# 1e-8.
CORRECTED_PENALTY = 1e-8
# The part of the tolerance beyond which one more step follows the second of a solve whose first was corrected. Doubled:
# what such a solve leaves at most doubles. From: planar four-bars in steps of 1 degree, of which nine in ten are then
# off by no more than 6e-14 (3e-13 without it, 2e-13 where no step is corrected), for 0.13 steps a solve.
AFTER_CORRECTED = 0.1

# Multipliers. --------------------------------------------------------------------------------------------------------
# [force] Multipliers below this count for nothing against the objective's curvature, which is of order one. Doubled:
# small forces bend nothing, and their contacts converge slowly, as in `benchmarks/first_order.py`. Chosen.
WEAK = 1e-3
# [length] One-sided rows that hold by less than this may push. Doubled: more rows to choose from. From: `TOUCHING`.
NEAR = 1e-9
# [rounds] One-sided rows are exchanged so often for those that would pull; after BLOCKED rounds that gain nothing one
# at a time. Doubled: time where rows depend on each other. From: block pivoting, Portugal, Judice and Vicente (1994).
EXCHANGES, BLOCKED = 40, 3
# [force] A row is wanted that would take more than this off the objective's slope. Doubled: the same. From: rounding.
WANTED = 1e-12
# [rounds] Least squares of multipliers are refined so often. Doubled: time. From: each takes a factor of 1e-10 off.
ROUNDS = 3

# Back onto the rows. -------------------------------------------------------------------------------------------------
# [rounds] A step back is computed at most RELEASES times more, without the one-sided rows that pull: those whose
# residual after the step is above PULLS times its present size. Doubled: time where many rows repeat each other.
# Chosen; PULLS is rounding.
RELEASES, PULLS = 4, 1e-12
# The damping of a step back is 1e-2 at first (`begin_loop`). While the step would leave more than LEFT_OVER of the
# largest violation, as where rows nearly depend on each other, it is multiplied by SOFTER, down to SOFTEST. Doubled:
# shorter steps that leave more. Chosen.
LEFT_OVER, SOFTER, SOFTEST = 0.1, 1e-3, 1e-9
# A step back is shortened by the first where it leads farther off; a tick's may lead off by ASTRAY times once, if the
# next one leads back; below LEAST_SHARE of a step nothing is found. Doubled: slower, and sooner given up. Chosen.
SHORTENED, ASTRAY, LEAST_SHARE = 0.25, 10.0, 1e-4
# [steps] Where a solve with clearances ends at a pose that does not hold, so many more lead back onto the rows.
# Doubled: failed solves take longer. Chosen.
BACK_STEPS = 30

# Whether rows can hold at all. ---------------------------------------------------------------------------------------
# [steps] Every so many the largest violation must have halved, or rows alone are restored to see whether they can
# hold; so many times. Doubled: contradictions are told after twice as many steps. Chosen.
PATIENCE, RESTORATIONS = 25, 3
# [whole steps] So many in a row that leave more than UNCHANGED of the largest violation tell that rows contradict each
# other. Doubled: as many steps more. Chosen.
STUCK, UNCHANGED = 2.0, 0.99
# [length] Rows that are off by at most LITTLE may repeat each other, tilted by MOST_TILTED [radian]; ROUNDED is
# rounding, in parts of what counts as held. Doubled: larger contradictions pass for tilted rows. Chosen.
LITTLE, MOST_TILTED, ROUNDED = 1e-2, 1e-3, 0.01
# [length, radian] How far bodies may be expected to move to mend what rows are off. Doubled: rows tilted by half as
# much are taken for contradictions. Chosen.
NEIGHBORHOOD = 0.02
# What is off by so many times what counts as held is not so by rounding. Doubled: fewer verdicts INFEASIBLE. Chosen.
BEYOND_ROUNDING = 2.0
# [steps] So many in a row, however long, that leave as much begin to restore, in steps no longer than a neighborhood;
# so many of these tell that it is mended far away, if at all. Doubled: as many steps more. Chosen.
DRAGGED, NOT_NEARBY = 4.0, 2.0
# Where SLOW whole steps in a row do not halve the violation, the floor of the penalty gives way, down to HARDEST:
# rounding, times its inverse, must stay small against the objective's curvature. Doubled: rows of vanishing slopes
# (a dead center) hold later. From: a double's digits, 2e-16 / 1e-10.
SLOW, HARDEST = 3.0, 1e-10

# Clearances. ---------------------------------------------------------------------------------------------------------
# Bodies are too deep in each other beyond this factor times half their least radius of curvature. Doubled: rows may
# lead out on the far side. From: beyond that depth the side from which they came is not known.
DEEP = 1.0
# How much shorter steps are after one that led too deep; as often as another pose is clear they may be LONGER times as
# long. Doubled: more returns. Chosen.
SHORTER, LONGER = 0.25, 2.0
# [times, steps] So often at most a solve that gets no further begins again, while so many of its steps are left.
# Doubled: longer failures. Chosen.
BEGINNINGS, LEFT = 3, 20

# The end. ------------------------------------------------------------------------------------------------------------
# A saddle is left from where the dual residual [force] and the violation [length] are no more. Doubled: the same, some
# steps sooner. Chosen.
NEAR_SADDLE, OFF_SADDLE = 1e-3, 1e-6
# A factorization tells of the end with a shift up to SMALL_SHIFT where the dual residual was at most NEAR_END. Doubled:
# flatter minima, and factors farther from the end, count. From: ten times `LEAST_SHIFT`; chosen.
SMALL_SHIFT, NEAR_END = 1e-7, 1e-3
# One that needed more than this near an end tells of negative curvature. Doubled: weaker saddles are told later.
# Chosen.
CLEAR_SHIFT = 1e-3
# [force] A one-sided row with a multiplier below this does not push. Nor do multipliers bend anything that are all
# below it. Doubled: more rows count as touching. Chosen.
IDLE = 1e-7
# [steps] Without a user's objective: at most so many after the violation was first at most 1e-9 (`contact.TOUCHING`).
# Doubled: a least move that oscillates at a kink ends later. Chosen.
LINGERS = 40
# Where a solve may stray, and its bodies are FAR times farther out, or sizes, after STRAYING steps, it is checked
# whether that goes on. Doubled: unbounded scenes are told later. Chosen.
FAR, STRAYING = 1e3, 60

# Initial assembly (`initial_guess.py`). ------------------------------------------------------------------------------
# [length, or a sine] Bodies are assembled where a start violates a row of a joint by more than this. Doubled: more
# starts go to the loop as they are, which takes longer from there. Chosen.
SCATTERED = 0.5
# [steps] Of the fit of one body to those that are placed. Doubled: fits that creep go on longer. Chosen.
FIT_STEPS = 50
# [length squared] Half the sum of squares of a body's rows that is as good as zero. Doubled: nothing. From: rows to
# 1e-13.
FITTED = 1e-26
# The damping of that fit at first, in parts of the matrix of rows of order one, and where no step is found any more.
# Doubled: a first step shorter; a few more factorizations before a fit gives up. Chosen.
DAMPING, MOST_DAMPING = 1e-4, 1e6
# A place for a body is better than the best one so far if its sum of squares is less than this factor times that one's.
# Doubled, above one: worse places are taken. Close to one: rounding decides. Chosen.
LOWER = 0.9

# Rates and dexterity (`rates.py`, `dexterity.py`). -------------------------------------------------------------------
# Rows are of order one: singular values below the root of this count as zero. Doubled: nearly dependent rows are a
# compromise a little earlier. Chosen.
REST = 1e-10
# [passes] Of what corrects rates for REST, and the part of them by which the last one changes them: errors shrink by
# the same factor each. Doubled: mechanisms next to a singular pose are taken a little nearer to it. Chosen; half the
# digits of a double.
PASSES, RATES_ENOUGH = 8, 1e-8
# How much of an end effector's motion its inputs may leave open, and rows may change by them. Doubled: more mechanisms
# count as determined. Chosen: well above RATES_ENOUGH.
UNDETERMINED = 1e-6
# Rows that change by less than this are as good as kept. Doubled: nothing. From: rounding of rows of order one.
KEPT = 1e-12
# [length, radians] Step of the differences of a dexterity's gradient that make its Hessian, which only speeds the loop.
# Doubled: curvature is off by twice as much. Chosen.
DIFFERENCE = 1e-6

# Time. ---------------------------------------------------------------------------------------------------------------
# A tick that does not hold after its iterations may make this many times as many in all. Doubled: later ticks. Chosen.
EXTRA_TIME = 4
# After this part of a tick's budget no update of the manager begins, and no step from a feasible iterate: either may
# take as long as the rest. Doubled: ticks overrun their budgets. Chosen.
HALF = 0.5
# [updates a pair] A tick may end with an update until there were so many of every pair; then a step has to come first.
# Doubled: ticks of crowded scenes stand twice as long. Chosen.
UPDATES_ALONE = 4
# [steps, pairs of bodies] In its first SHORT steps a solve does not ask whether to go on, except in a large scene: one
# with a sparse Hessian, or of more than MANY_PAIRS. Doubled: an interruption waits longer. Chosen.
SHORT, MANY_PAIRS = 4, 256
