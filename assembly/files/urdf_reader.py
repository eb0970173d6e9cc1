"""Robots read from URDF files: links become bodies, joints become joints."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from assembly._file_names import read_elsewhere
from assembly.constraints.model.couplings import Coupling, Gear, Linear, RackPinion
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.joints import Fixed, Planar, Prismatic, Revolute
from assembly.errors import AssemblyError, file_path
from assembly.files.robot import Inertial, Robot, UrdfError, UrdfWarning, yourdfpy
from assembly.files.urdf_shapes import LinkPictures, link_faces, origin_of
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose
from assembly.step.documents import checked_unit

__all__ = ["read_urdf"]

_METER = 1000.0  # millimeters


def read_urdf(path: str | PathLike[str], *, unit: str = "mm") -> Robot:
    """Bodies and joints of a robot.

    Parameters
    ----------
    path : str or path
        A URDF file; lengths in it are meters.
    unit : str
        Of the robot that is made: "um", "mm", "cm", "m", "in" or "ft".

    Returns
    -------
    Robot
        Boxes, cylinders and spheres of `<collision>` are exact shapes of the bodies. `<visual>` becomes the body's
        `picture` if it contains meshes or if there are no exact shapes; a mesh of `<collision>` does if there is
        nothing else to show. A mesh is no exact shape and has no contacts. Revolute, continuous, prismatic, planar and
        fixed joints become `Revolute`, `Prismatic`, `Planar` and `Fixed` with their limits; a floating joint constrains
        nothing; a joint that mimics another one is coupled to it.

    Raises
    ------
    UrdfError
        No robot's text, joints that are no tree, or values that no robot can have; the text names link or joint.
    FileNotFoundError
        No such file, or a folder.
    ImportError
        Without yourdfpy, of the extra `robots`.

    Warns
    -----
    UrdfWarning
        Meshes of which there is no file that can be read; these are left out. Their names are looked for from the
        file's folder and those above it, `package://` names without the package as well.
    """
    scale = _METER / checked_unit(unit)
    file = file_path("path", path)
    robot = _parsed(str(file))
    reader = _Reader(robot, scale, LinkPictures(robot, file, scale))
    try:
        made = reader.robot()
    except AssemblyError as error:
        raise UrdfError(f"path is {str(file)!r}; {error}") from None
    if reader.pictures.lost:
        warnings.warn(f"{file}: {'; '.join(reader.pictures.lost)}; left out", UrdfWarning, 2)
    return made


def _parsed(path: str) -> Any:
    if not Path(path).is_file():
        raise FileNotFoundError(f"path is {path!r}; {'a folder' if Path(path).is_dir() else 'no such file'}")
    module = yourdfpy()
    try:
        loaded = module.URDF.load(path, build_scene_graph=False, load_meshes=False)
    except Exception as error:  # whatever its parser trips over, the file is what is wrong
        elsewhere = read_elsewhere(Path(path), (".urdf", ".xml"))
        raise UrdfError(
            f"path is {path!r}; expected a URDF file ({type(error).__name__}: {error}){elsewhere}"
        ) from None
    if not loaded.robot.links:
        raise UrdfError(f"path is {path!r}; it has no links; expected a robot")
    return loaded.robot


class _Reader:
    """A robot while it is made."""

    def __init__(self, robot: Any, scale: float, pictures: LinkPictures) -> None:
        self._robot = robot
        self._scale = scale
        self.pictures = pictures

    def robot(self) -> Robot:
        """Links as bodies, joints, what mimics others."""
        links = {_name("link", link.name): link for link in self._robot.links}
        if len(links) < len(self._robot.links):
            raise UrdfError("two links have the same name; expected distinct names")
        order = self._tree(list(links))
        poses: dict[str, Pose] = {}
        for name, joint in order:
            poses[name] = Pose() if joint is None else poses[joint.parent] @ origin_of(joint, self._scale)
        root = order[0][0]
        bodies = {name: self._body(link, poses[name], fixed=name == root) for name, link in links.items()}
        joints = {joint.name: made for joint in self._robot.joints if (made := self._joint(joint, bodies)) is not None}
        couplings = [self._coupling(joint, joints) for joint in self._robot.joints if joint.mimic is not None]
        inertials = {
            name: self._inertial(name, link.inertial) for name, link in links.items() if link.inertial is not None
        }
        return Robot(
            self._robot.name or "robot", tuple(bodies.values()), tuple(joints.values()), tuple(couplings), inertials
        )

    def _tree(self, links: Sequence[str]) -> list[tuple[str, Any]]:
        """Links with the joints that carry them, parents first."""
        carried: dict[str, Any] = {}
        names = set()
        for joint in self._robot.joints:
            if _name("joint", joint.name) in names:
                raise UrdfError(f"two joints are named {joint.name!r}; expected distinct names")
            names.add(joint.name)
            for link in (joint.parent, joint.child):
                if link not in links:
                    raise UrdfError(f"joint {joint.name!r} is on link {link!r}; expected one of {', '.join(links)}")
            if joint.child in carried:
                raise UrdfError(f"link {joint.child!r} has two parents; expected a tree")
            carried[joint.child] = joint
        roots = [name for name in links if name not in carried]
        if len(roots) != 1:
            raise UrdfError(f"links without a parent are {roots}; expected one")
        order, below = [(roots[0], None)], [roots[0]]
        while below:
            parent = below.pop(0)
            children = [joint for joint in self._robot.joints if joint.parent == parent]
            order += [(joint.child, joint) for joint in children]
            below += [joint.child for joint in children]
        if len(order) < len(links):
            raise UrdfError(f"links {sorted(set(links) - {name for name, _ in order})} form a ring of joints")
        return order

    def _body(self, link: Any, pose: Pose, fixed: bool) -> Body:
        faces = link_faces(link, link.collisions, self._scale)
        body = Body(link.name, faces or None, pose.position, pose.quaternion, fixed)
        body.picture = self.pictures.of(link, bool(faces))
        return body

    def _joint(self, joint: Any, bodies: dict[str, Body]) -> Joint | None:
        place = origin_of(joint, self._scale)
        axis = np.array([1.0, 0.0, 0.0]) if joint.axis is None else np.asarray(joint.axis, dtype=np.float64)
        kinds: dict[str, type[Joint]] = {
            "revolute": Revolute, "continuous": Revolute, "prismatic": Prismatic, "planar": Planar, "fixed": Fixed,
        }  # fmt: skip
        if joint.type == "floating":
            return None
        if joint.type not in kinds:
            known = ", ".join([*kinds, "floating"])
            raise UrdfError(f"joint {joint.name!r} has the type {joint.type!r}; expected one of {known}")
        if joint.type == "fixed":
            axis = np.array([0.0, 0.0, 1.0])
        try:
            at_child = bodies[joint.child].frame(z=axis)
            axes = place.matrix[:3, :3] @ at_child.axes
            at_parent = bodies[joint.parent].frame(place.position, axes[:, 2], axes[:, 0])
            limits = self._limits(joint)
            return kinds[joint.type](at_parent, at_child, joint.name, **limits)
        except AssemblyError as error:
            raise UrdfError(f"joint {joint.name!r}: {error}") from None

    def _limits(self, joint: Any) -> dict[str, Any]:
        if joint.type not in ("revolute", "prismatic"):
            return {}
        limit = joint.limit
        if limit is None or (limit.lower is None and limit.upper is None):
            raise UrdfError(f"joint {joint.name!r} is {joint.type} and has no limits; expected lower and upper ones")
        factor = self._scale if joint.type == "prismatic" else 1.0
        # What a file leaves out is zero there.
        low, high = (0.0 if end is None else factor * float(end) for end in (limit.lower, limit.upper))
        return {"limits": (low, high)}

    def _coupling(self, joint: Any, joints: dict[str, Joint]) -> Coupling:
        led, leader = joints.get(joint.name), joints.get(joint.mimic.joint)
        if led is None or leader is None or leader is led:
            raise UrdfError(f"joint {joint.name!r} mimics {joint.mimic.joint!r}; expected another joint that moves")
        ratio = 1.0 if joint.mimic.multiplier is None else float(joint.mimic.multiplier)
        offset = 0.0 if joint.mimic.offset is None else float(joint.mimic.offset)
        if not np.isfinite([ratio, offset]).all() or ratio == 0.0:
            raise UrdfError(
                f"joint {joint.name!r} mimics by {ratio:g} and {offset:g}; expected finite numbers, not by 0"
            )
        name, scale = f"{joint.name} mimics {joint.mimic.joint}", self._scale
        if isinstance(led, Revolute) and isinstance(leader, Revolute):
            return Gear(leader, led, ratio, name, offset)
        if isinstance(led, Prismatic) and isinstance(leader, Revolute):
            return RackPinion(leader, led, ratio * scale, name, offset * scale)
        if isinstance(led, Prismatic) and isinstance(leader, Prismatic):
            return Linear(leader, led, ratio, name, offset * scale)
        if isinstance(led, Revolute) and isinstance(leader, Prismatic):
            # angle = ratio slide + offset, as a pinion has it the other way around.
            return RackPinion(led, leader, scale / ratio, name, -offset / ratio * scale)
        raise UrdfError(f"joint {joint.name!r} is {joint.type} and mimics; expected a turn or a slide that mimics one")

    def _inertial(self, name: str, inertial: Any) -> Inertial:
        place = origin_of(inertial, self._scale)
        mass = 0.0 if inertial.mass is None else float(inertial.mass)
        inertia = np.zeros((3, 3)) if inertial.inertia is None else np.asarray(inertial.inertia, dtype=np.float64)
        if not (np.isfinite(inertia).all() and np.isfinite(mass) and mass >= 0.0):
            raise UrdfError(f"link {name!r} weighs {mass:g}, with {inertia.tolist()}; expected finite numbers")
        turned = place.matrix[:3, :3] @ inertia @ place.matrix[:3, :3].T
        return Inertial(mass, place.position, turned * self._scale**2)


def _name(what: str, name: Any) -> str:
    if not isinstance(name, str) or not name.strip():
        raise UrdfError(f"a {what} has the name {name!r}; expected a nonempty string")
    return name
