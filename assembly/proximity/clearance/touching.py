"""Bodies that touch: what opens their contacts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Contacts
from assembly.proximity.clearance.look import gap_along
from assembly.proximity.clearance.parting import least_move
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.records import GUIDES, NODE

__all__ = ["left_open", "move_apart"]

Array = NDArray[np.float64]
# Contacts are opened, or may close, to the first of these parts of what a body may be moved that it can be moved to.
OPENED = (0.25, 0.05, 0.01)
# Pairs of nodes that were left open, of which directions to open them are taken at most.
MOST_OPENED = 2000


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
