"""States of an earlier packing of a scene: of another size, or with fewer slots for contacts of clearances.

Another scene with the same bodies and rows (a pickle of this one, one that was built again) may give a state as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.features.solid_contact import TRACK

if TYPE_CHECKING:
    from assembly.constraints.packing.scene import Packed

__all__ = ["adopted", "is_alike", "is_earlier", "is_same_scene", "stretch", "taken_over", "with_numbers_of"]

Array = NDArray[np.float64]


def is_earlier(earlier: Packed, packed: Packed) -> bool:
    """Whether a scene was packed as `earlier` before it was packed as it is now, or with other numbers."""
    if packed.lineage is earlier.lineage:
        return packed is not earlier
    before = packed.before
    while before is not None and before is not earlier:
        before = before.before
    return before is not None


def is_same_scene(one: Packed, packed: Packed) -> bool:
    """Whether one is how a scene is packed now, or was before."""
    return one is packed or is_earlier(one, packed)


def taken_over(earlier: Packed, packed: Packed, state: Array) -> Array:
    """A state of an earlier packing in the one of now: poses, tracked values, and multipliers in its units.

    Contacts that clearances had listed are left out; the contact manager finds those that are near anew.
    """
    taken = packed.new_state()
    taken[: packed.contacts_at] = state[: earlier.contacts_at]
    given = len(packed.contacts)
    pairs = slice(packed.contacts_at, packed.contacts_at + TRACK * given)
    taken[pairs] = state[pairs]
    if given and earlier.lineage is packed.lineage:
        stretch(earlier, packed, taken)
    taken[packed.angles_at : packed.multipliers_at] = state[earlier.angles_at : earlier.multipliers_at]
    # Rows: of contacts, of clearances, of all the rest.
    before, now = given + earlier.clearance_rows, given + packed.clearance_rows
    multipliers = taken[packed.multipliers_at : packed.residuals_at]
    multipliers[:given] = state[earlier.multipliers_at :][:given]
    multipliers[now:] = state[earlier.multipliers_at + before : earlier.residuals_at]
    multipliers *= earlier.unit / packed.unit
    multipliers[packed.lengths] *= packed.scale / earlier.scale
    return taken


def with_numbers_of(packed: Packed, earlier: Packed, state: Array) -> Array:
    """A copy of a state of a twin, which has other numbers in the same places, with multipliers in the units of now.

    What is kept in it for the next solve has the version of the twin, and is not taken for that of now.
    """
    taken = state.copy()
    if packed.unit != earlier.unit or packed.scale != earlier.scale:
        multipliers = taken[packed.multipliers_at : packed.residuals_at]
        multipliers *= earlier.unit / packed.unit
        np.multiply(multipliers, packed.scale / earlier.scale, out=multipliers, where=packed.lengths)
    return taken


def is_alike(one: Packed, packed: Packed) -> bool:
    """Whether two scenes have the same unknowns, rows and tracked values, whatever the numbers in them."""
    unknowns = [each.unknown_blocks.tolist() for each in (one, packed)]
    counts = [(each.tracked - each.pair_rows, len(each._angles), each.is_implicit) for each in (one, packed)]
    return (
        one.count == packed.count and counts[0] == counts[1] and unknowns[0] == unknowns[1] and one.has_rows_of(packed)
    )


def adopted(other: Packed, packed: Packed, state: Array) -> Array:
    """A state of another scene that is alike (`is_alike`) in this one; pairs of other faces are to be found anew."""
    taken = taken_over(other, packed, state)
    nets = [[face.surface.control_points for face in each.faces] for each in (other, packed)]
    if packed.contacts and not all(np.array_equal(a, b) for a, b in zip(*nets, strict=True)):
        taken[packed.contacts_at : packed.contacts_at + TRACK * len(packed.contacts)] = np.nan
    return taken


def stretch(earlier: Packed, packed: Packed, state: Array) -> None:
    """Parameters of contacts where surfaces have other domains now: knots are lengths, and grow with a shape."""
    pairs = slice(packed.contacts_at, packed.contacts_at + TRACK * len(packed.contacts))
    tracked = state[pairs].reshape(-1, TRACK)
    for k, (before, now) in enumerate(zip(earlier.domains, packed.domains, strict=True)):
        if before is not None and now is not None and not np.array_equal(before, now):
            part = (tracked[k, :4] - before[:, 0]) / (before[:, 1] - before[:, 0])
            tracked[k, :4] = now[:, 0] + part * (now[:, 1] - now[:, 0])
