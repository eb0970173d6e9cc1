"""Two bodies as an update sees them: in the axes of the first one, f, where the second one, g, is posed.

Where each body has a value of its own, the field is a pair, that of f and that of g: a kernel that works from one body
to the other takes entries `side` and `1 - side`.
"""

from __future__ import annotations

from collections import namedtuple

from assembly._kernel import kernel
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.manager.records import pair_lengths_of, pair_of, record_of

# store: table and pool of the scene. pose: of g seen from f, shift in lengths over the scene's size.
# surfaces: records of the two surfaces, -1 both where the bodies are B-rep bodies.
# shells: records of the two B-rep bodies, -1 both where the bodies are surfaces.
# trees: records of the trees of patches. centerlines: records of those of two round wires, -1 both of other bodies.
# offsets: the largest distances of facets from the surfaces of the two.
# bodies: their rows in poses, (n, 7). track_solids: address of `features/solid_contact.track_solids`.
PosedPair = namedtuple("PosedPair", "store pose surfaces shells trees centerlines offsets bodies poses track_solids")


@kernel(inline=True)
def posed_pair(manager, p, q):
    """The bodies of pair p of a contact manager at the poses q: for kernels that make no arrays."""
    pair, lengths = pair_of(manager, p), pair_lengths_of(manager, p)
    i, j = pair.body_f, pair.body_g
    return PosedPair(
        store=manager.store,
        pose=relative_pose(q, i, rotation(q, i), j, rotation(q, j)),
        surfaces=(pair.surface_f, pair.surface_g),
        shells=(pair.shell_f, pair.shell_g),
        trees=(pair.tree_f, pair.tree_g),
        centerlines=(pair.centerline_f, pair.centerline_g),
        offsets=(lengths.offset[0], lengths.offset[1]),
        bodies=(i, j),
        poses=q,
        track_solids=record_of(manager).track_solids,
    )
