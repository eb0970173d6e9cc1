"""The sides of contacts and clearances of a scene, and how many rows they have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact import Contact, lone_surfaces, side_face
from assembly.constraints.model.objectives import Objective
from assembly.constraints.packing import manager as manager_packing
from assembly.constraints.packing.corners import ContactCorners, Kept, SidePair, check_gaps, corners_of
from assembly.constraints.packing.places import names_of_whole
from assembly.kinematics.body import Body

__all__ = ["SceneContents"]


class SceneContents:
    """Contacts of a scene, and what its clearances and the corners of its contacts keep apart.

    Attributes
    ----------
    contacts : list of Contact
    crowding : int
        How many times as many places as they ask for clearances have.
    domains : list of (4, 2) array or None
        Of every contact of two surfaces the ranges of their parameters.
    sides : list of (Body or BodyFace, Body or BodyFace)
        The sides of every contact; faces where it is one of whole surfaces.
    whole : list of bool
        Whether a contact is one of two whole surfaces, without edges.
    clearances : list of Clearance
    clearance_pairs : list of list of (Body, Body)
        The pairs of bodies of every clearance.
    keeps_apart : bool
        Whether a clearance keeps two bodies apart, so that ends of solves are to be proven.
    corners : list of ContactCorners
        Contacts whose corners are listed.
    kept : list of Kept
        Clearances, and then corners: what the contact manager lists contacts for.
    pairs_of_kept : list of list of (side, side)
        The pairs of each.
    kept_pairs : list of (side, side)
        All pairs that are kept apart, in the order of the contact manager.
    clearance_rows : int
        Rows of clearances and corners, behind those of contacts.
    """

    def _take_contents(
        self,
        bodies: Sequence[Body],
        constraints: Sequence[Constraint],
        objectives: Sequence[tuple[float, Objective]],
        places: int,
        corners: bool,
    ) -> None:
        """Keep them; see `Packed` for what is given."""
        self.contacts = [constraint for constraint in constraints if isinstance(constraint, Contact)]
        # Of a contact with trims or places the surfaces take part without their own boundaries.
        trimmed = names_of_whole(constraints, objectives)
        self.whole = [contact.name in trimmed or not contact.edges for contact in self.contacts]
        self.sides = [
            (side_face(contact.a), side_face(contact.b)) if whole else (contact.a, contact.b)
            for contact, whole in zip(self.contacts, self.whole, strict=True)
        ]
        surfaces = [lone_surfaces(pair) for pair in self.sides]
        self.domains = [None if pair is None else np.array([d for s in pair for d in s.domain]) for pair in surfaces]
        self.clearances = [constraint for constraint in constraints if isinstance(constraint, Clearance)]
        self.clearance_pairs = manager_packing.clearance_pairs(self.clearances, bodies)
        self.keeps_apart = any(self.clearance_pairs)
        check_gaps(self.contacts, self.clearances, self.clearance_pairs)
        listed = corners_of(self.contacts, self.whole, self.clearances, self.clearance_pairs) if corners else []
        self.corners: list[ContactCorners] = listed
        self.kept: list[Kept] = [*self.clearances, *listed]
        self.pairs_of_kept: list[Sequence[SidePair]] = [*self.clearance_pairs, *([item.pair] for item in listed)]
        self.kept_pairs = [pair for own in self.pairs_of_kept for pair in own]
        self.places = [
            places * manager_packing.slot_count(item, pairs)
            for item, pairs in zip(self.kept, self.pairs_of_kept, strict=True)
        ]
        self.clearance_rows = sum(self.places)
        self.crowding = places

    @property
    def pair_rows(self) -> int:
        """Rows of contacts, given ones and those of clearances."""
        return len(self.contacts) + self.clearance_rows

    def pair_name(self, k: int) -> str:
        """The name of the contact, or the clearance, that row k is of."""
        names = [contact.name for contact in self.contacts]
        for item, count in zip(self.kept, self.places, strict=True):
            names += [item.name] * count
        return names[k]
