"""Trees of joints written to URDF files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from assembly._file_names import checked_suffix
from assembly.assembly import Assembly
from assembly.constraints.model.couplings import Gear, Linear, RackPinion
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.joints import Fixed, Planar, Prismatic, Revolute
from assembly.constraints.model.mates import Insert
from assembly.errors import InputError, positive
from assembly.files.primitives import Primitive, primitives_of
from assembly.files.robot import Inertial, Robot, UrdfError
from assembly.files.stl import stl_bytes
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame
from assembly.step.documents import checked_unit

__all__ = ["write_urdf"]

Array = NDArray[np.float64]
_TYPES: dict[type[Joint], str] = {Fixed: "fixed", Planar: "planar", Prismatic: "prismatic", Revolute: "revolute"}
# z and y of frames with opposed axes point against each other, x the same way.
_OPPOSED = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class _Link:
    """A link: its body, where its origin is on the body, and the joint that carries it, from the parent."""

    body: Body
    origin: Array
    joint: Joint | None = None
    parent: _Link | None = None

    @property
    def sides(self) -> tuple[Frame, Frame]:
        """The joint's frames on the parent and on the body."""
        assert self.joint is not None
        a, b = _frames(self.joint)
        return (a, b) if b.body is self.body else (b, a)


def _frames(joint: Joint) -> tuple[Frame, Frame]:
    """The frames of a joint that coincide where its coordinates are zero."""
    a, b = joint.frame_a, joint.frame_b
    if isinstance(joint, Insert) and joint.offset:
        a = a.body.frame(a.origin + joint.offset * a.axes[:, 2], a.axes[:, 2], a.axes[:, 0])
    return a, b


def write_urdf(
    path: str | PathLike[str],
    what: Robot | Assembly,
    *,
    unit: str = "mm",
    name: str | None = None,
    density: float | None = None,
) -> None:
    """Write bodies and joints as a robot.

    Parameters
    ----------
    path : str or path
        Where to write. A body that is neither a box, a cylinder nor a ball is written as a mesh to an STL file beside
        it, named after the file and the link, and so is `body.picture`, as the link's visual. Existing files are
        replaced.
    what : Robot or Assembly
        Joints are `Revolute`, `Prismatic`, `Planar` or `Fixed`, or such mates, and form a tree with one root. Every
        joint is written without its driven value, with its limits; couplings of angles, or of a slide and an angle, are
        written as joints that mimic others. Other constraints, and objectives, raise.
    unit : str
        Of the bodies: "um", "mm", "cm", "m", "in" or "ft"; the file has meters.
    name : str, optional
        Of the robot; by default its own, or the file's.
    density : float, optional
        Kilograms per cubic meter for a `body.density` of one, positive; used for closed bodies. Without it a Robot has
        the masses it was read with, and an Assembly none.

    Notes
    -----
    A link's origin is that of the joint's frame on it, with the axes of its body; the root's is its body's. Efforts and
    velocities are written as zero.

    Raises
    ------
    UrdfError
        What is no tree, or has constraints that no robot has; nothing is written then.
    """
    target = checked_suffix(path, ".urdf", ".xml", shown=".urdf")
    if not isinstance(what, (Robot, Assembly)):
        raise TypeError(f"what is {what!r}; expected a Robot or an Assembly")
    constraints = (*what.joints, *what.couplings) if isinstance(what, Robot) else what.constraints
    joints = [item for item in constraints if isinstance(item, Joint)]
    couplings = [item for item in constraints if isinstance(item, (Gear, Linear, RackPinion))]
    for item in constraints:
        if not isinstance(item, (*_TYPES, Gear, Linear, RackPinion)):
            raise UrdfError(
                f"{item.name!r} is {item!r}; expected Revolute, Prismatic, Planar, Fixed, a Gear, Linear or RackPinion"
            )
    title = name or (what.name if isinstance(what, Robot) else target.stem)
    scale = 1e-3 * checked_unit(unit)
    inertials = what.inertials if isinstance(what, Robot) else {}
    if density is not None:
        inertials = _weighed(what.bodies, positive("density", density) * scale**3)
    writer = _Writer(target, scale, inertials)
    root = ElementTree.Element("robot", name=title)
    links = _tree(what.bodies, joints)
    for link in links:
        root.append(writer.link(link))
    for link in links:
        if link.joint is not None:
            root.append(writer.joint(link, couplings))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    for file, mesh in writer.meshes.items():
        (target.parent / file).write_bytes(mesh)
    target.write_bytes(text + b"\n")


def _tree(bodies: Sequence[Body], joints: Sequence[Joint]) -> list[_Link]:
    """Links, parents first, from the fixed body, or from the one body that no joint has as its second."""
    roots = [body for body in bodies if body.fixed]
    if not roots:
        carried = {id(joint.frame_b.body) for joint in joints}
        roots = [body for body in bodies if id(body) not in carried]
    if len(roots) != 1:
        names = [body.name for body in roots]
        raise UrdfError(f"bodies that are fixed, or that no joint carries, are {names}; expected one, the robot's root")
    links, left = [_Link(roots[0], np.zeros(3))], list(joints)
    place = 0
    while place < len(links):
        parent = links[place]
        for joint in [item for item in left if any(body is parent.body for body in item.bodies)]:
            left.remove(joint)
            a, b = _frames(joint)
            frame = b if a.body is parent.body else a
            if any(link.body is frame.body for link in links):
                raise UrdfError(f"joint {joint.name!r} closes a loop at {frame.body.name!r}; expected a tree")
            links.append(_Link(frame.body, frame.origin, joint, parent))
        place += 1
    lost = [body.name for body in bodies if not any(link.body is body for link in links)]
    if lost:
        raise UrdfError(f"bodies {lost} are connected to the root by no joints; expected joints to all")
    return links


class _Writer:
    """What is written of a robot; `meshes` are the files beside it."""

    def __init__(self, target: Path, scale: float, inertials: Mapping[str, Inertial]) -> None:
        self._target = target
        self._scale = scale
        self._inertials = inertials
        self.meshes: dict[str, bytes] = {}
        self._files: dict[tuple[str, bool], str] = {}

    def link(self, link: _Link) -> ElementTree.Element:
        """A link with what it weighs and its shape."""
        body = link.body
        element = ElementTree.Element("link", name=body.name)
        inertial = self._inertials.get(body.name)
        if inertial is not None:
            part = ElementTree.SubElement(element, "inertial")
            self._place(part, inertial.center_of_mass - link.origin, np.eye(3))
            ElementTree.SubElement(part, "mass", value=repr(float(inertial.mass)))
            inertia = inertial.inertia * self._scale**2
            names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
            ElementTree.SubElement(part, "inertia", {key: repr(float(inertia[at])) for key, at in names.items()})
        if body.picture is not None:
            self._mesh(ElementTree.SubElement(element, "visual"), link, body)
        if body.faces:
            primitives = primitives_of(body)
            exact = copy(body)
            exact.picture = None
            for kind in ("visual", "collision") if body.picture is None else ("collision",):
                if primitives is None:
                    self._mesh(ElementTree.SubElement(element, kind), link, exact)
                for primitive in primitives or ():
                    self._primitive(ElementTree.SubElement(element, kind), link, primitive)
        return element

    def _place(self, element: ElementTree.Element, position: Array, axes: Array) -> None:
        xyz = " ".join(repr(float(self._scale * x)) for x in position)
        rpy = " ".join(repr(float(angle)) for angle in _roll_pitch_yaw(axes))
        ElementTree.SubElement(element, "origin", xyz=xyz, rpy=rpy)

    def _mesh(self, element: ElementTree.Element, link: _Link, shown: Body) -> None:
        """Triangles of a body beside the file: of its picture where it has one, else of its faces."""
        file = self._files.get((shown.name, shown.picture is None))
        if file is None:
            stem, count = f"{self._target.stem}_{_file_name(shown.name)}", 2
            file = f"{stem}.stl"
            # Names that differ by signs that no file has, or by capitals, which some systems do not tell apart.
            while file.lower() in map(str.lower, self.meshes):
                file, count = f"{stem}_{count}.stl", count + 1
            self._files[shown.name, shown.picture is None] = file
            self.meshes[file] = stl_bytes([(shown, np.eye(3), -link.origin)], self._scale)
        self._place(element, np.zeros(3), np.eye(3))
        ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), "mesh", filename=file)

    def _primitive(self, element: ElementTree.Element, link: _Link, primitive: Primitive) -> None:
        self._place(element, primitive.center - link.origin, primitive.axes)
        lengths = [repr(float(self._scale * each)) for each in primitive.lengths]
        fields = {
            "box": {"size": " ".join(lengths)},
            "cylinder": dict(zip(("radius", "length"), lengths, strict=False)),
            "sphere": {"radius": lengths[0]},
        }
        ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), primitive.kind, fields[primitive.kind])

    def joint(self, link: _Link, couplings: Sequence[Gear | Linear | RackPinion]) -> ElementTree.Element:
        """The joint that carries a link."""
        joint, parent = link.joint, link.parent
        assert joint is not None and parent is not None
        (low, high), kind = (
            self._limits(joint),
            next(word for type_, word in _TYPES.items() if isinstance(joint, type_)),
        )
        if isinstance(joint, Planar) and joint.offset != 0.0:
            raise UrdfError(f"joint {joint.name!r} is planar at an offset of {joint.offset:g}; expected 0")
        if kind == "revolute" and low == -np.inf and high == np.inf:
            kind = "continuous"
        elif kind in ("revolute", "prismatic") and not np.isfinite([low, high]).all():
            raise UrdfError(f"joint {joint.name!r} has limits from {low:g} to {high:g}; expected finite ones")
        if isinstance(joint, Planar) and any(freedom.limits for freedom in joint.freedoms.values()):
            raise UrdfError(f"joint {joint.name!r} is planar with limits, which a file cannot have; expected none")
        element = ElementTree.Element("joint", name=joint.name, type=kind)
        ElementTree.SubElement(element, "parent", link=parent.body.name)
        ElementTree.SubElement(element, "child", link=link.body.name)
        on_parent, on_child = link.sides
        between = _OPPOSED if joint.axes == "opposed" else np.eye(3)
        self._place(element, on_parent.origin - parent.origin, on_parent.axes @ between @ on_child.axes.T)
        # Turns and slides are along z of frame a; seen from frame b they go the other way.
        axis = on_child.axes @ between[:, 2] if joint.frame_a.body is on_parent.body else -on_child.axes[:, 2]
        ElementTree.SubElement(element, "axis", xyz=" ".join(repr(float(x)) for x in axis))
        if kind in ("revolute", "prismatic"):
            limits = {"lower": repr(float(low)), "upper": repr(float(high)), "effort": "0", "velocity": "0"}
            ElementTree.SubElement(element, "limit", limits)
        self._mimic(element, joint, couplings)
        return element

    def _limits(self, joint: Joint) -> tuple[float, float]:
        if not isinstance(joint, (Revolute, Prismatic)) or joint.limits is None:
            return -np.inf, np.inf
        low, high = joint.limits
        factor = self._scale if isinstance(joint, Prismatic) else 1.0
        return (-np.inf if low is None else factor * low), (np.inf if high is None else factor * high)

    def _mimic(
        self, element: ElementTree.Element, joint: Joint, couplings: Sequence[Gear | Linear | RackPinion]
    ) -> None:
        for coupling in couplings:
            if coupling.follower.joint is not joint:
                continue
            ratio = self._scale * coupling.radius if isinstance(coupling, RackPinion) else coupling.ratio
            offset = coupling.offset if isinstance(coupling, Gear) else self._scale * coupling.offset
            values = {"multiplier": repr(float(ratio)), "offset": repr(float(offset))}
            ElementTree.SubElement(element, "mimic", {"joint": coupling.leader.joint.name, **values})


def _weighed(bodies: Sequence[Body], factor: float) -> dict[str, Inertial]:
    """What closed bodies weigh, by name, where a factor times their density is kilograms a cubed unit."""
    found = {}
    for body in bodies:
        try:
            own = body.mass_properties
        except InputError:
            continue
        found[body.name] = Inertial(factor * own.mass, own.center_of_mass, factor * own.inertia)
    return found


def _roll_pitch_yaw(axes: Array) -> Array:
    """Turns about the fixed axes x, y and z, in this order; at a pitch of a quarter turn one of several triples."""
    angles: Array = Rotation.from_matrix(axes).as_euler("xyz", suppress_warnings=True)
    return angles


def _file_name(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)
