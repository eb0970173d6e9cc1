"""The layout of a packed scene: one table of integers and one pool of doubles.

All lengths in a program are divided by the scene's length scale. Table: a header, the block of unknowns of every body
(-1: fixed), then a record a row (contacts first, then trims), a joint, a tape and an objective term. The loop works on
iterates (`Iterate`), of

    q              (n, 7)       poses, scaled, positions relative to a reference
    tracked        (k, TRACK)   a `TRACKED_PAIR` of every contact (`proximity/features/solid_contact.py`), then angles
                                of joints, counted on past whole turns, in the first column, then there the sides
                                that rows of trims are of (`trim_sides.py`)
    records        (k + j, R)   what the derivatives of gaps need (see `track_contact`), then frames of joints, then
                                one of trims that are vectors
    residual       (m,)         rows: contacts, trims, joints, tapes; behind them four for every free pair
    jacobian       (m, 16 + e)  in the twists of a row's two bodies (12), a free pair's coordinates (4), further bodies
"""

from __future__ import annotations

from collections import namedtuple

from assembly._record import place_of, record_dtype, record_view, size_of

# Header of the table. `x_table` says where part x begins, `x_address` where a kernel is in memory that few scenes need
# (`_address.call_address`).
HEADER_RECORD = record_dtype(
    "i8",
    bodies=1,  # how many
    moving=1,  # bodies that are not fixed
    contacts=1,  # rows of contacts, given ones and those of clearances; they come first
    tracked=1,  # rows of tracked values: contacts, then angles, then sides of loops with corners
    joints=1,
    rows=1,  # constraint residuals in all
    tapes=1,  # users' expressions that are constraints
    terms=1,  # terms of the objective
    extra=1,  # twists beyond two that a row of the Jacobian has place for
    unknown_blocks=1,  # where a list begins: of every body the number of its block of six unknowns; negative: fixed
    row_table=1,
    joint_table=1,
    tape_table=1,
    term_table=1,
    tape_workspace=1,  # where the sizes of the workspace of tapes are: inputs, outputs, intermediate values
    gather_table=1,  # how scattered bodies are put together (`solve/loop/initial_guess.py`)
    implicit=1,  # 1: the user gave no objective; it is the least move
    dexterities=1,  # terms that are dexterities
    trims=1,  # rows of trims, which follow those of contacts
    vector_trims=1,  # 1: some are vectors, which take one more record
    track_address=1,  # carries a contact of solids along
    search_address=1,  # finds the pair of a contact of solids anywhere
    nearest_address=1,  # the nearest features of two solids
    deepest_address=1,  # the same of solids that are in each other; 0: not needed yet
    trim_rows_address=1,  # rows of trims
    trim_terms_address=1,  # their second derivatives
    trim_sides_address=1,  # chooses the sides of loops with corners; 0: no loop has any
    first_side=1,  # first row of tracked values that has sides of loops, behind those of angles
    first_clearance_row=1,  # first row of a clearance, among those of contacts; one without bodies is idle
    clearance_rows=1,  # how many rows clearances have
    manager_record=1,  # the contact manager (`proximity/manager/update.py`); -1: no clearance
    update_address=1,  # its update
    clock_address=1,  # tells the time [ns]; 0: nothing does
    block_record=1,  # the layout of a large scene's Hessian (`hessian_blocks.py`); 0: it is dense
    block_length=1,  # how long that is
    contact_rows_address=1,  # rows of contacts
    start_address=1,  # a global start of a contact of two surfaces
    lengths_address=1,  # lengths of a lifted pair's coordinates
    free_row_address=1,  # rows of a lifted pair
    free_terms_address=1,  # their second derivatives
    extremal_address=1,  # whether a lifted pair is extremal
    stayed_address=1,  # whether an update left a lifted pair where it was
    parts_address=1,  # parts of motion bounds that bodies have used
    went_address=1,  # whether bodies went farther than a contact was open
    run_tape_address=1,  # runs a tape
    place_terms_address=1,  # terms of the objective that are places of contacts; 0: there are none
    kept=1,  # where in a state stands what a solve leaves for the next one (`kept.py`)
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
UNKNOWN_BLOCKS = place_of(HEADER_RECORD, "unknown_blocks")
ROW_TABLE = place_of(HEADER_RECORD, "row_table")
JOINT_TABLE = place_of(HEADER_RECORD, "joint_table")
TAPE_TABLE = place_of(HEADER_RECORD, "tape_table")
TERM_TABLE = place_of(HEADER_RECORD, "term_table")
TAPE_WORKSPACE = place_of(HEADER_RECORD, "tape_workspace")
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
TRIM_SIDES_AT = place_of(HEADER_RECORD, "trim_sides_address")
FIRST_SIDE = place_of(HEADER_RECORD, "first_side")
FIRST_CLEARANCE_ROW = place_of(HEADER_RECORD, "first_clearance_row")
CLEARANCE_ROWS = place_of(HEADER_RECORD, "clearance_rows")
MANAGER_RECORD = place_of(HEADER_RECORD, "manager_record")
UPDATE_AT = place_of(HEADER_RECORD, "update_address")
CLOCK_AT = place_of(HEADER_RECORD, "clock_address")
BLOCK_RECORD = place_of(HEADER_RECORD, "block_record")
BLOCK_LENGTH = place_of(HEADER_RECORD, "block_length")
CONTACT_ROWS_AT = place_of(HEADER_RECORD, "contact_rows_address")
START_AT = place_of(HEADER_RECORD, "start_address")
EXTREMAL_AT = place_of(HEADER_RECORD, "extremal_address")
STAYED_AT = place_of(HEADER_RECORD, "stayed_address")
PARTS_AT = place_of(HEADER_RECORD, "parts_address")
WENT_AT = place_of(HEADER_RECORD, "went_address")
RUN_TAPE_AT = place_of(HEADER_RECORD, "run_tape_address")
PLACE_TERMS_AT = place_of(HEADER_RECORD, "place_terms_address")
KEPT = place_of(HEADER_RECORD, "kept")
HEADER = size_of(HEADER_RECORD)
# A row, of any kind. Row k is that of contact k. Fields of its kind stand behind these.
ROW = 16
EVERY_ROW: dict[str, int | tuple[int, ...]] = dict(
    kind=1,  # CONTACT_ROW, ...
    body_f=1,  # -1: none
    body_g=1,  # -1: none
    one_sided=1,  # 1: residual >= 0
    drive=1,  # 1: it prescribes a joint coordinate
    is_length=1,  # 1: the residual is a length
)
ROW_RECORD = record_dtype("i8", **EVERY_ROW)
row_at = record_view(ROW_RECORD)
KIND = place_of(ROW_RECORD, "kind")
BODY_F = place_of(ROW_RECORD, "body_f")
BODY_G = place_of(ROW_RECORD, "body_g")
ONE_SIDED = place_of(ROW_RECORD, "one_sided")
DRIVE = place_of(ROW_RECORD, "drive")
IS_LENGTH = place_of(ROW_RECORD, "is_length")
CONTACT_ROW, JOINT_ROW, TAPE_ROW, TRIM_ROW = 0, 1, 2, 3
# A row of a contact, given or a clearance's.
CONTACT_ROW_RECORD = record_dtype(
    "i8",
    **EVERY_ROW,
    surface_f=1,  # -1: of solids
    surface_g=1,
    shell_f=1,  # -1: of two surfaces
    shell_g=1,
    minimum=1,  # where the gap that counts as none is in the pool
    clearance_number=1,  # of a clearance's row: the number of the contact it has now; 0: none
)
contact_row_at = record_view(CONTACT_ROW_RECORD)
SURFACE_F = place_of(CONTACT_ROW_RECORD, "surface_f")
SURFACE_G = place_of(CONTACT_ROW_RECORD, "surface_g")
SHELL_F = place_of(CONTACT_ROW_RECORD, "shell_f")
SHELL_G = place_of(CONTACT_ROW_RECORD, "shell_g")
MINIMUM = place_of(CONTACT_ROW_RECORD, "minimum")
CLEARANCE_ROW_NUMBER = place_of(CONTACT_ROW_RECORD, "clearance_number")
# A row of a trim.
TRIM_ROW_RECORD = record_dtype(
    "i8",
    **EVERY_ROW,
    contact=1,  # whose coordinates are kept
    side=1,  # 0: on the face of f, 1: of g
    loop=1,  # -1: of a place
    factor=1,  # where the factor of the residual is in the pool; of a place its record there
    form=1,  # SIGNED, ...
    count=1,  # rows that the trim has; its first one says
    edges=1,  # records of the loop's curves as edges
    by_length=1,  # 1: a vector counts by its signed length
    sides=1,  # a `LOOP_SIDES` of a loop with corners; -1: it has none
    slot=1,  # 0: of the side that the contact is on, 1: of the one that this meets at the corner next to it;
    # of a place the number of its row
)
trim_row_at = record_view(TRIM_ROW_RECORD)
TRIM_PAIR = place_of(TRIM_ROW_RECORD, "contact")
TRIM_LENGTH = place_of(TRIM_ROW_RECORD, "by_length")
# Forms of trims (`trim.py`), and places (`place.py`), whose rows stand among them.
SIGNED, PARAMETRIC, CARTESIAN, BETWEEN, AT_PLACE = 0, 1, 2, 3, 4
# The sides of a loop with corners, which two rows are of: see `trim_sides.py`.
LOOP_SIDES = record_dtype(
    "i8",
    count=1,
    sides=1,  # where records of sides begin
    stretches=1,  # how many parts of boundary curves there are, each on one side
    stretch_table=1,  # where their records begin
    place=1,  # behind the first row of tracked sides: the row that has the side of slot 0, the next that of slot 1
    neighbor=1,  # where the row of slot 1 is, behind the first one of the trim
)
loop_sides_at = record_view(LOOP_SIDES)
# A side: a smooth part of a loop, with a straight extension at each end.
SIDE_FIELDS = record_dtype(
    "i8",
    loop=1,  # a trim of the side alone
    edges=1,  # its curve as an edge; -1 where the form has no use for it
    before=1,  # the side that it meets at its start
    after=1,  # and at its end
    turn_before=1,  # how the loop turns there: 1 to the left, -1 to the right, 0: it is smooth
    turn_after=1,
    range=1,  # where in the pool the two parameters are between which it is the loop's
)
side_at = record_view(SIDE_FIELDS)
SIDE = size_of(SIDE_FIELDS)
# The part of a boundary curve that is on a side.
STRETCH_FIELDS = record_dtype(
    "i8",
    curve=1,  # number of the curve
    side=1,
    range=1,  # where in the pool its two parameters are
)
stretch_at = record_view(STRETCH_FIELDS)
STRETCH = size_of(STRETCH_FIELDS)
# A row of a joint: factor * coordinate + factor' * second coordinate - value.
JOINT_ROW_RECORD = record_dtype(
    "i8",
    **EVERY_ROW,
    coordinate=1,  # from here on a `COORDINATE_RECORD`: kind
    component=1,
    joint=1,
    angle=1,
    parameters=1,  # where the two factors and the value are in the pool
    second=1,  # where the record of a second coordinate is, which has bodies of its own; -1: none
)
joint_row_at = record_view(JOINT_ROW_RECORD)
COORDINATE = place_of(JOINT_ROW_RECORD, "coordinate")
# A coordinate of a joint.
COORDINATE_RECORD = record_dtype(
    "i8",
    kind=1,  # `primitives.py`
    component=1,
    joint=1,  # the joint that has its frames
    angle=1,  # row of tracked values where its angle is unwrapped; -1: it is none
)
coordinate_at = record_view(COORDINATE_RECORD)
# A coordinate with bodies of its own: the second one of a row, an input of a dexterity.
BODY_COORDINATE = record_dtype(
    "i8",
    kind=1,  # these four as in `COORDINATE_RECORD`
    component=1,
    joint=1,
    angle=1,
    body_f=1,
    body_g=1,
)
body_coordinate_at = record_view(BODY_COORDINATE)
# A joint.
JOINT_FIELDS = record_dtype(
    "i8",
    body_f=1,
    body_g=1,
    frames=1,  # where its two frames are in the pool
)
joint_at = record_view(JOINT_FIELDS)
JOINT_RECORD = size_of(JOINT_FIELDS)
# A tape: a user's expression, or several that are constraints together.
TAPE_FIELDS = record_dtype(
    "i8",
    first_order=1,  # instructions for values and Jacobian
    second_order=1,  # instructions for the Hessian
    values=1,  # how many
    bodies=1,  # how many
    body_list=1,  # where they are listed
    first_row=1,
    unit=1,  # where the size of one unit is in the pool
    spare=1,
)
tape_at = record_view(TAPE_FIELDS)
TAPE_RECORD = size_of(TAPE_FIELDS)
# Columns of the Jacobian; behind these the twists of further bodies.
JACOBIAN_ROW = record_dtype(
    "f8",
    twist_f=6,
    twist_g=6,
    lifted=4,  # coordinates of a lifted pair
)
jacobian_row_at = record_view(JACOBIAN_ROW)
FREE_COLUMN, EXTRA_COLUMN = place_of(JACOBIAN_ROW, "lifted"), size_of(JACOBIAN_ROW)
# Header of the pool.
POOL_HEADER_RECORD = record_dtype(
    "f8",
    scale=1,  # length that scaled lengths are parts of [length]
    reference=3,  # point that scaled positions are relative to [length]
    unit=1,  # what the objective's scaled value of one counts [its unit]
    zero=1,  # always zero: a least gap that is none
    version=1,  # the same number: all in the pool is the same but values, targets and references of postures
    spare=1,
)
pool_header_at = record_view(POOL_HEADER_RECORD)
SCALE = place_of(POOL_HEADER_RECORD, "scale")
REFERENCE = place_of(POOL_HEADER_RECORD, "reference")
OBJECTIVE_UNIT = place_of(POOL_HEADER_RECORD, "unit")
ZERO = place_of(POOL_HEADER_RECORD, "zero")
VERSION = place_of(POOL_HEADER_RECORD, "version")
POOL_HEADER = size_of(POOL_HEADER_RECORD)
# Figures that a solve leaves in its state, behind poses, tracked values, multipliers and residuals.
RESULTS = 12

# A point of the loop: the current iterate or a trial one. See the heading.
Iterate = namedtuple("Iterate", "q tracked records residual jacobian")
# What contacts work in. `free` has for every contact its number among lifted pairs (-1: it is none), `lengths` those
# of its coordinates; `vectors` and `variables` are room for its derivatives; `guess` are tracked values that a step
# expects, `memory` is what the contact manager remembers.
LiftedPairs = namedtuple("LiftedPairs", "free lengths vectors variables guess memory")
# What stays as it is for a whole solve. `structure`: where rows and unknowns stand (`solve/loop/residuals.py`; None:
# that is not known yet); `end_effectors`: None where no term of the objective is a dexterity.
Program = namedtuple("Program", "store structure lifted tapes end_effectors")
# What the instructions of tapes work in.
TapeWorkspace = namedtuple("TapeWorkspace", "inputs outputs work")
# Where the Hessian of the Lagrangian and its factor have entries (`envelope.py`).
Sparsity = namedtuple("Sparsity", "places folds scratch blocks")
