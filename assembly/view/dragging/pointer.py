"""Where a mouse is between its messages: browsers send some 20 a second, the loop takes hundreds of ticks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.pose import Pose

__all__ = ["Pointer", "between"]

Array = NDArray[np.float64]
# Seconds between messages until two have come, and the longest that a way may take.
FIRST_INTERVAL, LONGEST_INTERVAL = 0.05, 0.2


def between(a: Array, b: Array, part: float) -> Array:
    """A part of the way between two points (3,) or pose rows (7,), along the shorter turn."""
    if part >= 1.0:
        return b.copy()
    row: Array = a + part * (b - a)
    if len(a) == 7:
        other = -b[3:] if float(a[3:] @ b[3:]) < 0.0 else b[3:]
        turn = a[3:] + part * (other - a[3:])
        row[3:] = turn / np.linalg.norm(turn)
    return row


class Pointer:
    """Goes from one message's target to the next one's in the time that lies between messages.

    Parameters
    ----------
    target : (3,) or (7,)
        Where it is at the beginning.
    now : float
        Seconds.
    """

    def __init__(self, target: Array, now: float) -> None:
        self._from = self._to = target.copy()
        self._since, self._interval = now, FIRST_INTERVAL

    @property
    def target(self) -> Array:
        """Where the last message has it."""
        return self._to

    @property
    def since(self) -> float:
        """When the last message came."""
        return self._since

    def move(self, target: Array | Pose, now: float) -> bool:
        """Take a message; False, and nothing taken, where its target is not of finite numbers."""
        row = np.asarray(target.q if isinstance(target, Pose) else target, dtype=np.float64)
        if row.shape != self._to.shape or not np.isfinite(row).all():
            return False
        self._from = self.at(now)
        passed = now - self._since
        self._interval = passed if 0.0 < passed <= LONGEST_INTERVAL else FIRST_INTERVAL
        self._to, self._since = row.copy(), now
        return True

    def at(self, now: float) -> Array:
        """Where it is; at the last message's target once the interval is over."""
        return between(self._from, self._to, (now - self._since) / self._interval)
