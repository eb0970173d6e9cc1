"""Bodies that touch: what opens their contacts, and whether what is open are faces that lie on each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Contacts
from assembly.proximity.clearance.body_cells import BodyCells
from assembly.proximity.clearance.look import gap_along
from assembly.proximity.clearance.parting import least_move
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.records import CELL_FACE, FLAT, GUIDES, LINKS, NODE, NONE

__all__ = ["conforms", "left_open", "move_apart"]

Array = NDArray[np.float64]
# Contacts are opened, or may close, to the first of these parts of what a body may be moved that it can be moved to.
OPENED = (0.25, 0.05, 0.01)
# Pairs of nodes that were left open, of which directions to open them are taken at most.
MOST_OPENED = 2000


def conforms(proof: ClearanceProof, k: int, q: Array, touching: float) -> bool:
    """Whether faces of the bodies of pair k lie on each other: cylinders or balls in bores of their radius, or planes.

    By what is recognized of the faces; which parts of them they have is not asked.
    """
    a, b = proof.cells_of_both(k)
    turn, shift = proof.relative(k, q)
    return (
        _are_flush(a, b, (turn, shift), touching)
        or _is_in_bore(a, b, (turn, shift), touching)
        or _is_in_bore(b, a, (turn.T, -turn.T @ shift), touching)
    )


def _is_in_bore(outer: BodyCells, inner: BodyCells, pose: tuple[Array, Array], touching: float) -> bool:
    """Whether a cylinder or a ball of the inner body, at a pose seen from the outer one, fills a bore of its radius."""
    turn, shift = pose
    rounds = rows_of(NODE, inner.nodes)
    # Of the hull of a torus both are above zero.
    rounds = rounds[(rows_of(LINKS, inner.links).face == NONE) & ((rounds.disc > 0.0) != (rounds.rho > 0.0))]
    for wall in outer.walls:
        for body in rounds[np.abs(rounds.disc + rounds.rho - wall.radius) <= touching]:
            reach = body.half[0] * body.axes[0]
            ends = turn @ (body.center + np.outer((-1.0, 1.0), reach)).T + (shift - wall.center)[:, None]
            off = ends - np.outer(wall.axis, wall.axis @ ends)
            is_disc = body.disc > 0.0 and body.half[0] <= touching
            if not is_disc and np.linalg.norm(off, axis=0).max() <= touching:
                return True
    return False


def _are_flush(a: BodyCells, b: BodyCells, pose: tuple[Array, Array], touching: float) -> bool:
    """Whether a flat face of b, at a pose seen from a, is in the plane of one of a that looks the other way."""
    (points_a, normals_a), (points_b, normals_b) = _planes(a), _planes(b)
    turn, shift = pose
    points_b, normals_b = points_b @ turn.T + shift, normals_b @ turn.T
    opposed = np.linalg.norm(normals_a[:, None] + normals_b, axis=2) * max(a.size, b.size) <= touching
    apart = np.abs(((points_b - points_a[:, None]) * normals_a[:, None]).sum(axis=2))
    return bool((opposed & (apart <= touching)).any())


def _planes(cells: BodyCells) -> tuple[Array, Array]:
    """A point and the outward normal of the first cells of flat faces."""
    links, nodes = rows_of(LINKS, cells.links)[cells.first], rows_of(NODE, cells.nodes)[cells.first]
    flat = np.flatnonzero(links.form == FLAT)
    signs = rows_of(CELL_FACE, cells.faces).sign[links.face[flat]]
    # The normal by the corners has the sense of S_u x S_v, that of the face is exact.
    senses = np.sign((nodes.axes[flat, 2] * nodes.ruling[flat]).sum(axis=1)) * signs
    return nodes.corner[flat, 0], nodes.ruling[flat] * senses[:, None]


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
    root = proof.cells_of(k).root
    arm, radius = rotation_matrix(row[3:]) @ root.center, float(root.radius)
    guides = proof.fronts.pair.guides[k]
    guides[:] = 0.0
    few = normals[np.linspace(0, len(normals) - 1, min(len(normals), GUIDES)).astype(int)]
    guides[: len(few)] = few @ rotation_matrix(q[proof.pairs[k][0], 3:])
    for part in OPENED if touching > 0.0 else ():
        # Contacts between which a body is wedged open by less than it is moved.
        move = least_move(normals, places - row[:3] - arm, part * touching - gaps, radius)
        if move is None:
            return None
        if np.linalg.norm(move[:3]) + radius * np.linalg.norm(move[3:]) <= touching:
            break
    else:
        return None
    # About the origin of the body instead of its middle.
    move[:3] -= np.cross(move[3:], arm)
    return move


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
    world = rotation_matrix(a[3:])
    return move_apart(proof, k, q, Contacts(normals @ world.T, places @ world.T + a[:3], gaps), touching)
