"""The picture of an interference report: bodies that cross in red, the others faint, and the places."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from assembly.studies.interference.clash import Clash, Interference, Kind
from assembly.view.item import Color, Item, Place
from assembly.view.marks import ball
from assembly.view.skeleton import MARK, line

__all__ = ["clash_items", "crossing_bodies", "shown_as"]

_CROSSING: Color = (0.90, 0.10, 0.10)
_BESIDE: Color = (0.72, 0.74, 0.78)
_MARKS: Mapping[Kind, Color] = {
    "crossing": (0.55, 0.00, 0.12),
    "enclosed": (0.55, 0.00, 0.12),
    "touching": (1.00, 0.72, 0.10),
    "clear": (0.10, 0.60, 0.32),
}
# Opacities of bodies that cross and of the others: what is inside bodies has to be visible.
_SOLID, _FAINT = 0.45, 0.25


def crossing_bodies(report: Interference) -> set[str]:
    """Names of the bodies that cross another one, or of which one is inside the other, without being allowed to."""
    wrong = (row for row in report if row.kind in ("crossing", "enclosed") and row.relation != "excluded")
    return {name for row in wrong for name in row.bodies}


def shown_as(report: Interference) -> dict[str, tuple[Color, float]]:
    """Color and opacity of every body, by name."""
    crossing = crossing_bodies(report)
    return {
        body.name: (_CROSSING, _SOLID) if body.name in crossing else (_BESIDE, _FAINT) for body in report.scene.bodies
    }


def clash_items(report: Interference, place: Place) -> Iterator[Item]:
    """A ball at either point of every row, and a rod between them."""
    for row in report:
        if row.points is not None:
            yield from _clash(row, place)


def _clash(row: Clash, place: Place) -> Iterator[Item]:
    assert row.points is not None
    name, color = " / ".join(row.bodies), _MARKS[row.kind]
    said = f"{' and '.join(row.bodies)}: {row.kind}"
    a, b = place(row.points)
    size = np.full(3, 1.4 * MARK)
    yield Item(("places", name, "point"), ball(), color, a, scale=size, in_front=True, said=said)
    yield Item(("places", name, "other point"), ball(), color, b, scale=size, in_front=True, said=said)
    if np.linalg.norm(b - a) > 2.0 * MARK:
        yield line(("places", name, "between"), a[None], b[None], 0.4 * MARK, color, in_front=True)
