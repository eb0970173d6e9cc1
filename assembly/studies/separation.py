"""Bodies that cross at the start, moved apart where a clearance requires it.

A clearance keeps bodies apart that are; of bodies deep in each other its rows do not know the way out. The pair that
closes as two bodies come apart (`closest_features`) does: held not to be negative, together with all other constraints,
it leads to a pose where the bodies touch. They may cross at another place there, or other bodies may: it is done again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import Contact
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotate
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.features.features import FeaturePair, FeatureStatus, closest_features
from assembly.solve.interruption import Interruption
from assembly.solve.options import Options

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["separated"]

Array = NDArray[np.float64]
# Rounds of moving apart; after so many of them a pair that still crosses is moved apart by itself first.
ROUNDS, TRIES = 12, 4
# Bodies are moved this part farther than to where they touch: there a search may find no place but that one.
FARTHER = 1e-3
# A closed body with another one in it has a gap that is more negative than touching, and than this part of its size.
WITHIN = -1e-9


@dataclass(frozen=True)
class _Crossing:
    """Two bodies that cross, or of which b is wholly in a, and their pair."""

    a: Body
    b: Body
    pair: FeaturePair
    nested: bool


def separated(scene: Assembly, q: Array, options: Mapping[str, Any], interruption: Interruption) -> Array | None:
    """Where bodies that clearances keep apart are a little farther apart than where they touch, near q; (n, 7).

    All other constraints hold where they touch, if that could be had. None where no bodies cross at q, and where the
    way apart is not found.
    """
    others = [item for item in scene.constraints if not isinstance(item, Clearance)]
    kept_apart = [
        pair for item in scene.constraints if isinstance(item, Clearance) for pair in item.pairs(scene.bodies)
    ]
    rows = {body.name: row for row, body in enumerate(scene.bodies)}
    often: Counter[tuple[str, str]] = Counter()
    contacts: list[Contact] = []
    poses: Array | None = None
    touching = options.get("touching", Options.touching) * scene.packed().scale
    for _ in range(ROUNDS):
        found: list[_Crossing] = []
        for a, b in kept_apart:
            # Of very many pairs this takes longer than a solve.
            if interruption.is_over():
                return poses
            crossing = _crossing(a, b, q, rows, touching)
            if crossing is not None:
                found.append(crossing)
        if not found:
            return poses
        before, q = q, q.copy()
        for crossing in found:
            names = min(crossing.a.name, crossing.b.name), max(crossing.a.name, crossing.b.name)
            often[names] += 1
            if often[names] == 1:
                name = _free_name(scene, len(contacts))
                contacts.append(Contact(crossing.a, crossing.b, name, unilateral=True, edges=True))
            if crossing.nested:
                _push_out(crossing, q, rows)
            elif often[names] > TRIES:
                _part(crossing, q, rows, touching)
        helper = type(scene)(scene.bodies)
        helper._take_constraints([*others, *contacts])
        solution = helper._from_start(q, None, dict(options), interruption)
        if solution.success:
            q = solution.q.copy()
            q[:, :3] += FARTHER * (q - before)[:, :3]
        else:
            often.update(dict.fromkeys(often, TRIES))
        poses = q
    return None


def _crossing(a: Body, b: Body, q: Array, rows: Mapping[str, int], touching: float) -> _Crossing | None:
    """How two bodies cross, if they do, by more than what is called touching."""
    row_a, row_b = q[rows[a.name]], q[rows[b.name]]
    if float(np.linalg.norm(_center(b, row_b) - _center(a, row_a))) > 0.5 * (a.size + b.size):
        return None
    part = min(touching / max(a.size, b.size), 1e-3)
    pair = closest_features(a, b, row_a, row_b, touching=part)
    if pair.status in (FeatureStatus.PENETRATING, FeatureStatus.CROSSING):
        return _Crossing(a, b, pair, nested=False)
    if _is_closed(a) and pair.gap < min(WITHIN, -part) * max(a.size, b.size):
        return _Crossing(a, b, pair, nested=True)
    if _is_closed(b):
        pair = closest_features(b, a, row_b, row_a, touching=part)
        if pair.gap < min(WITHIN, -part) * max(a.size, b.size):
            return _Crossing(b, a, pair, nested=True)
    return None


def _push_out(crossing: _Crossing, q: Array, rows: Mapping[str, int]) -> None:
    """Move one body, which is in the other one, into the nearest wall: from there the contact leads out."""
    a, b, pair = crossing.a, crossing.b, crossing.pair
    _move(crossing, (FARTHER * max(a.size, b.size) - pair.gap) * pair.normal, q, rows)


def _part(crossing: _Crossing, q: Array, rows: Mapping[str, int], touching: float) -> None:
    """Move one body away from the other one until they do not cross."""
    a, b = crossing.a, crossing.b
    away = _center(b, q[rows[b.name]]) - _center(a, q[rows[a.name]])
    far = float(np.linalg.norm(away))
    way = away / far if far > FARTHER * a.size else crossing.pair.normal
    step = 0.02 * max(a.size, b.size)
    while _crossing(a, b, q, rows, touching) is not None:
        _move(crossing, step * way, q, rows)
        step *= 2.0


def _move(crossing: _Crossing, way: Array, q: Array, rows: Mapping[str, int]) -> None:
    """Move b along the way, or a against it."""
    if crossing.b.fixed:
        q[rows[crossing.a.name], :3] -= way
    else:
        q[rows[crossing.b.name], :3] += way


def _center(body: Body, row: Array) -> Array:
    """The middle of the box around a body's control points at a pose."""
    boxes = [face.face.surface.bounding_box() for face in body.faces]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    return rotate(row[3:], 0.5 * (low + high)) + row[:3]


def _is_closed(body: Body) -> bool:
    """Whether a body has an inside: no edge is one face's alone."""
    return all(edge.face_b is not None for edge in solid_of(tuple(face.face for face in body.faces)).edges)


def _free_name(scene: Assembly, number: int) -> str:
    """A name that no constraint of the scene has."""
    taken = {item.name for item in scene.constraints}
    name = f"apart {number}"
    while name in taken:
        name += "'"
    return name
