"""What there is to show of a scene that is dragged, frozen: browsers are sent one after another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays

__all__ = ["Held", "Shown"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Held(ReadOnlyArrays):
    """A body in somebody's hand.

    Attributes
    ----------
    client : int
        Whose: the browser's number.
    body : str
    point, target : (3,)
        Where the hand holds the body, and where it draws it.
    force : (3,)
        On the hand, by its stiffness.
    by : str
        The coordinate, as in "hinge.angle", by which it is held; "" for the mouse on the body.
    """

    client: int
    body: str
    point: Array
    target: Array
    force: Array = field(default_factory=lambda: np.zeros(3))
    by: str = ""


@dataclass(frozen=True, eq=False)
class Shown(ReadOnlyArrays):
    """What there is to show.

    Attributes
    ----------
    q : (n, 7)
    status : str
        In words.
    hands : tuple of Held
        In the order in which they took hold.
    notice : str
        What somebody was refused in the last seconds, in words.
    violation : float
        In the scene's unit.
    seconds : float
        Of the last tick, or of the last solve.
    contacts : tuple of ((3,), (3,))
        Points and normals of contacts.
    values : dict of str -> float
        Coordinates of joints by their names, those of some tenths of a second ago at most.
    ticks : int
        Since the beginning.
    """

    q: Array
    status: str = "nothing is held"
    hands: tuple[Held, ...] = ()
    notice: str = ""
    violation: float = 0.0
    seconds: float = 0.0
    contacts: tuple[tuple[Array, Array], ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    ticks: int = 0

    @property
    def holder(self) -> int | None:
        """The browser that took hold first; None while nobody drags."""
        return self.hands[0].client if self.hands else None

    @property
    def held(self) -> str:
        """Name of the body that it drags, or ""."""
        return self.hands[0].body if self.hands else ""

    @property
    def force(self) -> Array:
        """On that hand, (3,)."""
        return self.hands[0].force if self.hands else np.zeros(3)

    @property
    def who(self) -> str:
        """Who drags what, in words; "" while nobody does."""
        told = (f"{hand.body}{f' by {hand.by}' if hand.by else ''} (browser {hand.client})" for hand in self.hands)
        return ", ".join(told)
