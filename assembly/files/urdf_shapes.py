"""What links of URDF files look like: exact faces of primitives, and pictures of meshes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from assembly.errors import AssemblyError
from assembly.files.picture_reader import picture_of
from assembly.files.robot import UrdfError, yourdfpy
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body import Body
from assembly.kinematics.picture_mesh import PictureMesh
from assembly.kinematics.pose import Pose, axes_quaternion
from assembly.view.mesh import body_mesh

__all__ = ["LinkPictures", "link_faces", "origin_of"]

# Files of triangles that say no unit are in meters here, as all of a URDF file is [mm].
_METER = 1000.0


def origin_of(thing: Any, scale: float) -> Pose:
    """Where a joint or a shape is on its link."""
    matrix = np.eye(4) if thing.origin is None else np.asarray(thing.origin, dtype=np.float64)
    if not np.isfinite(matrix).all():
        raise UrdfError(f"{_label(thing)} has the origin {matrix.tolist()}; expected finite numbers")
    return Pose(matrix[:3, 3] * scale, axes_quaternion(matrix[:3, :3]))


def link_faces(link: Any, parts: Sequence[Any], scale: float) -> list[Face]:
    """Faces of the boxes, cylinders and spheres among the parts of a link, times `scale`; meshes have none."""
    found = []
    for number, part in enumerate(parts):
        try:
            label, faces = _primitive(part.geometry, scale)
        except AssemblyError as error:
            raise UrdfError(f"link {link.name!r}: {error}") from None
        place = origin_of(part, scale)
        before = part.name or (label if len(parts) == 1 else f"{label} {number + 1}")
        for item in faces:
            face = item if isinstance(item, Face) else Face(item)
            moved = face.transformed(place.matrix[:3, :3], place.position)
            moved.name = f"{before} {face.name}" if face.name else before
            found.append(moved)
    return found


def _primitive(geometry: Any, scale: float) -> tuple[str, Iterable[Face | NurbsSurface]]:
    if geometry.box is not None:
        return "box", shapes.box(*(scale * np.asarray(geometry.box.size, dtype=np.float64)).tolist())
    if geometry.cylinder is not None:
        return "cylinder", shapes.solid_cylinder(scale * geometry.cylinder.radius, scale * geometry.cylinder.length)
    if geometry.sphere is not None:
        return "sphere", (shapes.sphere(scale * geometry.sphere.radius),)
    return "mesh", ()


class LinkPictures:
    """Pictures of the links of a file; `lost` says which meshes there are none of, and why."""

    def __init__(self, robot: Any, path: Path, scale: float) -> None:
        self._path = path
        self._scale = scale
        self._colors = {each.name: each.color for each in robot.materials if each.color is not None}
        self._read: dict[str, PictureMesh | None] = {}
        self.lost: list[str] = []

    def of(self, link: Any, has_faces: bool) -> PictureMesh | None:
        """What is to be seen of a link in the place of its faces."""
        seen = link.visuals
        if not any(part.geometry.mesh is not None for part in seen):
            if has_faces:
                return None
            seen = seen or link.collisions
        pictures = [self._colored(picture, part) for part in seen if (picture := self._part(link, part)) is not None]
        return PictureMesh.joined(pictures) if pictures else None

    def _part(self, link: Any, part: Any) -> PictureMesh | None:
        mesh = part.geometry.mesh
        if mesh is None:
            drawn = body_mesh(Body("part", link_faces(link, [part], self._scale)))
            assert drawn is not None
            return PictureMesh(drawn.vertices, drawn.triangles)
        picture = self._mesh(link, mesh.filename)
        if picture is None:
            return None
        factors = self._scale * np.broadcast_to(1.0 if mesh.scale is None else mesh.scale, 3)
        if not (np.isfinite(factors).all() and factors.all()):
            raise UrdfError(f"link {link.name!r} has a mesh of scale {mesh.scale}; expected finite numbers, not 0")
        place = origin_of(part, self._scale)
        if np.prod(factors) < 0.0:
            # Of a mirror image the corners go the other way around.
            picture = PictureMesh(picture.vertices, picture.triangles[:, ::-1], picture.colors)
        return picture.moved(place.matrix[:3, :3] * factors, place.position)

    def _mesh(self, link: Any, name: str) -> PictureMesh | None:
        """A file of triangles in meters; None where it cannot be read."""
        if name not in self._read:
            self._read[name] = None
            try:
                found = yourdfpy().filename_handler_magic(name, str(self._path.resolve().parent))
                picture, said = picture_of(Path(found))
                self._read[name] = picture.moved((said or _METER) / _METER * np.eye(3), np.zeros(3))
            except (AssemblyError, FileNotFoundError, ImportError) as error:
                self.lost.append(f"link {link.name!r} has the mesh {name!r}: {error}")
        return self._read[name]

    def _colored(self, picture: PictureMesh, part: Any) -> PictureMesh:
        """With the color of its material, where it has none of its own."""
        material = getattr(part, "material", None)
        if material is None or picture.colors is not None:
            return picture
        color = material.color or self._colors.get(material.name)
        if color is None:
            return picture
        rgb = np.clip(np.asarray(color.rgba, dtype=np.float64)[:3], 0.0, 1.0)
        return PictureMesh(picture.vertices, picture.triangles, np.tile(rgb, (len(picture.vertices), 1)))


def _label(thing: Any) -> str:
    kind = type(thing).__name__.lower()
    return f"{kind} {thing.name!r}" if getattr(thing, "name", None) else f"a {kind}"
