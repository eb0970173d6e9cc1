"""A STEP file as a tree of labels: parts with their placements, names and colors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from assembly.step.occt import occt

__all__ = ["Color", "Leaf", "Part", "color_of", "entry_of", "free_labels", "leaves", "name_of"]

Color = tuple[float, float, float]
# What writers put where there is no name.
_NO_NAMES = {"", "NONE", "''"}
_NO_OTHERS: Mapping[str, Any] = {}


@dataclass(frozen=True)
class Leaf:
    """A part where it stands: its label, the location accumulated down to it, its name, the color given on the way.

    `home` is the document that the label is in, if that is another one.
    """

    label: Any
    location: Any
    name: str | None
    color: Color | None
    home: Any = None


def listed(fill: Any, *arguments: Any) -> list[Any]:
    """Labels that a method writes into its last argument."""
    found = occt().Labels()
    fill(*arguments, found)
    # Its length, which it inherits, takes a hundred times as long as its own last place.
    return [found.Value(k) for k in range(1, found.Upper() + 1)]


def free_labels(shapes: Any) -> list[Any]:
    """Labels of the shapes that no assembly refers to."""
    return listed(shapes.GetFreeShapes)


def entry_of(label: Any) -> str:
    """The place of a label in its document, in OCCT's notation."""
    o = occt()
    entry = o.TCollection_AsciiString()
    o.TDF_Tool.Entry_s(label, entry)
    return str(entry.ToCString())


def name_of(label: Any) -> str | None:
    """The name of a label, if it has one."""
    o = occt()
    kind = o.TDataStd_Name.GetID_s()
    # A search for what is not there may crash.
    if not label.IsAttribute(kind):
        return None
    attribute = o.TDataStd_Name()
    label.FindAttribute(kind, attribute)
    name = str(attribute.Get().ToExtString()).strip()
    return None if name in _NO_NAMES else name


def color_of(label: Any) -> Color | None:
    """The color of a label's surfaces, red, green and blue in 0..1 as files have them (sRGB)."""
    o = occt()
    color = o.Quantity_Color()
    for kind in (o.XCAFDoc_ColorSurf, o.XCAFDoc_ColorGen):
        if o.XCAFDoc_ColorTool.GetColor_s(label, kind, color):
            # OCCT keeps single precision.
            red, green, blue = (min(1.0, max(0.0, round(x, 6))) for x in color.Values(o.Quantity_TOC_sRGB))
            return red, green, blue
    return None


def leaves(
    label: Any, location: Any, name: str | None, color: Color | None, others: Mapping[str, Any] = _NO_OTHERS
) -> Iterator[Leaf]:
    """All parts under a label, in the order of the file.

    Parameters
    ----------
    label, location
        Where to begin.
    name, color
        Of what is above; the name is a part's that has none, and the color nearest to the root counts.
    others
        Documents that have the parts of labels, by the entries of these.
    """
    o = occt()
    tool = o.XCAFDoc_ShapeTool
    if tool.IsReference_s(label):
        part = o.TDF_Label()
        tool.GetReferredShape_s(label, part)
        yield from leaves(part, location.Multiplied(tool.GetLocation_s(label)), name, color or color_of(label), others)
    elif others and (home := others.get(entry_of(label))) is not None:
        root = o.XCAFDoc_DocumentTool.ShapeTool_s(home.made.Main())
        there = [leaf for one in free_labels(root) for leaf in leaves(one, location, name, color)]
        for leaf in there:
            # The one part of a file has the name that the file which refers to it has for it.
            own = name_of(label) if len(there) == 1 else None
            yield replace(leaf, name=own or leaf.name, home=home)
    elif tool.IsAssembly_s(label):
        for component in listed(tool.GetComponents_s, label):
            yield from leaves(component, location, name_of(label) or name, color, others)
    else:
        yield Leaf(label, location, name_of(label) or name, color)


class Part:
    """What a part says of itself: its shape, its color, and names and colors of the shapes in it."""

    def __init__(self, label: Any) -> None:
        o = occt()
        self.shape = o.XCAFDoc_ShapeTool.GetShape_s(label)
        self.color = color_of(label)
        self._map = o.ShapeMap()
        self._said: list[tuple[str | None, Color | None]] = []
        for sub in listed(o.XCAFDoc_ShapeTool.GetSubShapes_s, label):
            shape = o.XCAFDoc_ShapeTool.GetShape_s(sub)
            if self._map.FindIndex(shape) == 0:
                self._map.Add(shape)
                self._said.append((name_of(sub), color_of(sub)))

    def said(self, shape: Any) -> tuple[str | None, Color | None]:
        """Name and color of a shape in the part."""
        k = self._map.FindIndex(shape)
        return self._said[k - 1] if k else (None, None)
