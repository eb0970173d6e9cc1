"""Contacts of a solution that are near, as a proof takes them, and what opens them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.packing.corners import body_of
from assembly.proximity.clearance.answers import Contacts
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.touching import move_apart
from assembly.proximity.extrema.pairs import ContactPair
from assembly.solve.contact_pairs import ContactRows, contact_pairs, listed_contacts, rows_of_contacts

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = ["NEAR", "near_contacts", "opening_move"]

Array = NDArray[np.float64]
# Contacts that are open by less than so many times how far a body may be moved are in its way.
NEAR = 2.0


def _contacts(solution: Solution, rows: Sequence[tuple[int, int]]) -> Iterator[tuple[int, ContactPair, float]]:
    """Contacts of a solution between bodies that clearances keep apart: the pair, the contact, -1 if it is turned."""
    scene, sides = solution._scene, solution._packed.kept_pairs
    for number, _, contact in listed_contacts(solution):
        # Behind them are corners of contacts, of which nothing is proven.
        if number < len(rows):
            yield number, contact, 1.0 if scene.index(body_of(sides[number][0])) == rows[number][0] else -1.0
    if not scene.contacts:
        return
    places = {pair: number for number, pair in enumerate(rows)}
    found = contact_pairs(solution)
    for item in scene.contacts:
        f, g = (scene.index(body) for body in item.bodies)
        if (f, g) in places:
            yield places[f, g], found[item.name], 1.0
        elif (g, f) in places:
            yield places[g, f], found[item.name], -1.0


def _near_rows(rows: ContactRows, proof: ClearanceProof, reach: float) -> dict[int, Contacts]:
    """What `near_contacts` says of contacts that are rows."""
    places = {pair: number for number, pair in enumerate(proof.pairs)}
    near: dict[int, list[int]] = {}
    turned = []
    gaps, minimum = rows.gaps.tolist(), proof.minimum.tolist()
    for k, (pair, (f, g)) in enumerate(zip(rows.pairs.tolist(), rows.bodies.tolist(), strict=True)):
        # Behind the pairs of clearances are corners of contacts, of which nothing is proven.
        number = places.get((f, g), places.get((g, f), -1)) if pair < 0 else pair
        if 0 <= number < len(minimum) and gaps[k] - minimum[number] < reach:
            near.setdefault(number, []).append(k)
            # A proof may have the pair the other way round (`proven_pairs`).
            if (f, g) != proof.pairs[number]:
                turned.append(k)
    normals, points = rows.normals.copy(), rows.points[:, 1].copy()
    normals[turned], points[turned] = -normals[turned], rows.points[turned, 0]
    return {
        number: Contacts(normals[some], points[some], rows.gaps[some] - minimum[number])
        for number, some in near.items()
    }


def near_contacts(solution: Solution, proof: ClearanceProof, reach: float) -> dict[int, Contacts]:
    """The contacts of a solution that are open by less than a reach, by the number of their pair of bodies."""
    rows = rows_of_contacts(solution)
    if rows is not None:
        return _near_rows(rows, proof, reach)
    near: dict[int, list[tuple[Array, Array, float]]] = {}
    for number, contact, sign in _contacts(solution, proof.pairs):
        gap = contact.gap - float(proof.minimum[number])
        if gap < reach:
            near.setdefault(number, []).append((sign * contact.normal, contact.points[1 if sign > 0.0 else 0], gap))
    return {number: Contacts(*(np.array(c) for c in zip(*found, strict=True))) for number, found in near.items()}


def opening_move(proof: ClearanceProof, k: int, q: Array, contacts: Contacts | None, depth: float) -> Array:
    """The least move (6) of the second body of pair k, by no more than a depth, that opens contacts; zero if none does.

    Of those that are near it opens what is closed, and closes none.
    """
    if contacts is None or depth <= 0.0:
        return np.zeros(6)
    near = contacts.gaps < NEAR * depth
    if not near.any():
        return np.zeros(6)
    move = move_apart(proof, k, q, Contacts(*(column[near] for column in contacts)), depth)
    return np.zeros(6) if move is None else move
