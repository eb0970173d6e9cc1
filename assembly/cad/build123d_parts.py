"""Parts and assemblies of build123d as bodies, and back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from assembly.cad.libraries import is_of, shown
from assembly.cad.locations import location_of, pose_of
from assembly.cad.shapes import Bodies, Label, color_of
from assembly.errors import InputError, items, text
from assembly.kinematics.body import Body
from assembly.solve.solution import Solution
from assembly.step.bodies import unique
from assembly.step.occt import occt
from assembly.step.tree import Color

__all__ = ["Leaf", "built", "from_build123d", "leaves_of", "place_build123d", "renew"]

EXPECTED = "a build123d part, a Compound with children, or several of them"


@dataclass(frozen=True)
class Leaf:
    """A part in the tree: its name from below the root on, where what it is in stands, the color it has."""

    part: Any
    name: str
    around: Any
    color: Color | None

    @property
    def location(self) -> Any:
        """Where it stands in the world."""
        return self.around.Multiplied(self.part.wrapped.Location())


def built(thing: Any) -> Any:
    """What a builder has built, or the thing itself."""
    for builder, result in (("BuildPart", "part"), ("BuildSketch", "sketch")):
        if is_of("build123d", builder, thing):
            return getattr(thing, result)
    return thing


def _below(part: Any, name: str, around: Any, color: Color | None, taken: set[str]) -> Iterator[Leaf]:
    color = color_of(part.color) or color
    _check_shape(part, name)
    if not part.children:
        yield Leaf(part, name, around, color)
        return
    location = around.Multiplied(part.wrapped.Location())
    names: set[str] = set()
    for child in part.children:
        label = unique(child.label or "part", names)
        yield from _below(child, f"{name}/{label}" if name else label, location, color, taken)


def _check_shape(part: Any, name: str) -> None:
    """Raise where build123d has made nothing of a part: it asserts that there is something, with nothing to say."""
    try:
        _ = part.wrapped
    except AssertionError:
        raise InputError(f"{name} is an empty {type(part).__name__}; expected {EXPECTED}") from None


def leaves_of(thing: Any, name: str = "part") -> list[Leaf]:
    """The parts of a tree, or of several, in their order, under distinct names.

    Raises
    ------
    TypeError
        Something else.
    """
    thing = built(thing)
    root = occt().TopLoc_Location()
    if is_of("build123d", "Shape", thing):
        if thing.children:
            return list(_below(thing, "", root, None, set()))
        _check_shape(thing, "thing")
        return [Leaf(thing, text("name", thing.label or name), root, color_of(thing.color))]
    if isinstance(thing, (str, bytes)) or not isinstance(thing, Iterable):
        raise TypeError(f"thing is {shown(thing)}; expected {EXPECTED}")
    found: list[Leaf] = []
    taken: set[str] = set()
    for k, item in enumerate(thing):
        one = built(item)
        if not is_of("build123d", "Shape", one):
            raise TypeError(f"thing[{k}] is {shown(item)}; expected {EXPECTED}")
        found += _below(one, unique(one.label or name, taken), root, None, taken)
    return found


def _labels(faces: Any) -> list[Label]:
    """Faces with the names that they are to have."""
    if isinstance(faces, Mapping):
        named = [(name, face) for name, face in faces.items()]
    else:
        named = [(getattr(face, "label", None), face) for face in items("faces", faces, "faces with labels")]
    found = []
    for name, face in named:
        if not is_of("build123d", "Face", face):
            raise TypeError(f"faces has {shown(face)}; expected build123d faces with labels, or names and faces")
        found.append(Label(face.wrapped, text("the label of a face", name), color_of(face.color)))
    return found


def from_build123d(
    thing: Any,
    name: str = "part",
    *,
    faces: Mapping[str, Any] | Iterable[Any] = (),
    fixed: Iterable[str] = (),
    strict: bool = True,
) -> list[Body]:
    """The parts of build123d as bodies.

    Every part below a `Compound` with children becomes a body at its place in the tree. Its name is its label, preceded
    by those of the compounds between it and the root ("gripper/jaw"), so that `asm.cad.place` finds the part again. A
    part is one body, however many solids it has, in its own coordinates: its `location` becomes the pose. Parts that
    were made by `copy.copy` share their faces.

    Parameters
    ----------
    thing : build123d part, Compound, BuildPart, or several
        Lengths are not converted; they are usually millimeters.
    name : str
        Of a part without a label.
    faces : mapping of name -> Face, or iterable of faces with labels
        Faces that are to have a name; others are "face 1", "face 2" in build123d's order. (The label of a selected face
        is not known to its part, hence this argument.) A face is found in every part that contains it, also in a copy.
    fixed : iterable of str
        Names of bodies that do not move.
    strict : bool
        Whether to raise if a face cannot be read. Otherwise it is left out, and a warning says which and why.

    Returns
    -------
    list of Body

    Raises
    ------
    TypeError, InputError
        Something else, nothing with faces in it, or faces that cannot be read, named with the reasons.
    """
    made = Bodies(strict, fixed)
    labels = _labels(faces)
    bare = occt().TopLoc_Location()
    for leaf in leaves_of(thing, name):
        # A face that was selected of a part that has moved since is where the part was.
        pose = pose_of(leaf.location, repr(leaf.name))
        made.add(leaf.name, [leaf.part.wrapped.Located(bare)], pose, leaf.color, labels)
    return made.finished("thing")


def place_build123d(thing: Any, solution: Solution, names: set[str]) -> set[str]:
    """Put parts to where a solution has the bodies of their names; returns these names."""
    placed = set()
    for leaf in leaves_of(thing):
        if leaf.name in names:
            pose = solution.pose(leaf.name)
            if (pose.q != pose_of(leaf.location, repr(leaf.name)).q).any():
                own = leaf.around.Inverted().Multiplied(location_of(pose))
                leaf.part.location = type(leaf.part.location)(own)
            placed.add(leaf.name)
    renew(thing)
    return placed


def renew(thing: Any) -> None:
    """Have compounds know where their children are now: they keep shapes of their own."""
    thing = built(thing)
    if not is_of("build123d", "Shape", thing):
        for item in thing:
            renew(item)
    elif thing.children:
        location = thing.location
        for child in thing.children:
            renew(child)
        thing.children = thing.children
        thing.location = location
