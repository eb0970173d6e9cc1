"""The pairs of a solution's contacts, found again from what the loop tracked."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import side_face, side_faces
from assembly.constraints.packing.corners import Kept, body_of
from assembly.constraints.program.contact import contact_rows
from assembly.constraints.program.records import (
    CONTACTS,
    DEEPEST_AT,
    EXTRA,
    FREE_COLUMN,
    NEAREST_AT,
    ROW,
    ROW_TABLE,
    SHELL_F,
    SHELL_G,
)
from assembly.kinematics.body import Body, BodyFace
from assembly.proximity.extrema.pairs import STATUSES, ContactPair, PairStatus, extremal_pair
from assembly.proximity.extrema.rates import ARM_F, GAP, NORMAL
from assembly.proximity.features.features import closest_features, features_of
from assembly.proximity.features.solid_contact import CONTACT_RECORD, FEATURE_F, FEATURE_G, search_solids, track_solids

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = ["ContactRows", "contact_pairs", "listed_contacts", "rows_of_contacts"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]


class ContactRows(NamedTuple):
    """Contacts of a solution as rows.

    Attributes
    ----------
    pairs : (m,) of int
        Of each, the number of its pair of bodies among those that a contact manager keeps apart; of a given one -1.
    bodies : (m, 2) of int
    normals : (m, 3)
        From the first body to the second.
    points : (m, 2, 3)
        On both, in the world.
    gaps : (m,)
    """

    pairs: Table
    bodies: Table
    normals: Array
    points: Array
    gaps: Array


def contact_pairs(solution: Solution) -> dict[str, ContactPair]:
    """The pair of every contact by its name, at the poses of a solution."""
    scene = solution._scene
    pairs = {}
    table = solution._packed.table
    for k, contact in enumerate(scene.contacts):
        f, g = scene.sides[k]
        places = [scene.index(body) for body in contact.bodies]
        if table[table[ROW_TABLE] + ROW * k + SHELL_F] >= 0:
            pairs[contact.name] = _solids(solution, table, k, places)
        else:
            assert isinstance(f, BodyFace) and isinstance(g, BodyFace)
            start = solution._parameters[k, :4]
            q_f, q_g = solution.q[places]
            pairs[contact.name] = extremal_pair(f, q_f, g, q_g, None if np.isnan(start).any() else start)
    for contact in scene.seats:
        f, g = side_face(contact.a), side_face(contact.b)
        q_f, q_g = solution.q[[scene.index(body) for body in contact.bodies]]
        pairs[contact.name] = extremal_pair(f, q_f, g, q_g)
    return pairs | _listed(solution)


def listed_contacts(solution: Solution) -> Iterator[tuple[int, Kept, ContactPair]]:
    """The contacts that a contact manager has listed, the oldest first: the number of the pair of bodies, and for whom
    it is listed.
    """
    packed, scene = solution._packed, solution._scene
    owners = [item for item, own in zip(packed.kept, packed.pairs_of_kept, strict=True) for _ in own]
    if solution._state.size <= packed.memory_at:
        return
    table = packed.table_at(solution._state)
    places = [(number, k, pair) for k, (pair, number) in enumerate(packed.listed(solution._state)) if pair >= 0]
    for _, k, pair in sorted(places):
        r = len(packed.contacts) + k
        if np.isnan(solution._parameters[r, 0]):
            continue
        sides = packed.kept_pairs[pair]
        f, g = (scene.index(body_of(side)) for side in sides)
        if table[table[ROW_TABLE] + ROW * r + SHELL_F] >= 0:
            contact = _solids(solution, table, r, [f, g], sides)
        else:
            q_f, q_g = solution.q[[f, g]]
            face_f, face_g = (side_face(side) for side in sides)
            contact = extremal_pair(face_f, q_f, face_g, q_g, solution._parameters[r, :4])
        yield pair, owners[pair], contact


def rows_of_contacts(solution: Solution) -> ContactRows | None:
    """The contacts of `listed_contacts` and then the given ones, in the same orders, all by one kernel.

    None where the pair of one is lost, or a contact is packed as a joint: `contact_pairs` then searches for it.
    """
    packed, scene, state = solution._packed, solution._scene, solution._state
    given, start = len(packed.contacts), solution._parameters
    if given != len(scene.contacts) or state.size <= packed.memory_at:
        return None
    listed = [(number, k, pair) for k, (pair, number) in enumerate(packed.listed(state)) if pair >= 0]
    is_lost = np.isnan(start[:, 0]).tolist()
    places = [(given + k, pair) for _, k, pair in sorted(listed) if not is_lost[given + k]]
    places += [(k, -1) for k in range(given)]
    rows, pairs = np.array(places, dtype=np.int64).reshape(-1, 2).T
    sides = [packed.kept_pairs[pair] if pair >= 0 else scene.contacts[row].bodies for row, pair in places]
    bodies = np.array([[scene.index(body_of(side)) for side in both] for both in sides], dtype=np.int64).reshape(-1, 2)
    table = packed.table_at(state)
    count, q = int(table[CONTACTS]), solution.q.copy()
    q[:, :3] = (q[:, :3] - packed.reference) / packed.scale
    free = np.zeros(count, dtype=np.int64)
    free[rows] = -1
    records, tracked = np.zeros((count, CONTACT_RECORD)), start.copy()
    work = q, tracked, records, np.zeros(count), np.zeros((count, FREE_COLUMN + 4 + int(table[EXTRA])))
    if contact_rows((table, packed.pool), start.copy(), np.inf, free, work) >= 0 or np.isnan(tracked[rows, 0]).any():
        return None
    found = records[rows]
    normals, gaps = found[:, NORMAL : NORMAL + 3], found[:, GAP, None]
    second = q[bodies[:, 0], :3] + found[:, ARM_F : ARM_F + 3]
    points = np.stack([second - gaps * normals, second], axis=1) * packed.scale + packed.reference
    return ContactRows(pairs, bodies, normals, points, gaps[:, 0] * packed.scale)


def _listed(solution: Solution) -> dict[str, ContactPair]:
    """The same by their names: "clearance: a-b", "clearance: a-b 2", ...; corners of a contact "touch: corner"."""
    pairs = solution._packed.kept_pairs
    found: dict[str, ContactPair] = {}
    for number, kept, contact in listed_contacts(solution):
        f, g = (body_of(side).name for side in pairs[number])
        base = f"{kept.name}: {f}-{g}" if isinstance(kept, Clearance) else f"{kept.name}: corner"
        same = sum(name == base or name.startswith(f"{base} ") for name in found)
        found[base if same == 0 else f"{base} {same + 1}"] = contact
    return found


def _solids(
    solution: Solution,
    table: Table,
    k: int,
    places: list[int],
    sides: tuple[Body | BodyFace, Body | BodyFace] | None = None,
) -> ContactPair:
    """The pair of features of contact k of a table, between bodies in places; `sides` are those of a clearance's."""
    packed = solution._packed
    row = table[ROW_TABLE] + ROW * k
    sides = solution._scene.sides[k] if sides is None else sides
    q = solution.q[places]
    q[:, :3] = (q[:, :3] - packed.reference) / packed.scale
    tracked = solution._parameters[k : k + 1].copy()
    shells = table[row + SHELL_F], table[row + SHELL_G]
    scene = (table, packed.pool), shells, (0, 1), q
    if np.isnan(tracked[0, :4]).any():
        searches = packed.table[NEAREST_AT], packed.table[DEEPEST_AT]
        if search_solids(*scene, searches, tracked, 0) == 0:
            return _crossing(solution, k, places)
    records = np.zeros((1, CONTACT_RECORD))
    status = track_solids(*scene, np.inf, (tracked, records, tracked), 0)
    gap, normal = records[0, GAP], records[0, NORMAL : NORMAL + 3]
    there = q[0, :3] + records[0, ARM_F : ARM_F + 3]
    names = tuple(
        _feature_name(side, int(tracked[0, column])) for side, column in zip(sides, (FEATURE_F, FEATURE_G), strict=True)
    )
    return ContactPair(
        parameters=tracked[0, :4],
        points=np.array([there - gap * normal, there]) * packed.scale + packed.reference,
        normal=normal,
        gap=float(gap) * packed.scale,
        status=STATUSES[status],
        features=(names[0], names[1]),
    )


def _crossing(solution: Solution, k: int, places: list[int]) -> ContactPair:
    """What there is to say of contact k, of solids that cross without a pair that the loop could track."""
    pair = closest_features(*solution._scene.sides[k], *solution.q[places])
    return ContactPair(
        parameters=pair.parameters.ravel(),
        points=pair.points,
        normal=pair.normal,
        gap=pair.gap,
        status=PairStatus.NOT_CONVERGED,
        features=(pair.features[0].name, pair.features[1].name),
    )


def _feature_name(side: Body | BodyFace, number: int) -> str:
    """What a feature of a side is called."""
    return features_of(side_faces(side))[number].name
