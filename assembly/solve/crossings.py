"""Bodies that cross at the pose of a solution where nobody asked for a clearance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from assembly.constraints import layout
from assembly.constraints.clearance import Clearance
from assembly.constraints.contact import Contact
from assembly.constraints.couplings import Coupling
from assembly.constraints.joint import Joint
from assembly.constraints.packing import pack
from assembly.errors import InputError
from assembly.proximity import watch, watch_memory
from assembly.proximity.solid_contact import PAIR_GAP, TRACK

if TYPE_CHECKING:
    from assembly.solve.solution import Solution

__all__ = ["crossings"]

# What counts as crossing where no more is called touching, and how deep looks see, in parts of the scene's size. A deep
# look of wires that cross often finds so much that it lacks room for the rest, so that there are several.
CROSSING, DEPTHS = 1e-8, (0.005, 0.015, 0.05)


def crossings(solution: Solution) -> tuple[tuple[str, str], ...]:
    """Names of the bodies whose surfaces cross, but for contacts that the scene has; () with a clearance."""
    scene = solution._scene
    if solution._packed.clearances or not scene.contacts:
        return ()
    joined = [
        (a, b)
        for item in scene.constraints
        if isinstance(item, (Joint, Coupling))
        for k, a in enumerate(item.bodies)
        for b in item.bodies[k + 1 :]
        if a.faces and b.faces
    ]
    contacts = [item for item in scene.constraints if isinstance(item, Contact)]
    try:
        watched = Clearance(name="crossings", exclude=joined)
        watched.corners = False
        packed = pack(scene.bodies, [*contacts, watched], ())
    except InputError:
        # The name is taken by a contact, or bodies are not of one scene: nothing to look at.
        return ()
    if not packed.guards:
        return ()
    q = solution.q.copy()
    q[:, :3] = (q[:, :3] - packed.reference) / packed.scale
    deep = max(CROSSING, solution._touching)
    found = set()
    for depth in DEPTHS:
        state = packed.new_state()
        memory = state[packed.memory_at :]
        pairs = memory[watch_memory.MEMORY_HEADER :]
        pairs[watch_memory.REACH : watch_memory.PAIR_MEMORY * len(packed.guarded[0]) : watch_memory.PAIR_MEMORY] = depth
        tracked = np.full((packed.pair_rows, TRACK), np.nan)
        tracked[: len(contacts)] = solution._parameters[: len(contacts)]
        watch.look(packed.table, packed.pool, packed.table[layout.WATCH], memory, q, tracked, watch.EVERYTHING)
        each = memory[watch_memory.MEMORY_HEADER :][: watch_memory.PAIR_MEMORY * len(packed.guarded[0])].reshape(
            -1, watch_memory.PAIR_MEMORY
        )
        found |= set(np.flatnonzero(each[:, watch_memory.CROSSED] == 1.0).tolist())
        gaps = tracked[len(contacts) :, PAIR_GAP]
        found |= {pair for gap, (pair, _) in zip(gaps, packed.listed(state), strict=True) if pair >= 0 and gap < -deep}
    return tuple((a.name, b.name) for k, (a, b) in enumerate(packed.guarded[0]) if k in found)
