"""States of an earlier packing of a scene: of another size, or with fewer slots for contacts of clearances.

Another scene with the same bodies and rows (a pickle of this one, one that was built again) may give a state as well,
and so may this one from before coordinates of joints became driven, free or limited.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.features.solid_contact import TRACK

if TYPE_CHECKING:
    from assembly.constraints.model.constraint import Equation
    from assembly.constraints.packing.scene import Packed

__all__ = [
    "adopted",
    "differs_in_joints",
    "handed_over",
    "is_alike",
    "is_earlier",
    "is_same_scene",
    "stretch",
    "taken_over",
    "with_numbers_of",
]

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
    return _without_pairs_of_others(other, packed, taken_over(other, packed, state))


def differs_in_joints(one: Packed, packed: Packed) -> bool:
    """Whether two scenes of the same constraints have the same unknowns, and rows but for those of joints."""
    counts = [
        (each.is_implicit, len(each.contacts), each.trims, _joint_rows(each).stop - each.rows, _sides(each).size)
        for each in (one, packed)
    ]
    return counts[0] == counts[1] and np.array_equal(one.unknown_blocks, packed.unknown_blocks)


def handed_over(earlier: Packed, packed: Packed, state: Array) -> tuple[Array, bool]:
    """A state of a scene with other rows of joints (`differs_in_joints`) in the one of now, and whether it is complete.

    Angles keep their turns, and rows that both have their multipliers. Where an angle was not looked for before the
    state is not complete: its turn is to be chosen as at poses.
    """
    taken = packed.new_state()
    taken[: packed.contacts_at] = state[: earlier.contacts_at]
    given = len(packed.contacts)
    pairs = slice(packed.contacts_at, packed.contacts_at + TRACK * given)
    taken[pairs] = state[pairs]
    turns = dict(zip(earlier._angles, state[earlier.angles], strict=True))
    taken[packed.angles] = [turns.get(angle, 0.0) for angle in packed._angles]
    taken[_sides(packed)] = state[_sides(earlier)]
    multipliers = np.zeros(packed.rows)
    before, rows, others = state[earlier.multipliers_at :], _joint_rows(packed), _joint_rows(earlier)
    multipliers[:given] = before[:given]
    multipliers[rows.start - packed.trims : rows.start] = before[others.start - packed.trims : others.start]
    pushed = dict(zip(map(_row, earlier._values), before[others.start : others.stop], strict=True))
    multipliers[rows.start : rows.stop] = [pushed.get(_row(value), 0.0) for value in packed._values]
    multipliers[rows.stop :] = before[others.stop : earlier.rows]
    multipliers *= earlier.unit / packed.unit
    multipliers[packed.lengths] *= packed.scale / earlier.scale
    taken[packed.multipliers_at : packed.residuals_at] = multipliers
    is_complete = all(angle in turns for angle in packed._angles)
    return _without_pairs_of_others(earlier, packed, taken), is_complete


def _joint_rows(packed: Packed) -> range:
    """The numbers of the rows that joints and couplings have."""
    first = len(packed.contacts) + packed.clearance_rows + packed.trims
    return range(first, first + len(packed._values))


def _sides(packed: Packed) -> NDArray[np.int64]:
    """Where a state has what is tracked of sides of trims."""
    return np.arange(packed.angles_at + TRACK * len(packed._angles), packed.multipliers_at)


def _row(value: tuple[Equation, int, float]) -> tuple[object, ...]:
    """What a row asks for, whatever its number."""
    equation = value[0]
    return *equation.terms, equation.source and equation.source[1]


def _without_pairs_of_others(other: Packed, packed: Packed, taken: Array) -> Array:
    """A state taken from another scene, where pairs of other faces are to be found anew."""
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
