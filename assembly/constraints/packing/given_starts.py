"""Pairs of contacts in the state in which a solve begins: those that the user names, and tangents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.model.contact import lone_surfaces
from assembly.constraints.model.tangent import ContactTangent
from assembly.errors import InputError, vector
from assembly.kinematics.body import Body
from assembly.proximity.extrema.pairs import inside
from assembly.proximity.features.solid_contact import TRACK

if TYPE_CHECKING:
    from assembly.constraints.packing.scene import Packed

__all__ = ["place_starts", "place_tangents"]

Array = NDArray[np.float64]


def place_tangents(packed: Packed, bodies: Sequence[Body], state: Array) -> None:
    """Start tangents at pairs on the side that they ask for."""
    for k, contact in enumerate(packed.contacts):
        if isinstance(contact, ContactTangent) and not contact.edges:
            q = state[: packed.contacts_at].reshape(-1, 7)
            rows = (q[bodies.index(body)].copy() for body in (contact.body_a, contact.body_b))
            start = contact.start_at(*rows)
            if start is not None:
                at = packed.contacts_at + TRACK * k
                state[at : at + 4] = start
                state[at + 4 : at + TRACK] = 0.0


def place_starts(packed: Packed, state: Array, starts: Mapping[str, ArrayLike]) -> None:
    """Start contacts at the pairs that a user names."""
    if not isinstance(starts, Mapping):
        raise TypeError(f"starts is {starts!r}; expected a mapping of constraint name to parameters")
    names = [contact.name for contact in packed.contacts]
    for name, value in starts.items():
        if name not in names:
            known = ", ".join(map(repr, names)) or "none, the assembly has no contacts"
            raise InputError(f"starts names {name!r}; expected a contact: {known}")
        k = names.index(name)
        at = packed.contacts_at + TRACK * k
        what = f"starts[{name!r}]"
        surfaces = lone_surfaces(packed.sides[k])
        if surfaces is None:
            raise InputError(f"{what} is of solids with several faces; expected a contact of two faces")
        state[at : at + 4] = inside(what, vector(what, value, 4), surfaces)
        state[at + 4 : at + TRACK] = 0.0
        # Rows that the last solve left are of other pairs.
        state[packed.kept_at :] = 0.0
