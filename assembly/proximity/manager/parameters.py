"""The numbers that tune the contact manager, in one place.

Of each: its unit in brackets (none: a pure number), what it does, what happens if it is doubled, where it came from.
Lengths are parts of the scene's size. "Chosen" is what follows from nothing: no record tells of other values that were
tried. All are constants of the compiled code; what a user may set are the options of `Clearance` and `Manager`.
"""

from __future__ import annotations

# What is listed. -----------------------------------------------------------------------------------------------------
# [length] The least query margin and the largest one, with which the first update of a pair begins. The least doubled:
# fewer updates, each of more pairs of patches; the largest doubled: distant bodies need fewer updates. Chosen.
LEAST_MARGIN, LARGEST_MARGIN = 0.005, 0.1
# Extrema nearer than the first part of the query margin are listed; those that are, stay so up to the second. Doubled:
# more rows, of contacts that are far; with both parts equal they would come and go with every update. Chosen.
TAKE, KEEP = 0.4, 0.8
# [length] Bodies cross that overlap by more than this, or by more than `touching` where that is known. Doubled: overlap
# of twice the depth is no crossing. Chosen: well above rounding, well below what a user sees.
CROSSING = 1e-6

# When a pair is looked at again. -------------------------------------------------------------------------------------
# Parts of a pair's motion bound after which the pair is updated: SPENT, or USED for two round wires, whose updates are
# cheap. In a solve (IN_TURNS) the pair that used most is updated from USED on, and one that cut a step since its last
# update from BRIEF on. Larger: fewer updates, and shorter steps before them. Chosen.
USED, SPENT, BRIEF = 0.5, 0.85, 0.35
# A query margin is for so many moves as the last ones; of round wires, whose updates take a tenth of the time, for
# fewer. Doubled: half as many updates, each of more pairs. Chosen.
MOVES, MOVES_OF_WIRES = 12.0, 6.0
# [length] A motion bound that is no larger counts as zero: the pair is then updated after every step. Doubled: nothing.
# From: a few thousand roundings of a double.
LEAST_MOTION_BOUND = 1e-12
# A move by less than this part of the motion bound counts as none. Doubled: nothing. From: 1e-9 of the scene's size, at
# the largest bounds.
UNMOVED = 1e-8
# Pairs with folds nearer than this part of the least query margin are updated after every move. Doubled: more updates
# where contacts may be born. Chosen.
NEAR_FOLD = 0.2

# Lists that are kept from update to update. --------------------------------------------------------------------------
# The skins of lists of pairs of patches that may face each other, and of parts of centerlines that are near: lists are
# for motions up to so many of the least query margin. Doubled: lists are made half as often, and hold more. Chosen.
SKIN, CENTERLINE_SKIN = 2.0, 4.0

# One update. ---------------------------------------------------------------------------------------------------------
# So many pairs of patches are searched, if there are others that are farther apart; where patches crowd, all that are
# nearer than a part of the motion bound of a ball where contacts may be created. Doubled: dearer updates, longer steps.
# Chosen.
FEW, CROWDED_PART = 40, 0.5
# [ns] Between two questions whether a solve is to go on. Doubled: an interruption waits twice as long. Chosen: no user
# waits longer for the answer to Ctrl-C than for a frame or three.
SLICE = 50_000_000

# Round wires. --------------------------------------------------------------------------------------------------------
# [radians, boxes, radians] A box is halved until no tangent turns by more than THIN over half of it, and then searched
# by projections. Up to REFINED boxes are halved, down to FINE, only because they limit the motion. THIN doubled: a box
# may hold more than one minimum, and is then halved after all; REFINED doubled: slower updates, longer steps. Chosen.
THIN, REFINED, FINE = 0.025, 16, 0.05
# Motions in a box are no longer than this part of its smallest radius of curvature, and no separate motion ball is kept
# above that part of the query margin. Doubled: bounds of turns grow faster than motions; balls that save no update.
# Chosen.
TURNS, LARGEST_BALL = 0.5, 0.6
# [radii] Points of a level valley that are listed are so far apart. Doubled: half as many rows along it. Chosen.
SPARSE = 0.5
