"""Selection: several faces, edges or vertices of a body, by which further ones are chosen."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, ClassVar, Protocol, Self, SupportsIndex, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, check_coordinates, vector
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame
from assembly.kinematics.pose import direction
from assembly.selection.selector_strings import Seen, parsed

__all__ = ["Selection", "are_parallel", "is_about", "shown"]

Array = NDArray[np.float64]
# Lengths are equal within this part of the body's size, as the points of its edges are.
EQUAL = 1e-6
# So many things are named in a message.
_SHOWN = 12


class _Thing(Protocol):
    @property
    def body(self) -> Body: ...
    @property
    def name(self) -> str: ...
    @property
    def centroid(self) -> Array: ...
    def at_least(self, point: Any, /) -> float: ...
    def distance(self, point: Any, /) -> float: ...


Item = TypeVar("Item", bound=_Thing)


class Selection(tuple[Item, ...]):
    """Several faces, edges or vertices, in the order of their body. It is a tuple of them.

    `selection(">Z and %PLANE")` chooses by a selector string of CadQuery, other methods by what the things are. Each
    gives a selection again, which may be empty; `one()` is the thing itself, or an error that says what there is.
    """

    # What one of them is, and which names of kinds selector strings have for each kind.
    _word: ClassVar[str] = "thing"
    _kinds: ClassVar[dict[str, tuple[str, ...]]] = {}
    _have_sense: ClassVar[bool] = True
    _said: str
    _of: Selection[Item] | None

    def __new__(cls, items: Iterable[Item], said: str, of: Selection[Item] | None = None) -> Self:
        """Things, how they were asked for, and among what."""
        self = super().__new__(cls, items)
        self._said = said
        self._of = of
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (tuple(self), self._said, self._of)

    @overload
    def __getitem__(self, key: SupportsIndex) -> Item: ...

    @overload
    def __getitem__(self, key: slice) -> Self: ...

    def __getitem__(self, key: SupportsIndex | slice) -> Item | Self:
        found = super().__getitem__(key)
        if isinstance(key, slice):
            start, stop = ("" if end is None else end for end in (key.start, key.stop))
            step = "" if key.step is None else f":{key.step}"
            return type(self)(found, f"{self._said}[{start}:{stop}{step}]", self)  # type: ignore[arg-type]  # a tuple
        return found  # type: ignore[return-value]  # an item

    def __call__(self, selector: str) -> Self:
        """Those that a selector string of CadQuery chooses, as `faces(">Z")` or `edges("|X and <Y")`.

        Raises
        ------
        InputError
            A string that cannot be read, with what was expected where; a place that there is not.
        """
        rule = parsed(selector)
        if not self:
            return self._chosen(lambda item: True, f"({selector!r})")
        chosen = rule(
            Seen(
                len(self),
                lambda k: self[k].centroid,
                lambda k: self._direction(self[k]),
                lambda k: {*self._kinds[self._kind(self[k])]},
                list(dict.fromkeys(name for names in self._kinds.values() for name in names)),
                EQUAL * self._size(),
                self._have_sense,
            )
        )
        return type(self)((item for k, item in enumerate(self) if k in chosen), f"{self._said}({selector!r})", self)

    def near(self, point: ArrayLike) -> Self:
        """The one nearest to a point (3,) in the body's coordinates; of several that are as near, the first.

        By distances that are proven; as near is what differs by less than 1e-9 of the body's size.
        """
        place = checked_place("point", point)
        if not self:
            return self._chosen(lambda item: True, ".near(...)")
        least, slack = np.array([item.at_least(place) for item in self]), 1e-9 * self._size()
        gaps = np.full(len(self), np.inf)
        for k in np.argsort(least, kind="stable"):
            # All that follow are farther.
            if least[k] > gaps.min() + slack:
                break
            gaps[k] = self[int(k)].distance(place)
        nearest = int(np.argmin(gaps > gaps.min() + slack))
        said = f"{self._said}.near({', '.join(f'{x:g}' for x in place)})"
        return type(self)((self[nearest],), said, self)

    def one(self) -> Item:
        """The only one of them.

        Raises
        ------
        InputError
            None or several; the message says what there is.
        """
        if len(self) == 1:
            return self[0]
        if self:
            raise InputError(f"{self._said} is {len(self)} {self._plural()}: {self.listed()}; expected one")
        of = self._of
        while of is not None and not of:
            of = of._of
        known = of.listed() if of else "none"
        raise InputError(f"{self._said} is empty; expected one of the {self._plural()} that there are: {known}")

    def frame(self) -> Frame:
        """The frame of the only one of them."""
        item: Any = self.one()
        if not hasattr(item, "frame"):
            raise InputError(f"{self._said} is a {self._word}; expected a face or an edge, which have frames")
        frame: Frame = item.frame()
        return frame

    def listed(self) -> str:
        """What they are, for messages."""
        named = [self._described(item) for item in self[:_SHOWN]]
        return ", ".join(named) + (f" and {len(self) - _SHOWN} more" if len(self) > _SHOWN else "")

    def _plural(self) -> str:
        return "vertices" if self._word == "vertex" else f"{self._word}s"

    def _chosen(self, fits: Callable[[Item], bool], said: str) -> Self:
        return type(self)((item for item in self if fits(item)), f"{self._said}{said}", self)

    def _size(self) -> float:
        return self[0].body.size

    def _equal(self, a: float, b: float) -> bool:
        return abs(a - b) <= EQUAL * self._size()

    def _described(self, item: Item) -> str:
        return item.name

    def _kind(self, item: Item) -> str:
        raise NotImplementedError  # every kind of selection has it

    def _direction(self, item: Item) -> Array | None:
        raise NotImplementedError  # every kind of selection has it


def checked_place(name: str, value: ArrayLike) -> Array:
    """Coordinates of a point."""
    place = vector(name, value)
    check_coordinates(name, place.tolist())
    return place


def are_parallel(a: Array, b: Array, same_sense: bool = False) -> bool:
    """Whether unit vectors are parallel to 1e-6 rad."""
    return bool(np.linalg.norm(np.cross(a, b)) <= EQUAL and (not same_sense or a @ b > 0.0))


def is_about(name: str, value: ArrayLike | None) -> Array | None:
    """A direction that is asked for, or None."""
    return None if value is None else direction(name, value)


def shown(**settings: Any) -> str:
    """What was asked for, as it is written in a call."""
    said = []
    for name, value in settings.items():
        if value is not None:
            one = np.asarray(value).tolist() if not isinstance(value, (str, bool)) else value
            said.append(f"{name}={one!r}")
    return f"({', '.join(said)})"
