"""Where everything stands in a packed scene: the one table of integers and the one pool of doubles.

All lengths in a program are divided by the scene's length scale. Table: a header, the slot of
every body (-1: fixed), then a record a row (contacts first, then trims), a joint, a tape and an objective term. The
loop works on

    configuration  (n, 7)       poses, scaled, positions relative to a reference
    tracked        (k, 12)      of every contact parameters, features, normal and gap of its pair
                                (`proximity/features/solid_contact.py`), then (first column) unwrapped angles of joints
    records        (k + j, R)   what the derivatives of gaps need (see `track_contact`), then frames of joints, then
                                one of trims that are vectors
    residual       (m,)         rows: contacts, trims, joints, tapes; behind them four for every free pair
    jacobian       (m, 16 + e)  in the twists of a row's two bodies (12), a free pair's coordinates (4), further bodies
"""

from __future__ import annotations

# Header of the table: counts, then where its parts begin; whether nobody asked for the
# objective, and how many of its terms are dexterities.
BODIES, MOVING, CONTACTS, TRACKED, JOINTS, ROWS, TAPES, TERMS, EXTRA = 0, 1, 2, 3, 4, 5, 6, 7, 8
SLOTS, ROW_TABLE, JOINT_TABLE, TAPE_TABLE, TERM_TABLE, TAPE_ROOM, GATHER_TABLE = 9, 10, 11, 12, 13, 14, 15
IMPLICIT, DEXTERITIES = 16, 17
# Rows of trims follow those of contacts; whether some are vectors, which take a record of their own.
TRIMS, VECTOR_TRIMS = 18, 19
# Addresses of kernels that few scenes need (`_address.call_address`).
TRACK_AT, SEARCH_AT, NEAREST_AT, DEEPEST_AT, TRIM_ROWS_AT, TRIM_TERMS_AT = 20, 21, 22, 23, 24, 25
# Rows of clearances stand behind those of given contacts and among them: where the first one is, and how many. A row
# without bodies is idle. The record of the watch (`proximity/manager/update.py`; -1: no clearance), and its kernel's
# address.
FIRST_GUARD, GUARDS, WATCH, LOOK_AT = 26, 27, 28, 29
# What tells the time in nanoseconds (0: nothing does).
CLOCK_AT = 30
# The record of the blocks that the Hessian of a large scene has (`constraints/program/hessian_blocks.py`), and its
# length; 0: it is dense.
BLOCK_RECORD, BLOCK_LENGTH = 31, 32
# Addresses again: of what evaluates rows of contacts; of what contacts of two surfaces need besides, and clearances;
# of what runs tapes.
CONTACT_ROWS_AT, START_AT, LENGTHS_AT, FREE_ROW_AT, FREE_TERMS_AT, EXTREMAL_AT = 33, 34, 35, 36, 37, 38
STAYED_AT, PARTS_AT, WENT_AT, RUN_TAPE_AT, HEADER = 39, 40, 41, 42, 43
# A row: kind, its two bodies (-1: none), whether it is one-sided (residual >= 0), whether it prescribes a freedom, and
# whether its residual is a length. Row k is that of contact k.
ROW = 14
KIND, BODY_F, BODY_G, ONE_SIDED, DRIVE, IS_LENGTH = 0, 1, 2, 3, 4, 5
CONTACT_ROW, JOINT_ROW, TAPE_ROW, TRIM_ROW = 0, 1, 2, 3
# Of a contact: its surfaces, or else (-1: none) its shells; where the gap that counts as none is in the
# pool; of a clearance's the number of the contact it has now (0: none).
SURFACE_F, SURFACE_G, SHELL_F, SHELL_G, MINIMUM, GUARD_NUMBER = 6, 7, 8, 9, 10, 11
# Of a trim: its contact, on which of its sides, the loop, where the factor is in the pool, the form, how many rows it
# has (its first one says), the records of the loop's curves as edges, whether a vector counts by its signed length.
TRIM_PAIR, TRIM_SIDE, TRIM_LOOP, TRIM_FACTOR = 6, 7, 8, 9
TRIM_FORM, TRIM_COUNT, TRIM_EDGES, TRIM_LENGTH = 10, 11, 12, 13
# Its forms (`trim.py`).
SIGNED, PARAMETRIC, CARTESIAN, BETWEEN = 0, 1, 2, 3
# Of a joint: kind and component of the coordinate, the joint that has its frames, where its angle is tracked (-1: it is
# none), where its factor, the second factor and the value are in the pool, and a second coordinate with its bodies.
COORDINATE, COMPONENT, JOINT, ANGLE, PARAMETERS, SECOND = 6, 7, 8, 9, 10, 11
# A second coordinate: kind, component, joint, angle, bodies.
SECOND_BODY_F, SECOND_BODY_G, SECOND_RECORD = 4, 5, 6
# Of a tape: which, and which of its values.
TAPE, TAPE_VALUE = 6, 7
# A joint: its bodies and where its frames are in the pool.
JOINT_RECORD = 3
# A tape: instructions for values and Jacobian, and for the Hessian; its values, its bodies, where the list of these is,
# its first row, where the size of one unit is in the pool.
TAPE_RECORD = 8
TAPE_FIRST, TAPE_SECOND, TAPE_VALUES, TAPE_BODIES, TAPE_LIST, TAPE_ROW_AT, TAPE_SCALE = 0, 1, 2, 3, 4, 5, 6
# Columns of the Jacobian: twists of f and g, a free pair's coordinates, further bodies.
FREE_COLUMN, EXTRA_COLUMN = 12, 16
# Header of the pool.
# length scale, reference point (1 to 3), unit of the objective: what its scaled value counts in the user's units; zero.
SCALE, REFERENCE, UNIT, ZERO, POOL_HEADER = 0, 1, 4, 5, 8
# Figures that a solve leaves in its state, behind poses, tracked values, multipliers and residuals.
RESULTS = 12
