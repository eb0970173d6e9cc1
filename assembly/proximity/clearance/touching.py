"""Bodies that touch: what opens their contacts, and whether what is open are faces that lie on each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Contacts
from assembly.proximity.clearance.look import gap_along
from assembly.proximity.clearance.parting import least_move
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.records import CELL_FACE, LINKS, NODE, NONE, WIRE

__all__ = ["conforms", "left_open", "move_apart"]

Array = NDArray[np.float64]
# Contacts are opened, or may close, to the first of these parts of what a body may be moved that it can be moved to.
OPENED = (0.25, 0.05, 0.01)
# Pairs of nodes that were left open, of which directions to open them are taken at most.
MOST_OPENED = 2000
# The cosine above which normals of cells as small as what was left open oppose each other.
OPPOSED = 0.98


def conforms(proof: ClearanceProof, k: int, q: Array, touching: float) -> bool:
    """Whether what a look at pair k leaves open are faces that lie on each other: normals oppose in all cells."""
    if not proof.leaves_open(k, q, touching):
        return False
    nodes = proof.left(k)[1]
    if not len(nodes):
        return False
    links, faces = rows_of(LINKS, proof.forest.arrays[3]), rows_of(CELL_FACE, proof.forest.arrays[2])
    if any((links.face[side] == NONE).any() or (links.form[side] == WIRE).any() for side in (nodes.a, nodes.b)):
        return False
    axes = rows_of(NODE, proof.forest.arrays[4]).axes
    turn = proof.relative(k, q)[0]
    normal_a = axes[nodes.a, 2] * faces.sign[links.face[nodes.a]][:, None]
    normal_b = axes[nodes.b, 2] * faces.sign[links.face[nodes.b]][:, None] @ turn.T
    return bool(((normal_a * normal_b).sum(axis=1) < -OPPOSED).all())


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
    root = proof.cells_of(k).nodes[0]
    arm, radius = rotation_matrix(row[3:]) @ root[:3], float(root[3])
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
