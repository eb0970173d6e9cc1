"""Workplanes and assemblies of CadQuery as bodies, and back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from assembly.cad.libraries import is_of, shown
from assembly.cad.locations import location_of, pose_of
from assembly.cad.shapes import Bodies, Label, color_of
from assembly.errors import text
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose
from assembly.solve.solution import Solution
from assembly.step.occt import occt
from assembly.step.tree import Color

__all__ = ["from_cadquery", "place_cadquery"]


@dataclass(frozen=True)
class _Node:
    """An assembly in the tree: its name from the root on, its location in the world, the color given so far."""

    assembly: Any
    name: str
    location: Any
    color: Color | None


def _nodes(assembly: Any, location: Any, path: str | None, color: Color | None) -> Iterator[_Node]:
    """All nodes below and with this one, parents first; names are those that CadQuery queries have."""
    location = location.Multiplied(assembly.loc.wrapped)
    color = color_of(assembly.color) or color
    yield _Node(assembly, assembly.name if path is None else path, location, color)
    for child in assembly.children:
        below = child.name if path is None else f"{path}/{child.name}"
        yield from _nodes(child, location, below, color)


def _tree(assembly: Any) -> Iterator[_Node]:
    return _nodes(assembly, occt().TopLoc_Location(), None, None)


def _shapes(thing: Any) -> list[Any]:
    """The shapes of OCCT that a workplane's stack, or a shape, has."""
    values = [thing] if is_of("cadquery", "Shape", thing) else thing.vals()
    return [value.wrapped for value in values if is_of("cadquery", "Shape", value)]


def _tags(thing: Any) -> list[Label]:
    """Faces that a workplane's tags are of; of several the first has the name alone, and others a number."""
    if not is_of("cadquery", "Workplane", thing):
        return []
    wholes = []
    before = thing.parent
    while before is not None:
        wholes += [value.wrapped for value in before.vals() if is_of("cadquery", "Shape", value)]
        before = before.parent
    return [
        Label(value.wrapped, name, None, wholes)
        for name, tagged in thing.ctx.tags.items()
        for value in tagged.vals()
        if is_of("cadquery", "Face", value)
    ]


def _labels(assembly: Any) -> list[Label]:
    """Names and colors that an assembly gives to faces of its object, and then the tags of this."""
    names = [Label(shape.wrapped, name) for shape, name in assembly._subshape_names.items() if _is_face(shape)]
    colors = [
        Label(shape.wrapped, None, color_of(color))
        for shape, color in assembly._subshape_colors.items()
        if _is_face(shape)
    ]
    return [*names, *colors, *_tags(assembly.obj)]


def _is_face(shape: Any) -> bool:
    return is_of("cadquery", "Face", shape)


def from_cadquery(thing: Any, name: str = "part", *, fixed: Iterable[str] = (), strict: bool = True) -> list[Body]:
    """The parts of a CadQuery workplane, shape or assembly as bodies.

    Every object of an assembly becomes a body at its location. Its name is the one used in CadQuery's queries, preceded
    by the names of subassemblies ("gripper/jaw"), so that `asm.cad.place` finds the object again. Bodies have their
    assembly's color, or that of the assembly around it.

    Faces are called "face 1", "face 2" in CadQuery's order, or have the names of `Assembly.addSubshape`, or else of the
    workplane's tags for faces. A tag follows its face into copies of the part, after moves, and to what later
    operations leave of it; several faces are then "top" and "top 2". Objects that are used several times share their
    faces.

    Parameters
    ----------
    thing : cadquery.Workplane, cadquery.Shape or cadquery.Assembly
        Lengths are not converted; they are usually millimeters.
    name : str
        Of the one body that a workplane or a shape becomes, whatever solids it has.
    fixed : iterable of str
        Names of bodies that do not move.
    strict : bool
        Whether to raise if a face cannot be read. Otherwise it is left out, and a warning says which and why.

    Returns
    -------
    list of Body
        In the order of the assembly, parents first.

    Raises
    ------
    TypeError, InputError
        Something else, nothing with faces in it, or faces that cannot be read, named with the reasons.
    """
    text("name", name)
    if is_of("cadquery", "Assembly", thing):
        made = Bodies(strict, fixed)
        for node in _tree(thing):
            if node.assembly.obj is not None:
                pose = pose_of(node.location, repr(node.name))
                made.add(node.name, _shapes(node.assembly.obj), pose, node.color, _labels(node.assembly))
    elif is_of("cadquery", "Workplane", thing) or is_of("cadquery", "Shape", thing):
        made = Bodies(strict, fixed)
        made.add(name, _shapes(thing), Pose(), None, _tags(thing))
    else:
        raise TypeError(f"thing is {shown(thing)}; expected a cadquery.Workplane, a cadquery.Shape or an Assembly")
    return made.finished("thing")


def place_cadquery(assembly: Any, solution: Solution, names: set[str]) -> set[str]:
    """Put the objects of an assembly to where a solution has the bodies of their names; returns these names."""
    placed: set[str] = set()
    # Where nodes stand now, and whether they have moved: what has not keeps its location, to the bit.
    stands: dict[int, tuple[Any, bool]] = {id(None): (occt().TopLoc_Location(), False)}
    for node in _tree(assembly):
        around, moved = stands[id(None if node.assembly is assembly else node.assembly.parent)]
        if node.assembly.obj is not None and node.name in names:
            pose = solution.pose(node.name)
            moved = moved or bool((pose.q != pose_of(node.location, repr(node.name)).q).any())
            if moved:
                node.assembly.loc = type(node.assembly.loc)(around.Inverted().Multiplied(location_of(pose)))
            placed.add(node.name)
        stands[id(node.assembly)] = around.Multiplied(node.assembly.loc.wrapped), moved
    return placed
