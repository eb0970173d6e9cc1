"""Body: a rigid thing with a name, a pose and faces."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._html import Table, as_html
from assembly.errors import InputError, check_coordinates, checked_color, positive, text
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.body_face import BodyFace
from assembly.kinematics.changes import count_edit, count_number
from assembly.kinematics.frame import Frame, Point, checked_place, frozen
from assembly.kinematics.parametric import Parametric
from assembly.kinematics.picture_mesh import PictureMesh
from assembly.kinematics.pose import Pose, direction, length
from assembly.kinematics.weighed import Weighed

if TYPE_CHECKING:
    from assembly.selection.edges import Edges
    from assembly.selection.faces import Faces
    from assembly.selection.vertices import Vertices

__all__ = ["Body", "BodyFace", "Shape"]

Array = NDArray[np.float64]
Shape = NurbsSurface | Face | Iterable[NurbsSurface | Face] | Parametric


def _given_pose(position: ArrayLike, quaternion: ArrayLike, pose: Pose | None) -> Pose:
    """The pose that a body is made with."""
    if pose is None:
        if isinstance(quaternion, (tuple, list)) and list(quaternion) == [0, 0, 0, 1]:
            warnings.warn(
                "quaternion is (0, 0, 0, 1), half a turn about z: (w, x, y, z) is expected, scipy has w last; "
                "say pose=Pose.from_axis_angle((0, 0, 1), pi) where it is meant",
                stacklevel=3,
            )
        # Pose takes what is like an array, which its fields do not say: they are tuples once it is made.
        return Pose(position, quaternion)  # type: ignore[arg-type]  # Pose converts them
    if not np.array_equal(position, (0, 0, 0)) or not np.array_equal(quaternion, (1, 0, 0, 0)):
        raise InputError("pose is given beside position or quaternion; expected either")
    return pose


def _flag(name: str, value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{name} is {value!r}; expected True or False")
    return bool(value)


class Body(Weighed):
    """A rigid body. Its pose, its density and whether it is fixed may be set; its name and its shape cannot be changed.

    Parameters
    ----------
    name : str
        Not empty; unique in an assembly.
    shape : NurbsSurface, Face, or several of them, or Parametric, optional
        In body coordinates. A surface's outward normal is Su x Sv. Numbers of a `Parametric` can be set.
    position, quaternion
        Where the body stands, body to world; the quaternion is (w, x, y, z), unit to within a percent.
    fixed : bool
        A fixed body does not move in a solve and costs no unknowns. Settable.
    color : (red, green, blue), optional
        0 to 1 each, for pictures and files; settable.
    density : float
        Mass per volume, positive; settable.
    picture : PictureMesh, optional
        Triangles that are drawn instead of the body's faces; settable.
    pose : Pose, optional
        Pose of the body, instead of position and quaternion.

    Raises
    ------
    InputError, TypeError
        The message names the argument, its value and what was expected.
    """

    def __init__(
        self,
        name: str,
        shape: Shape | None = None,
        position: ArrayLike = (0.0, 0.0, 0.0),
        quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        fixed: bool = False,
        color: Sequence[float] | None = None,
        density: float = 1.0,
        picture: PictureMesh | None = None,
        *,
        pose: Pose | None = None,
    ) -> None:
        self._name = text("name", name)
        self._fixed = _flag("fixed", fixed)
        self.pose = _given_pose(position, quaternion, pose)
        self._shape = shape if isinstance(shape, Parametric) else None
        self._faces = self._selectable(self._named(shape.made() if isinstance(shape, Parametric) else shape))
        if self._shape is not None:
            self._shape._belongs_to(self)
        self._edges: Edges | None = None
        # Found when it is first asked for.
        self._size: float | None = None
        self.color = color
        self._density = positive("density", density)
        self.picture = picture

    def __copy__(self) -> Self:
        """A body of the same name, with faces of its own that stand on the same surfaces."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other._edges = None
        # The numbers of a shape are those of the original alone.
        other._shape = None
        other._faces = other._selectable(BodyFace(other, side.face, side.name) for side in self._faces)
        return other

    @property
    def name(self) -> str:
        """Name of the body."""
        return self._name

    @property
    def fixed(self) -> bool:
        """Whether the body stays where it is; settable. Constraints between fixed bodies have no effect."""
        return self._fixed

    @fixed.setter
    def fixed(self, value: bool) -> None:
        self._fixed = _flag("fixed", value)
        count_edit()

    @property
    def shape(self) -> Parametric:
        """The shape whose numbers may be set anew.

        Raises
        ------
        InputError
            A body whose shape is no `Parametric`; `faces` has what it is.
        """
        if self._shape is None:
            raise InputError(f"body {self.name!r} has faces that are no function of numbers; expected a Parametric")
        return self._shape

    @property
    def faces(self) -> Faces:
        """Faces in the order they were given: a tuple, of which `faces.planes(...)`, `faces(">Z")` ... select some."""
        return self._faces

    @property
    def edges(self) -> Edges:
        """Edges: where faces meet, or end; `edges.circles(...)`, `edges("|Z")` ... select some."""
        if self._edges is None:
            from assembly.selection.edges import edges_of

            self._edges = edges_of(self)
        return self._edges

    @property
    def vertices(self) -> Vertices:
        """Vertices: where edges end."""
        from assembly.selection.vertices import vertices_of

        return vertices_of(self)

    @property
    def pose(self) -> Pose:
        """Where the body stands; settable. A solve starts here and does not change it."""
        return self._pose

    @pose.setter
    def pose(self, value: Pose) -> None:
        if not isinstance(value, Pose):
            raise TypeError(f"pose is {value!r}; expected a Pose")
        check_coordinates("pose.position", value.position.tolist())
        self._pose = value

    @property
    def color(self) -> tuple[float, float, float] | None:
        """Red, green and blue, or None for a color chosen when the body is drawn."""
        return self._color

    @color.setter
    def color(self, value: Sequence[float] | None) -> None:
        self._color = checked_color(value)

    @property
    def picture(self) -> PictureMesh | None:
        """Triangles that the body is drawn with, or None where it is drawn by its faces."""
        return self._picture

    @picture.setter
    def picture(self, value: PictureMesh | None) -> None:
        if value is not None and not isinstance(value, PictureMesh):
            raise TypeError(f"picture is {value!r}; expected a PictureMesh or None")
        self._picture = value

    def _selectable(self, faces: Iterable[BodyFace]) -> Faces:
        from assembly.selection.faces import Faces

        return Faces(faces, f"{self._name}.faces")

    def _named(self, shape: Shape | None) -> tuple[BodyFace, ...]:
        if shape is None:
            return ()
        if not isinstance(shape, (NurbsSurface, Face, Iterable)):
            raise TypeError(f"shape of body {self.name!r} is {shape!r}; expected NurbsSurface, Face or several")
        parts = [shape] if isinstance(shape, (NurbsSurface, Face)) else list(shape)
        if not parts:
            raise InputError(f"shape of body {self.name!r} is empty; expected a surface, or None for a body without")
        faces: list[BodyFace] = []
        names: set[str] = set()
        for k, part in enumerate(parts):
            if not isinstance(part, (NurbsSurface, Face)):
                raise TypeError(f"shape of body {self.name!r} holds {part!r}; expected NurbsSurface or Face")
            face = part if isinstance(part, Face) else Face(part)
            # Names of surfaces and faces may be set anew.
            name = text(f"shape[{k}].name", face.name or ("surface" if len(parts) == 1 else f"face {k + 1}"))
            if name in names:
                raise InputError(
                    f"shape of body {self.name!r} has two faces named {name!r}; expected distinct names, as "
                    "asm.shapes.joined(...) makes them"
                )
            names.add(name)
            faces.append(BodyFace(self, face, name))
        return tuple(faces)

    def _checked_faces(self, shape: Shape | None) -> tuple[Face, ...]:
        """Faces in place of those that there are.

        Raises
        ------
        InputError
            Not as many, or of other names.
        """
        made = self._named(shape)
        names, others = [side.name for side in self._faces], [side.name for side in made]
        if others != names:
            raise InputError(f"shape of body {self.name!r} has faces {others} now; expected {names}, as before")
        return tuple(side.face for side in made)

    def _take_faces(self, faces: Sequence[Face]) -> None:
        """Have other faces, each in its place: who has a `BodyFace` of the body has the new one."""
        for side, face in zip(self._faces, faces, strict=True):
            side._take(face)
        self._size, self._edges = None, None
        count_number(self)

    def __repr__(self) -> str:
        return f"Body({self.name!r}, {len(self.faces)} faces{', fixed' if self.fixed else ''})"

    def _repr_html_(self) -> str:
        kinds = Counter(str(side.kind) for side in self.faces)
        where = ", ".join(f"{x:.6g}" for x in self.pose.row)
        title = f"body {self.name!r}{', fixed' if self.fixed else ''} at x y z qw qx qy qz = {where}"
        return as_html(title, Table(("faces", "count"), list(kinds.items())))

    @property
    def q(self) -> Array:
        """The row x y z qw qx qy qz of the body's pose, (7,), read-only; set `pose` instead."""
        return self.pose.q

    @property
    def size(self) -> float:
        """Diagonal of the box around the control points of all faces; 0 without a shape."""
        if self._size is None:
            self._size = 0.0
            if self.faces:
                boxes = [face.face.surface.bounding_box() for face in self.faces]
                low = np.min([box[0] for box in boxes], axis=0)
                high = np.max([box[1] for box in boxes], axis=0)
                self._size = length(high - low)
        return self._size

    def face(self, name: str | None = None) -> BodyFace:
        """A face by name; the only face when no name is given.

        Raises
        ------
        InputError
            No such face, or no name where there are several; the message lists the names.
        """
        if name is None and len(self.faces) == 1:
            return self.faces[0]
        for face in self.faces:
            if face.name == name:
                return face
        known = ", ".join(repr(face.name) for face in self.faces) or "none, the body has no shape"
        raise InputError(f"name is {name!r}; expected a face of body {self.name!r}: {known}")

    def point(self, x: float, y: float, z: float) -> Point:
        """The point (x, y, z) of the body, in body coordinates."""
        return Point(self, checked_place("point", (x, y, z)))

    def frame(
        self, at: ArrayLike = (0.0, 0.0, 0.0), z: ArrayLike = (0.0, 0.0, 1.0), x: ArrayLike | None = None
    ) -> Frame:
        """A frame with origin `at` and axis `z`, both in body coordinates.

        Without `x`, the x axis is the coordinate axis farthest from `z`, made orthogonal to it; a given `x` is made
        orthogonal to `z` too and must not be parallel to it.
        """
        origin, axis = checked_place("at", at), direction("z", z)
        side = np.eye(3)[np.argmin(np.abs(axis))] if x is None else direction("x", x)
        across = side - (side @ axis) * axis
        if not np.linalg.norm(across) > 1e-9:
            raise InputError(f"x is {side.tolist()}; expected a direction that is not parallel to z {axis.tolist()}")
        # Once more: of a side almost along z little is left, and its rounding is along z.
        across = direction("x", across)
        across = direction("x", across - (across @ axis) * axis)
        axes = np.column_stack([across, np.cross(axis, across), axis])
        return Frame(self, origin, frozen(axes))
