"""Places of contacts as the pool has them (`constraints/program/place.py`)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact_place import ContactPlace
from assembly.constraints.model.objectives import Objective
from assembly.constraints.model.trim_contact import TrimContact

__all__ = ["names_of_whole", "place_numbers"]


def place_numbers(place: ContactPlace, weight: float, scale: float) -> list[float]:
    """A `PLACE_FIELDS`: weight, target, periods, and the stretch over the scene's size."""
    target = [0.0 if part is None else part for part in place.target]
    stretch = np.zeros((2, 2))
    stretch[: place.rows] = place.stretch / scale
    return [weight, *target, *place.face.surface._periods, *stretch.ravel().tolist()]


def names_of_whole(constraints: Iterable[Constraint], objectives: Iterable[tuple[float, Objective]] = ()) -> set[str]:
    """Contacts that are of whole surfaces, because trims or places say where on these they are."""
    asked = [item for item in constraints if isinstance(item, (TrimContact, ContactPlace))]
    minimized = [term for _, term in objectives if isinstance(term, ContactPlace)]
    return {item.contact.name for item in (*asked, *minimized)}
