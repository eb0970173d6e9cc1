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

from assembly._record import place_of, record_dtype, record_view, size_of

# Header of the table: counts, then where its parts begin; whether nobody asked for the
# objective, and how many of its terms are dexterities.
# Rows of trims follow those of contacts; whether some are vectors, which take a record of their own.
# Addresses of kernels that few scenes need (`_address.call_address`).
# Rows of clearances stand behind those of given contacts and among them: where the first one is, and how many. A row
# without bodies is idle. The record of the watch (`proximity/manager/update.py`; -1: no clearance), and its kernel's
# address.
# What tells the time in nanoseconds (0: nothing does).
# The record of the blocks that the Hessian of a large scene has (`constraints/program/hessian_blocks.py`), and its
# length; 0: it is dense.
# Addresses again: of what evaluates rows of contacts; of what contacts of two surfaces need besides, and clearances;
# of what runs tapes.
HEADER_RECORD = record_dtype(
    "i8",
    bodies=1,
    moving=1,
    contacts=1,
    tracked=1,
    joints=1,
    rows=1,
    tapes=1,
    terms=1,
    extra=1,
    slots=1,
    row_table=1,
    joint_table=1,
    tape_table=1,
    term_table=1,
    tape_room=1,
    gather_table=1,
    implicit=1,
    dexterities=1,
    trims=1,
    vector_trims=1,
    track_address=1,
    search_address=1,
    nearest_address=1,
    deepest_address=1,
    trim_rows_address=1,
    trim_terms_address=1,
    first_guard=1,
    guards=1,
    watch=1,
    look_address=1,
    clock_address=1,
    block_record=1,
    block_length=1,
    contact_rows_address=1,
    start_address=1,
    lengths_address=1,
    free_row_address=1,
    free_terms_address=1,
    extremal_address=1,
    stayed_address=1,
    parts_address=1,
    went_address=1,
    run_tape_address=1,
)
header_at = record_view(HEADER_RECORD)
BODIES = place_of(HEADER_RECORD, "bodies")
MOVING = place_of(HEADER_RECORD, "moving")
CONTACTS = place_of(HEADER_RECORD, "contacts")
TRACKED = place_of(HEADER_RECORD, "tracked")
JOINTS = place_of(HEADER_RECORD, "joints")
ROWS = place_of(HEADER_RECORD, "rows")
TAPES = place_of(HEADER_RECORD, "tapes")
TERMS = place_of(HEADER_RECORD, "terms")
EXTRA = place_of(HEADER_RECORD, "extra")
SLOTS = place_of(HEADER_RECORD, "slots")
ROW_TABLE = place_of(HEADER_RECORD, "row_table")
JOINT_TABLE = place_of(HEADER_RECORD, "joint_table")
TAPE_TABLE = place_of(HEADER_RECORD, "tape_table")
TERM_TABLE = place_of(HEADER_RECORD, "term_table")
TAPE_ROOM = place_of(HEADER_RECORD, "tape_room")
GATHER_TABLE = place_of(HEADER_RECORD, "gather_table")
IMPLICIT = place_of(HEADER_RECORD, "implicit")
DEXTERITIES = place_of(HEADER_RECORD, "dexterities")
TRIMS = place_of(HEADER_RECORD, "trims")
VECTOR_TRIMS = place_of(HEADER_RECORD, "vector_trims")
TRACK_AT = place_of(HEADER_RECORD, "track_address")
SEARCH_AT = place_of(HEADER_RECORD, "search_address")
NEAREST_AT = place_of(HEADER_RECORD, "nearest_address")
DEEPEST_AT = place_of(HEADER_RECORD, "deepest_address")
TRIM_ROWS_AT = place_of(HEADER_RECORD, "trim_rows_address")
TRIM_TERMS_AT = place_of(HEADER_RECORD, "trim_terms_address")
FIRST_GUARD = place_of(HEADER_RECORD, "first_guard")
GUARDS = place_of(HEADER_RECORD, "guards")
WATCH = place_of(HEADER_RECORD, "watch")
LOOK_AT = place_of(HEADER_RECORD, "look_address")
CLOCK_AT = place_of(HEADER_RECORD, "clock_address")
BLOCK_RECORD = place_of(HEADER_RECORD, "block_record")
BLOCK_LENGTH = place_of(HEADER_RECORD, "block_length")
CONTACT_ROWS_AT = place_of(HEADER_RECORD, "contact_rows_address")
START_AT = place_of(HEADER_RECORD, "start_address")
LENGTHS_AT = place_of(HEADER_RECORD, "lengths_address")
FREE_ROW_AT = place_of(HEADER_RECORD, "free_row_address")
FREE_TERMS_AT = place_of(HEADER_RECORD, "free_terms_address")
EXTREMAL_AT = place_of(HEADER_RECORD, "extremal_address")
STAYED_AT = place_of(HEADER_RECORD, "stayed_address")
PARTS_AT = place_of(HEADER_RECORD, "parts_address")
WENT_AT = place_of(HEADER_RECORD, "went_address")
RUN_TAPE_AT = place_of(HEADER_RECORD, "run_tape_address")
HEADER = size_of(HEADER_RECORD)
# A row: kind, its two bodies (-1: none), whether it is one-sided (residual >= 0), whether it prescribes a freedom, and
# whether its residual is a length. Row k is that of contact k.
ROW = 14
ROW_RECORD = record_dtype(
    "i8",
    kind=1,
    body_f=1,
    body_g=1,
    one_sided=1,
    drive=1,
    is_length=1,
)
row_at = record_view(ROW_RECORD)
KIND = place_of(ROW_RECORD, "kind")
BODY_F = place_of(ROW_RECORD, "body_f")
BODY_G = place_of(ROW_RECORD, "body_g")
ONE_SIDED = place_of(ROW_RECORD, "one_sided")
DRIVE = place_of(ROW_RECORD, "drive")
IS_LENGTH = place_of(ROW_RECORD, "is_length")
CONTACT_ROW, JOINT_ROW, TAPE_ROW, TRIM_ROW = 0, 1, 2, 3
# Of a contact: its surfaces, or else (-1: none) its shells; where the gap that counts as none is in the
# pool; of a clearance's the number of the contact it has now (0: none).
CONTACT_ROW_RECORD = record_dtype(
    "i8",
    before=6,
    surface_f=1,
    surface_g=1,
    shell_f=1,
    shell_g=1,
    minimum=1,
    guard_number=1,
)
contact_row_at = record_view(CONTACT_ROW_RECORD)
SURFACE_F = place_of(CONTACT_ROW_RECORD, "surface_f")
SURFACE_G = place_of(CONTACT_ROW_RECORD, "surface_g")
SHELL_F = place_of(CONTACT_ROW_RECORD, "shell_f")
SHELL_G = place_of(CONTACT_ROW_RECORD, "shell_g")
MINIMUM = place_of(CONTACT_ROW_RECORD, "minimum")
GUARD_NUMBER = place_of(CONTACT_ROW_RECORD, "guard_number")
# Of a trim: its contact, on which of its sides, the loop, where the factor is in the pool, the form, how many rows it
# has (its first one says), the records of the loop's curves as edges, whether a vector counts by its signed length.
TRIM_ROW_RECORD = record_dtype(
    "i8",
    before=6,
    contact=1,
    side=1,
    loop=1,
    factor=1,
    form=1,
    count=1,
    edges=1,
    is_length=1,
)
trim_row_at = record_view(TRIM_ROW_RECORD)
TRIM_PAIR = place_of(TRIM_ROW_RECORD, "contact")
TRIM_SIDE = place_of(TRIM_ROW_RECORD, "side")
TRIM_LOOP = place_of(TRIM_ROW_RECORD, "loop")
TRIM_FACTOR = place_of(TRIM_ROW_RECORD, "factor")
TRIM_FORM = place_of(TRIM_ROW_RECORD, "form")
TRIM_COUNT = place_of(TRIM_ROW_RECORD, "count")
TRIM_EDGES = place_of(TRIM_ROW_RECORD, "edges")
TRIM_LENGTH = place_of(TRIM_ROW_RECORD, "is_length")
# Its forms (`trim.py`).
SIGNED, PARAMETRIC, CARTESIAN, BETWEEN = 0, 1, 2, 3
# Of a joint: kind and component of the coordinate, the joint that has its frames, where its angle is tracked (-1: it is
# none), where its factor, the second factor and the value are in the pool, and a second coordinate with its bodies.
JOINT_ROW_RECORD = record_dtype(
    "i8",
    before=6,
    coordinate=1,
    component=1,
    joint=1,
    angle=1,
    parameters=1,
    second=1,
)
joint_row_at = record_view(JOINT_ROW_RECORD)
COORDINATE = place_of(JOINT_ROW_RECORD, "coordinate")
JOINT = place_of(JOINT_ROW_RECORD, "joint")
ANGLE = place_of(JOINT_ROW_RECORD, "angle")
PARAMETERS = place_of(JOINT_ROW_RECORD, "parameters")
SECOND = place_of(JOINT_ROW_RECORD, "second")
# A second coordinate: kind, component, joint, angle, bodies.
SECOND_BODY_F, SECOND_BODY_G, SECOND_RECORD = 4, 5, 6
# Of a tape: which, and which of its values.
TAPE_ROW_RECORD = record_dtype(
    "i8",
    before=6,
    tape=1,
    value=1,
)
tape_row_at = record_view(TAPE_ROW_RECORD)
# A joint: its bodies and where its frames are in the pool.
JOINT_RECORD = 3
# A tape: instructions for values and Jacobian, and for the Hessian; its values, its bodies, where the list of these is,
# its first row, where the size of one unit is in the pool.
TAPE_RECORD = 8
TAPE_RECORD_FIELDS = record_dtype(
    "i8",
    first_order=1,
    second_order=1,
    values=1,
    bodies=1,
    body_list=1,
    first_row=1,
    unit=1,
)
tape_at = record_view(TAPE_RECORD_FIELDS)
TAPE_FIRST = place_of(TAPE_RECORD_FIELDS, "first_order")
TAPE_SECOND = place_of(TAPE_RECORD_FIELDS, "second_order")
TAPE_VALUES = place_of(TAPE_RECORD_FIELDS, "values")
TAPE_BODIES = place_of(TAPE_RECORD_FIELDS, "bodies")
TAPE_LIST = place_of(TAPE_RECORD_FIELDS, "body_list")
TAPE_ROW_AT = place_of(TAPE_RECORD_FIELDS, "first_row")
TAPE_SCALE = place_of(TAPE_RECORD_FIELDS, "unit")
# Columns of the Jacobian: twists of f and g, a free pair's coordinates, further bodies.
FREE_COLUMN, EXTRA_COLUMN = 12, 16
# Header of the pool.
# length scale, reference point (1 to 3), unit of the objective: what its scaled value counts in the user's units; zero.
POOL_HEADER_RECORD = record_dtype(
    "f8",
    scale=1,
    reference=3,
    unit=1,
    zero=1,
    spare=2,
)
pool_header_at = record_view(POOL_HEADER_RECORD)
SCALE = place_of(POOL_HEADER_RECORD, "scale")
REFERENCE = place_of(POOL_HEADER_RECORD, "reference")
UNIT = place_of(POOL_HEADER_RECORD, "unit")
ZERO = place_of(POOL_HEADER_RECORD, "zero")
POOL_HEADER = size_of(POOL_HEADER_RECORD)
# Figures that a solve leaves in its state, behind poses, tracked values, multipliers and residuals.
RESULTS = 12
