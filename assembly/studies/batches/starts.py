"""Where the rows of a batch begin, and the states of the loop there."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.constraints.model.tangent import ContactTangent
from assembly.constraints.packing.given_starts import place_tangents
from assembly.constraints.packing.scene import Packed
from assembly.constraints.packing.scene_size import check_reach
from assembly.errors import check_coordinates, real_array
from assembly.kinematics.pose import UNIT_ROUNDING, unit_quaternion
from assembly.solve.solution import Solution

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["Start", "begun_states", "starts_of"]

Array = NDArray[np.float64]
# Poses (bodies, 7), or a solution.
Start = Array | Solution


def starts_of(scene: Assembly, q0s: ArrayLike | Solution | list[Solution] | None) -> Array | list[Solution]:
    """Poses (n, bodies, 7) or solutions; of a single start n is 1."""
    if q0s is None:
        return scene.q[None]
    if isinstance(q0s, Solution):
        return [q0s]
    if isinstance(q0s, (list, tuple)) and any(isinstance(item, Solution) for item in q0s):
        for k, item in enumerate(q0s):
            if not isinstance(item, Solution):
                raise TypeError(f"q0s[{k}] is {item!r}; expected a Solution, as others are")
        return list(q0s)
    bodies = len(scene.bodies)
    # Lists of solutions are none by now.
    poses = cast(ArrayLike, q0s)
    single = np.ndim(poses) == 2
    given: Array = real_array("q0s", poses, (bodies, 7) if single else ("n", bodies, 7))
    given = given.reshape(-1, bodies, 7)
    check_coordinates("q0s", [float(given[..., :3].min()), float(given[..., :3].max())])
    # Those that are unit to rounding stay as they are, to the bit.
    off = np.abs(np.sqrt((given[..., 3:] ** 2).sum(axis=2)) - 1.0)
    for k, body in np.argwhere(~(off <= 0.5 * UNIT_ROUNDING)):
        name = f"q0s[{body}, 3:]" if single else f"q0s[{k}, {body}, 3:]"
        given[k, body, 3:] = unit_quaternion(name, given[k, body, 3:])
    return given


def begun_states(
    scene: Assembly, packed: Packed, starts: Array | list[Solution], values: bool, places: bool
) -> Array | None:
    """States of the loop where rows begin, (n, up to the size of a state): what is not there is zero.

    None where a start of its own has to be found for every row, with its numbers set. `values` says whether rows have
    numbers of their own; `places`, whether these are places of frames: then no row that was evaluated before holds.
    """
    if isinstance(starts, list):
        if packed._turned.coupled and values:
            return None
        states = [_begun(scene, packed, item) for item in starts]
        return np.array([state[: packed.memory_at] if places else state for state in states])
    check_reach("a coordinate of the start", float(np.abs(starts[..., :3]).max()), packed.scale)
    if values and packed._turned.chosen:
        return None
    begun = np.zeros((len(starts), packed.memory_at))
    begun[:, : packed.contacts_at] = starts.reshape(len(starts), -1)
    begun[:, packed.contacts_at : packed.angles_at] = np.nan
    if any(isinstance(item, ContactTangent) for item in packed.contacts):
        for state in begun:
            place_tangents(packed, scene.bodies, state)
    if packed._turned.chosen:
        for state in begun:
            packed.start_angles(state, warm=False)
    return begun


def _begun(scene: Assembly, packed: Packed, start: Solution) -> Array:
    """The state that a solve from a solution begins with, but for the turns of driven angles."""
    own = start._ended.packed is packed and not packed._turned.coupled
    return start._ended.state if own else scene._start(packed, start, None)
