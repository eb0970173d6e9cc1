"""Records of a contact manager (`proximity/manager/update.py`).

Its record is in the table of integers, what it knows in a memory of doubles:

    header | of every pair a PAIR_STATE | of every slot a PLACE_STATE | events
"""

from __future__ import annotations

from collections import namedtuple

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of

# The record of a contact manager in the table. Places of the pool and the table are absolute.
MANAGER_DTYPE = record_dtype(
    "i8",
    pairs=1,  # number of pairs of bodies
    places=1,  # number of slots for contacts, of all pairs
    pair_table=1,  # where the records of pairs begin in the table
    first=1,  # row of `tracked` that is the first slot
    track_solids=1,  # address of `features/solid_contact.track_solids`
    lengths=1,  # where its lengths are in the pool
    lists=1,  # number of neighbor lists
    list_table=1,  # where these begin in the table
    corners=1,  # 1: vertex contacts are listed as well (`vertex_contacts.py`)
    clock=1,  # address of a kernel that returns the time; 0: updates have no deadline
    mark_address=1,  # address of `contact_place.mark_places`; 0: no contact's bodies have a least gap above zero
    go_on_address=1,  # address of what says between two parts of a long update whether to go on; 0: nobody is asked
)
manager_at = record_view(MANAGER_DTYPE)
PAIRS = place_of(MANAGER_DTYPE, "pairs")
VERTEX_CONTACTS = place_of(MANAGER_DTYPE, "corners")
CLOCK = place_of(MANAGER_DTYPE, "clock")
MARK_AT = place_of(MANAGER_DTYPE, "mark_address")
MANAGER_SIZE = size_of(MANAGER_DTYPE)
# Its answers: go on; end with what there is; stop, because an exception discards everything.
GOES_ON, ENDS, ABORTED = 0, 1, 2
# The lengths of a contact manager in the pool [over the size of the scene].
LENGTHS_DTYPE = record_dtype(
    "f8",
    merge_radius=1,  # merge radius: extrema nearer to each other, and along the surfaces, are one
    least_margin=1,  # the least query margin
    largest_margin=1,  # the largest one, and that of a first update
)
lengths_at = record_view(LENGTHS_DTYPE)
LENGTH_COUNT = size_of(LENGTHS_DTYPE)
# A pair of bodies f and g in the table: two single surfaces, or else two B-rep bodies.
PAIR_DTYPE = record_dtype(
    "i8",
    body_f=1,  # rows of the poses
    body_g=1,
    tree_f=1,  # records of the trees of patches
    tree_g=1,
    surface_f=1,  # records of the surfaces, or -1
    surface_g=1,
    shell_f=1,  # records of the B-rep bodies, or -1
    shell_g=1,
    minimum=1,  # where PAIR_LENGTHS are in the pool
    low=1,  # its slots: the first one
    high=1,  # and the one behind the last
    given=1,  # where the records of given contacts between the two begin (`extrema.py`)
    given_count=1,
    smaller=1,  # which body's motion is measured: 0 f, 1 g, the smaller one
    centerline_f=1,  # records of the centerlines of two round wires, or -1
    centerline_g=1,
)
pair_at = record_view(PAIR_DTYPE)
PAIR_RECORD = size_of(PAIR_DTYPE)
# Lengths of a pair in the pool [over the size of the scene]. If contacts are given, a second record follows IN_PLACE
# behind, with a least gap of zero: for extrema in the place of a given contact.
PAIR_LENGTHS = record_dtype(
    "f8",
    least=1,  # least gap
    curved_bound=1,  # curvature-limited motion bound: motion between updates where contacts may be created
    offset=2,  # how far facets of f, and of g, are from their surfaces
    far=2,  # how far f, and g, reach from their origins
)
pair_lengths_at = record_view(PAIR_LENGTHS)
IN_PLACE = size_of(PAIR_LENGTHS)
# The header of a memory.
MEMORY_DTYPE = record_dtype(
    "f8",
    event_count=1,  # events so far
    updates=1,  # updates of a pair so far
    born=1,  # contacts so far: the number of the last one
    time=1,  # that of the caller
    crowded=1,  # 1: a near extremum once found no slot
    calls=1,  # calls so far
    deadline=1,  # of a tick with a budget: the time after which an update begins no other pair
    earlier=1,  # updates of a pair before that tick
    overlap=1,  # by so much less than the least gap a new contact may stay, as where a solve begins
)
memory_header_at = record_view(MEMORY_DTYPE)
EVENT_COUNT = place_of(MEMORY_DTYPE, "event_count")
CROWDED = place_of(MEMORY_DTYPE, "crowded")
DEADLINE = place_of(MEMORY_DTYPE, "deadline")
OVERLAP = place_of(MEMORY_DTYPE, "overlap")
MEMORY_HEADER = size_of(MEMORY_DTYPE)
# What is known of a pair of bodies since its last update. Motion is that of the smaller body, seen from the other.
PAIR_STATE = record_dtype(
    "f8",
    turn=4,  # how that body was turned, a quaternion; NaN before the first update
    place=3,  # where the middle of its tree was
    motion_bound=1,  # motion bound: until a point of it has moved so far, only listed contacts can touch
    margin=1,  # query margin
    state=1,  # FAR, NEAR or TRACKING
    called=1,  # calls at the last update
    ball=3,  # motion ball: its middle on the body
    ball_radius=1,
    ball_place=3,  # where its middle was
    ball_bound=1,  # motion bound of what is in the ball; infinite: there is no ball
    part=1,  # which part of its motion bounds is used
    sure=1,  # motion of the ball after which an accepted pose needs an update: folds may create contacts
    crossed=1,  # 1: the bodies are in each other where no contact says so; NaN: the last update did not ask
    wanting=1,  # 1: a near extremum found no slot at the last update
    cut_short=1,  # how far a step that was cut since would have gone
    doubt=1,  # motion over that after which an accepted pose needs an update
)
pair_state_at = record_view(PAIR_STATE)
PAIR_TURN = place_of(PAIR_STATE, "turn")
MOTION_BOUND = place_of(PAIR_STATE, "motion_bound")
QUERY_MARGIN = place_of(PAIR_STATE, "margin")
STATE = place_of(PAIR_STATE, "state")
PART = place_of(PAIR_STATE, "part")
CROSSED = place_of(PAIR_STATE, "crossed")
PAIR_MEMORY = size_of(PAIR_STATE)
FAR, NEAR, TRACKING = 0, 1, 2
# A slot for a contact.
PLACE_STATE = record_dtype(
    "f8",
    pair=1,  # its pair of bodies, or -1: it is free
    number=1,  # number of its contact
    given=1,  # 1: that is in the place of a given contact
)
place_at = record_view(PLACE_STATE)
PLACE_PAIR = place_of(PLACE_STATE, "pair")
PLACE_NUMBER = place_of(PLACE_STATE, "number")
PLACE_MEMORY = size_of(PLACE_STATE)
# An event; the last EVENTS are kept.
EVENT_DTYPE = record_dtype(
    "f8",
    kind=1,  # ADDED, ...
    reason=1,  # CAME_NEAR, ...
    pair=1,  # number of the pair of bodies
    number=1,  # of the contact
    gap=1,  # [over the size of the scene]
    time=1,  # that of the caller
)
event_at = record_view(EVENT_DTYPE)
EVENT, EVENTS = size_of(EVENT_DTYPE), 64
ADDED, REMOVED, HANDED_OFF, MERGED, REFUSED = 0, 1, 2, 3, 4
CAME_NEAR, WENT_AWAY, LOST, SAME_EXTREMUM, NO_PLACE = 0, 1, 2, 3, 4
# A contact manager. store: table and pool of its scene; at: where its record is in the table; memory: what it knows.
ContactManager = namedtuple("ContactManager", "store at memory")


@kernel(inline=True)
def memory_places(table, at):
    """Where pairs, slots and events begin in the memory of the manager at a place of the table."""
    record = manager_at(table, at)
    slots = MEMORY_HEADER + PAIR_MEMORY * record.pairs
    return MEMORY_HEADER, slots, slots + PLACE_MEMORY * record.places


@kernel(inline=True)
def record_of(manager):
    """The record of a contact manager."""
    return manager_at(manager.store.table, manager.at)


@kernel(inline=True)
def lengths_of(manager):
    """Its lengths."""
    return lengths_at(manager.store.pool, record_of(manager).lengths)


@kernel(inline=True)
def header_of(manager):
    """The header of its memory."""
    return memory_header_at(manager.memory, 0)


@kernel(inline=True)
def pair_in(table, at, p):
    """The record of pair p of bodies of the manager at a place of the table."""
    return pair_at(table, manager_at(table, at).pair_table + PAIR_RECORD * p)


@kernel(inline=True)
def pair_of(manager, p):
    """The record of its pair p of bodies."""
    return pair_in(manager.store.table, manager.at, p)


@kernel(inline=True)
def pair_lengths_of(manager, p):
    """The lengths of pair p."""
    return pair_lengths_at(manager.store.pool, pair_of(manager, p).minimum)


@kernel(inline=True)
def pair_state_of(manager, p):
    """What is known of pair p."""
    return pair_state_at(manager.memory, MEMORY_HEADER + PAIR_MEMORY * p)


@kernel(inline=True)
def slot_of(manager, k):
    """Slot k for a contact."""
    slots = MEMORY_HEADER + PAIR_MEMORY * record_of(manager).pairs
    return place_at(manager.memory, slots + PLACE_MEMORY * k)
