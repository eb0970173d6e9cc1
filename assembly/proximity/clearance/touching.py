"""Bodies that touch: the moves and maps that open their contacts."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.kinematics.pose import rotation_of
from assembly.proximity.clearance.answers import Contacts
from assembly.proximity.clearance.body_cells import BodyCells
from assembly.proximity.clearance.pair_looks import gap_along
from assembly.proximity.clearance.parting import least_move
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.records import CELL_FACE, FLAT, GUIDES, LINKS, NODE, NONE

__all__ = ["filled_bore", "left_open", "move_apart", "off_contacts", "recognized"]

Array = NDArray[np.float64]
# Contacts are opened, or may close, to the first of these parts of what a body may be moved that it can be moved to.
OPENED = (0.25, 0.05, 0.01)
# Pairs of nodes that were left open, of which directions to open them are taken at most.
MOST_OPENED = 2000
# What is round and shorter than this part of its radius is a disc.
SHORT = 1e-9


class Recognized(NamedTuple):
    """What is recognized of a body.

    Attributes
    ----------
    flat : (f,) of int
        Its flat faces.
    points, normals : (f, 3)
        Of these, normals outward.
    centers, radii : tuple of arrays
        Balls around the first cells of each of these.
    wall_centers, wall_axes : (w, 3)
        Of walls of bores and of round holes a point of the axis and its direction, zero for a hollow ball.
    wall_radii : (w,)
    ends : (r, 2, 3)
        Of its cylinders and balls those of the axis, or the center twice.
    round_radii : (r,)
    """

    flat: NDArray[np.int64]
    points: Array
    normals: Array
    centers: tuple[Array, ...]
    radii: tuple[Array, ...]
    wall_centers: Array
    wall_axes: Array
    wall_radii: Array
    ends: Array
    round_radii: Array


@lru_cache(maxsize=256)
def recognized(cells: BodyCells) -> Recognized:
    """What is recognized of a body's faces."""
    links, nodes = rows_of(LINKS, cells.links)[cells.first], rows_of(NODE, cells.nodes)[cells.first]
    flat = np.flatnonzero(links.form == FLAT)
    owner, first = np.unique(links.face[flat], return_index=True)
    some = flat[first]
    # The normal by the corners has the sense of S_u x S_v, that of the face is exact.
    senses = (
        np.sign((nodes.axes[some, 2] * nodes.ruling[some]).sum(axis=1)) * rows_of(CELL_FACE, cells.faces).sign[owner]
    )
    of_face = [flat[links.face[flat] == face] for face in owner]
    every = rows_of(NODE, cells.nodes)
    # Of the hull of a torus both are above zero; a disc has no length.
    is_round = (rows_of(LINKS, cells.links).face == NONE) & ((every.disc > 0.0) != (every.rho > 0.0))
    is_round &= ~every.less.any(axis=1)
    rounds = every[is_round & ((every.disc == 0.0) | (every.half[:, 0] > SHORT * every.disc))]
    along = (rounds.half[:, 0, None] * rounds.axes[:, 0])[:, None]
    ends = rounds.center[:, None] + np.array([[[-1.0], [1.0]]]) * along
    return Recognized(
        owner,
        nodes.corner[some, 0],
        nodes.ruling[some] * senses[:, None],
        tuple(nodes.center[rows] for rows in of_face),
        tuple(nodes.radius[rows] for rows in of_face),
        np.array([wall.center for wall in cells.walls]).reshape(-1, 3),
        np.array([wall.axis for wall in cells.walls]).reshape(-1, 3),
        np.array([wall.radius for wall in cells.walls]),
        ends,
        rounds.disc + rounds.rho,
    )


def filled_bore(proof: ClearanceProof, k: int, q: Array, touching: float) -> tuple[int, Array] | None:
    """A cylinder or a ball of a body of pair k that is in a bore of its own radius in the other one, or None.

    Returns
    -------
    (int, (2, 3))
        Which body it is of, and in the axes of that both ends of its axis, or its center twice.
    """
    a, b = map(recognized, proof.cells_of_both(k))
    turn, shift = proof.relative(k, q)
    inner = _in_bore(a, b, (turn, shift), touching)
    if inner is not None:
        return 1, inner
    inner = _in_bore(b, a, (turn.T, -turn.T @ shift), touching)
    return None if inner is None else (0, inner)


def _in_bore(outer: Recognized, inner: Recognized, pose: tuple[Array, Array], touching: float) -> Array | None:
    """The ends of a cylinder or a ball of the inner body, at a pose seen from the outer one, that fills a bore."""
    turn, shift = pose
    wall, body = np.nonzero(np.abs(inner.round_radii - outer.wall_radii[:, None]) <= touching)
    if not len(wall):
        return None
    ends = inner.ends[body] @ turn.T + shift - outer.wall_centers[wall][:, None]
    axes = outer.wall_axes[wall][:, None]
    off = ends - (ends * axes).sum(axis=2, keepdims=True) * axes
    fits = np.flatnonzero(np.linalg.norm(off, axis=2).max(axis=1) <= touching)
    return np.asarray(inner.ends[body[fits[0]]]) if len(fits) else None


def _flush(proof: ClearanceProof, k: int, q: Array, touching: float) -> tuple[Array, Array]:
    """Where flat faces of pair k lie on each other: normals of those of the first body, in its axes, and the gaps.

    So do those that are apart by the least gap, over which gaps are counted.
    """
    least = float(proof.minimum[k])
    a, b = map(recognized, proof.cells_of_both(k))
    turn, shift = proof.relative(k, q)
    opposed = np.linalg.norm(a.normals[:, None] + b.normals @ turn.T, axis=2) * proof.size(k) <= touching
    i, j = np.nonzero(opposed)
    gaps = ((b.points[j] @ turn.T + shift - a.points[i]) * a.normals[i]).sum(axis=1) - least
    found = [
        row
        for row in np.flatnonzero(np.abs(gaps) <= touching).tolist()
        if _are_beside(
            (a.centers[i[row]], a.radii[i[row]]),
            (b.centers[j[row]] @ turn.T + shift, b.radii[j[row]]),
            least + touching,
        )
    ]
    return a.normals[i[found]], gaps[found]


def _tangent(proof: ClearanceProof, k: int, q: Array, touching: float) -> tuple[Array, Array]:
    """Where a cylinder that lies on a flat face of pair k, or a ball, touches it: as `_flush` has it."""
    a, b = map(recognized, proof.cells_of_both(k))
    turn, shift = proof.relative(k, q)
    least = float(proof.minimum[k])
    on_a = _on_flat_faces(a, (b.ends @ turn.T + shift, b.round_radii), (least, touching))
    # Seen from the second body: its faces have the normals from it to the first.
    on_b = _on_flat_faces(b, ((a.ends - shift) @ turn, a.round_radii), (least, touching))
    return np.concatenate([on_a[0], -on_b[0] @ turn.T]), np.concatenate([on_a[1], on_b[1]])


def _on_flat_faces(flat: Recognized, rounds: tuple[Array, Array], lengths: tuple[float, float]) -> tuple[Array, Array]:
    """Normals of flat faces on which rounds, of these ends and radii, lie but for a least gap; gaps over that."""
    ends, radii = rounds
    least, touching = lengths
    heights = ((ends[None] - flat.points[:, None, None]) * flat.normals[:, None, None]).sum(axis=3)
    gaps = heights - radii[:, None] - least
    i, j = np.nonzero(np.abs(gaps).max(axis=2) <= touching)
    found = [
        row
        for row in range(len(i))
        if _are_beside(
            (flat.centers[i[row]], flat.radii[i[row]]),
            _balls_along(ends[j[row]], float(radii[j[row]])),
            least + touching,
        )
    ]
    return flat.normals[i[found]], gaps[i[found], j[found]].min(axis=1)


def _balls_along(ends: Array, radius: float) -> tuple[Array, Array]:
    """Centers and radii of balls that hold all of a cylinder between the ends of its axis, or of a ball."""
    length = float(np.linalg.norm(ends[1] - ends[0]))
    count = 1 + int(length / (2.0 * radius))
    middles = ends[0] + (np.arange(count) + 0.5)[:, None] / count * (ends[1] - ends[0])
    return middles, np.full(count, np.hypot(radius, 0.5 * length / count))


def _are_beside(a: tuple[Array, Array], b: tuple[Array, Array], touching: float) -> bool:
    """Whether any ball of one set is as near to one of the other set as what touches."""
    apart = np.linalg.norm(a[0][:, None] - b[0], axis=2)
    return bool((apart <= a[1][:, None] + b[1] + touching).any())


def off_contacts(
    proof: ClearanceProof, k: int, q: Array, touching: float, known: Callable[[], Array | None]
) -> Array | None:
    """The least translation of the second body of pair k, as a move (6), off what the two seem to touch at.

    Zero where nothing is known of that; None where none so small leads off all of it.

    Parameters
    ----------
    k : int
    q : (n, 7)
    touching : float
    known : callable
        Of bodies that are not recognized to lie on flat faces, what gives the normal (3,) from the first body to the
        second where they touch, in the world, or None.
    """
    flush, tangent = _flush(proof, k, q, touching), _tangent(proof, k, q, touching)
    normals, gaps = (np.concatenate(both) for both in zip(flush, tangent, strict=True))
    if len(normals):
        normals = normals @ rotation_of(q[proof.pairs[k][0], 3:]).T
    else:
        normal = known()
        if normal is None:
            return np.zeros(6)
        normals, gaps = normal[None], np.zeros(1)
    row = q[proof.pairs[k][1]]
    middle = rotation_of(row[3:]) @ proof.cells_of(k).middle + row[:3]
    return move_apart(proof, k, q, Contacts(normals, np.tile(middle, (len(normals), 1)), gaps), touching)


def move_apart(proof: ClearanceProof, k: int, q: Array, contacts: Contacts, touching: float) -> Array | None:
    """The least move (6) of the second body of pair k that opens contacts; None where no point may move so far.

    Parameters
    ----------
    k : int
    q : (n, 7)
    contacts : Contacts
    touching : float
        What a point may be moved.
    """
    normals, places, gaps = contacts
    row = q[proof.pairs[k][1]]
    cells = proof.cells_of(k)
    arm, radius = rotation_of(row[3:]) @ cells.middle, cells.extent
    guides = proof.fronts.pair.guides[k]
    guides[:] = 0.0
    few = normals
    if len(normals) > GUIDES:
        few = normals[np.linspace(0, len(normals) - 1, GUIDES).astype(int)]
    guides[: len(few)] = few @ rotation_of(q[proof.pairs[k][0], 3:])
    arms = places - row[:3] - arm
    move: Array | None
    for part in OPENED if touching > 0.0 else ():
        # Contacts between which a body is wedged open by less than it is moved.
        if len(gaps) == 1:
            move = _off_one(normals[0].tolist(), arms[0].tolist(), part * touching - float(gaps[0]), radius)
        else:
            move = least_move(normals, arms, part * touching - gaps, radius)
        if move is None:
            return None
        if hypot(*move[:3].tolist()) + radius * hypot(*move[3:].tolist()) <= touching:
            break
    else:
        return None
    # About the origin of the body instead of its middle.
    if move[3:].any():
        (x, y, z), (u, v, w) = arm.tolist(), move[3:].tolist()
        move[:3] -= (v * z - w * y, w * x - u * z, u * y - v * x)
    return move


def _off_one(normal: list[float], arm: list[float], asked: float, radius: float) -> Array:
    """`least_move` of one contact: along its own row, in plain floats."""
    if asked <= 0.0:
        return np.zeros(6)
    (u, v, w), (x, y, z) = normal, arm
    turn = ((y * w - z * v) / radius, (z * u - x * w) / radius, (x * v - y * u) / radius)
    share = asked / (u * u + v * v + w * w + turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    by = share / radius
    return np.array([share * u, share * v, share * w, by * turn[0], by * turn[1], by * turn[2]])


def left_open(proof: ClearanceProof, k: int, q: Array, touching: float) -> Array | None:
    """The same for the pairs of nodes that a look at pair k alone left open, along the directions they have."""
    parted, nodes = proof.left(k)
    if not 0 < len(nodes) <= MOST_OPENED:
        return None
    cells = rows_of(NODE, proof.forest.arrays[4])
    a = q[proof.pairs[k][0]]
    turn, shift = proof.relative(k, q)
    places = cells.center[nodes.b] @ turn.T + shift
    normals = parted.normal
    rows = zip(nodes.a.tolist(), nodes.b.tolist(), normals, strict=True)
    gaps = np.array([gap_along(proof.forest.arrays, (i, j), turn.ravel(), shift, n) for i, j, n in rows])
    if (np.linalg.norm(normals, axis=1) < 0.5).any() or (gaps < -touching).any():
        return None
    world = rotation_of(a[3:])
    return move_apart(proof, k, q, Contacts(normals @ world.T, places @ world.T + a[:3], gaps), touching)
