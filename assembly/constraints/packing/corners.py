"""Pairs of bodies that a scene's contact manager lists: those of clearances, and those with corners of contacts.

The gap of a contact of solids is that of the features that are nearest. Where a body comes to lie on another one,
several are, and the gap has a kink: a row of the nearest one alone points to where another one is deeper. So a contact
of solids may have its corners listed as well, each a row gap >= 0 of features that do not switch. At the kink those
that carry have multipliers of their own, and the contact's row says that one of them touches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import Contact, side_faces
from assembly.constraints.model.tracked_sizes import check_size
from assembly.errors import InputError
from assembly.kinematics.body import Body, BodyFace
from assembly.proximity.brep.solid import is_one_smooth

__all__ = ["ContactCorners", "Kept", "SidePair", "body_of", "check_gaps", "corners_of"]

Side = Body | BodyFace
SidePair = tuple[Side, Side]
# Corners of one contact that may be near at a time; a solve that needs more begins again with four times as many.
SLOTS = 12


class Kept(Protocol):
    """Pairs of bodies that are kept apart: a `Clearance`, or the corners of a contact."""

    @property
    def name(self) -> str:
        """What its rows are called."""

    @property
    def minimum(self) -> float:
        """The least gap."""

    @property
    def merge_radius(self) -> float:
        """See `Clearance`."""

    @property
    def slots(self) -> int | None:
        """See `Clearance`."""

    @property
    def corners(self) -> bool:
        """Whether corners over faces are listed besides extrema."""


@dataclass(frozen=True)
class ContactCorners:
    """The corners of a contact of solids; see `Kept`."""

    contact: Contact
    merge_radius: float = 1e-6
    slots: int = SLOTS
    corners: bool = True

    @property
    def name(self) -> str:
        """That of the contact, which its corners are part of."""
        return self.contact.name

    @property
    def minimum(self) -> float:
        """That of the contact."""
        return self.contact.minimum

    @property
    def pair(self) -> SidePair:
        """The sides of the contact."""
        return self.contact.a, self.contact.b


def corners_of(
    contacts: Sequence[Contact],
    whole: Sequence[bool],
    clearances: Sequence[Clearance],
    pairs_of_clearances: Sequence[Sequence[tuple[Body, Body]]],
) -> list[ContactCorners]:
    """The corners of all contacts of solids that have none yet, and of which one body moves.

    Not of contacts of `whole` surfaces, which have no corners, and not where a clearance of the same two bodies lists
    them; nor of bodies of sizes that contact managers cannot have.
    """
    listed = {
        frozenset(map(id, pair))
        for clearance, pairs in zip(clearances, pairs_of_clearances, strict=True)
        for pair in pairs
        if clearance.corners
    }
    found = []
    for contact, is_whole in zip(contacts, whole, strict=True):
        sides = contact.a, contact.b
        fixed = contact.body_a.fixed and contact.body_b.fixed
        known = frozenset(map(id, contact.bodies)) in listed
        smooth = all(is_one_smooth(side_faces(side)) for side in sides)
        if not (is_whole or fixed or known or smooth) and all(_has_size(body) for body in contact.bodies):
            found.append(ContactCorners(contact))
    return found


def check_gaps(
    contacts: Sequence[Contact],
    clearances: Sequence[Clearance],
    pairs_of_clearances: Sequence[Sequence[tuple[Body, Body]]],
) -> None:
    """Raise where a contact with a least gap is of two bodies that a clearance has: whose gap it is nobody says."""
    for contact in contacts:
        for clearance, pairs in zip(clearances, pairs_of_clearances, strict=True) if contact.minimum > 0.0 else ():
            if any({*contact.bodies} == {*pair} for pair in pairs):
                raise InputError(
                    f"contact {contact.name!r} has the minimum {contact.minimum:g} and clearance {clearance.name!r} "
                    "is of its bodies, too; expected exclude=... there, or a minimum of zero"
                )


def _has_size(body: Body) -> bool:
    """Whether a contact manager can list contacts of a body of this size."""
    try:
        check_size(body.name, body)
    except InputError:
        return False
    return True


def body_of(side: Side) -> Body:
    """The body that is a side of a pair, or whose face is."""
    return side if isinstance(side, Body) else side.body
