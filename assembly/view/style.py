"""How a picture looks, and what is said in it: names, axes, a scale bar, what hides behind what."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Literal, get_args

from assembly.errors import InputError, check_encodable, items, number
from assembly.kinematics.body import Body
from assembly.view.outline import ANGLE

__all__ = ["LABELED", "Glyphs", "Style", "checked_style"]

Glyphs = Literal["occluded", "in front", "none"]
LABELED = ("bodies", "joints", "contacts", "targets")
# Degrees from corner to corner of meshes: finer ones are too many triangles, coarser ones are no longer round.
_FINEST, _COARSEST = 0.5, 45.0


@dataclass(frozen=True)
class Style:
    """How a picture looks; `style=` of everything in `assembly.view` that draws one.

    Whoever opens a page changes names, legend, axes and what is in front by the boxes in its corner; what stands here
    is what they begin with. A window of meshcat has neither boxes nor legend, nor names under the mouse.

    Attributes
    ----------
    labels : bool or iterable of "bodies", "joints", "contacts", "targets"
        Whose names are written beside them; True: of all four. In pages the mouse shows the name of whatever it is on.
    legend : bool
        A list of colors: which body, joints, contacts, targets.
    axes : bool
        The directions x, y and z.
    scale_bar : bool
        A length in the scene, at the depth of the middle of the picture.
    unit : str
        Of the scene's lengths, to be said by what has a length.
    glyphs : "occluded", "in front" or "none"
        Whether joints of solid bodies and contacts hide behind solids, are seen through them, or are not drawn.
    opacity : float or dict of str -> float
        Of all bodies, or of some by their names, from 0 to 1.
    edges : bool
        Whether edges of bodies are drawn as thin lines: boundaries of faces, and creases within them.
    angle : float
        Degrees that surfaces may turn from one vertex of a mesh to the next, 0.5 to 45, where vertices suffice.
    """

    labels: bool | Iterable[str] = False
    legend: bool = False
    axes: bool = True
    scale_bar: bool = True
    unit: str = ""
    glyphs: Glyphs = "occluded"
    opacity: float | Mapping[str, float] = field(default=1.0, hash=False)
    edges: bool = True
    angle: float = ANGLE

    def __post_init__(self) -> None:
        for name in ("legend", "axes", "scale_bar", "edges"):
            if not isinstance(getattr(self, name), bool):
                raise InputError(f"{name} is {getattr(self, name)!r}; expected True or False")
        if isinstance(self.labels, bool):
            labels = LABELED if self.labels else ()
        else:
            labels = items("labels", self.labels, f"True, False or a list of some of {', '.join(map(repr, LABELED))}")
            for each in labels:
                if not isinstance(each, str) or each not in LABELED:
                    raise InputError(f"labels has {each!r}; expected some of {', '.join(map(repr, LABELED))}")
        object.__setattr__(self, "labels", labels)
        if not isinstance(self.unit, str):
            raise TypeError(f"unit is {self.unit!r}; expected a string, 'mm' say")
        check_encodable("unit", self.unit)
        if not isinstance(self.glyphs, str) or self.glyphs not in get_args(Glyphs):
            raise InputError(f"glyphs is {self.glyphs!r}; expected one of {', '.join(map(repr, get_args(Glyphs)))}")
        angle = number("angle", self.angle)
        if not _FINEST <= angle <= _COARSEST:
            raise InputError(f"angle is {angle:g}; expected {_FINEST:g} to {_COARSEST:g} degrees")
        object.__setattr__(self, "angle", angle)
        if isinstance(self.opacity, Mapping):
            parts = {name: _part(f"opacity[{name!r}]", value) for name, value in self.opacity.items()}
            object.__setattr__(self, "opacity", parts)
        else:
            object.__setattr__(self, "opacity", _part("opacity", self.opacity))

    @property
    def labels_asked(self) -> tuple[str, ...]:
        """Of which kinds of things the names are written beside them."""
        return () if isinstance(self.labels, bool) else tuple(self.labels)

    def opacity_of(self, body: Body) -> float:
        """From 0, nothing to see, to 1."""
        return self.opacity.get(body.name, 1.0) if isinstance(self.opacity, Mapping) else self.opacity

    def length(self, value: float, digits: int = 4) -> str:
        """A length in words, with its unit."""
        shown = f"{value:.{digits}g}" if isfinite(value) else "none"
        return f"{shown} {self.unit}".rstrip()


def _part(name: str, value: object) -> float:
    part = number(name, value)
    if not 0.0 <= part <= 1.0:
        raise InputError(f"{name} is {part:g}; expected a number from 0 to 1")
    return part


def checked_style(style: Style | None, names: Iterable[str]) -> Style:
    """The style of a picture of bodies of these names; the default one for None.

    Raises
    ------
    InputError, TypeError
        No style, or an opacity of a body that is not there.
    """
    if style is None:
        return Style()
    if not isinstance(style, Style):
        raise TypeError(f"style is {style!r}; expected an assembly.view.Style, or None")
    known = list(names)
    for name in style.opacity if isinstance(style.opacity, Mapping) else ():
        if name not in known:
            raise InputError(f"opacity has {name!r}; expected one of {', '.join(map(repr, known))}")
    return style
