"""Scenes, and how they move, as glTF: one binary file that browsers, viewers and Blender open."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from math import sqrt
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly._file_names import checked_suffix
from assembly.errors import positive
from assembly.kinematics.body import Body
from assembly.solve.solution import Solution
from assembly.step.documents import checked_unit
from assembly.step.placed import placed_bodies
from assembly.view.mesh import Mesh, body_mesh
from assembly.view.picture import body_colors
from assembly.view.series import Trajectory, trajectory_rows

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["write_gltf"]

Array = NDArray[np.float64]
_HALF = sqrt(0.5)
# Numbers of the format for kinds of data.
_FLOAT, _UNSIGNED, _VERTICES, _INDICES = 5126, 5125, 34962, 34963


def write_gltf(
    path: str | PathLike[str],
    what: Assembly | Solution | Body | Sequence[Body],
    trajectory: Trajectory | None = None,
    *,
    seconds: float = 5.0,
    unit: str = "mm",
) -> None:
    """Write bodies with their names, colors and poses, and an animation where there is a trajectory.

    Parameters
    ----------
    path : str or path
        Ends in .glb; an existing file is replaced.
    what : Assembly, Solution, Body or several bodies
        A body without a shape and a picture is a node without a mesh.
    trajectory : (frames, n, 7) or sequence of Solution, optional
        Poses of all bodies of an Assembly, rows as in `scene.q`, or its solutions; two frames at least. They are played
        at a constant rate; between two of them bodies move along lines and turn at constant speed.
    seconds : float
        From the first frame to the last.
    unit : str
        Of the bodies: "um", "mm", "cm", "m", "in" or "ft"; the file has meters, and y upward.

    Raises
    ------
    InputError, TypeError
        Another suffix, no bodies, or a trajectory of something else; nothing is written then.
    ImportError
        Without pygltflib, of the extra `meshes`.
    """
    target = checked_suffix(path, ".glb")
    scale = 1e-3 * checked_unit(unit)
    duration = positive("seconds", seconds)
    placed = placed_bodies(what)
    rows = None
    if trajectory is not None:
        scene: Any = what
        if not hasattr(scene, "q") or not hasattr(scene, "bodies"):
            raise TypeError(f"what is {what!r}; expected an Assembly, of which the trajectory is")
        rows, _ = trajectory_rows(scene, trajectory)
    document = _Document(scale)
    colors = body_colors([body for body, _ in placed])
    for (body, pose), color in zip(placed, colors, strict=True):
        document.add(body, pose.q, color)
    if rows is not None:
        document.animate(rows, duration)
    target.write_bytes(document.written())


class _Document:
    """A glTF document while it is made: nodes, their meshes, and one block of numbers."""

    def __init__(self, scale: float) -> None:
        self._g = _pygltflib()
        self._block = bytearray()
        self._meshes: dict[tuple[Any, ...], int] = {}
        self.made = self._g.GLTF2(
            asset=self._g.Asset(version="2.0", generator="assembly"),
            scene=0,
            scenes=[self._g.Scene(nodes=[0])],
            # z upward and lengths of bodies, as y upward and meters.
            nodes=[self._g.Node(name="scene", rotation=[-_HALF, 0.0, 0.0, _HALF], scale=[scale] * 3, children=[])],
        )

    def add(self, body: Body, row: Array, color: tuple[float, float, float]) -> None:
        """A node of a body at a pose."""
        x, y, z, w, i, j, k = (float(number) for number in row)
        node = self._g.Node(name=body.name, translation=[x, y, z], rotation=[i, j, k, w])
        mesh = body_mesh(body)
        if mesh is not None:
            # Bodies of the same faces, picture and color share a mesh.
            key = (*(id(side.face) for side in body.faces), id(body.picture), color)
            if key not in self._meshes:
                self._meshes[key] = self._mesh(body.name, mesh, color)
            node.mesh = self._meshes[key]
        self.made.nodes[0].children.append(len(self.made.nodes))
        self.made.nodes.append(node)

    def _mesh(self, name: str, mesh: Mesh, color: tuple[float, float, float]) -> int:
        g = self._g
        places = {
            "POSITION": self._accessor(mesh.vertices, "VEC3", _VERTICES, bounds=True),
            "NORMAL": self._accessor(mesh.normals, "VEC3", _VERTICES),
        }
        base = _linear(np.array(color))
        if mesh.colors is not None:
            own = np.where(np.isnan(mesh.colors), np.array(color), mesh.colors)
            places["COLOR_0"] = self._accessor(_linear(own), "VEC3", _VERTICES)
            base = np.ones(3)
        material = g.PbrMetallicRoughness(
            baseColorFactor=[*map(float, base), 1.0], metallicFactor=0.1, roughnessFactor=0.6
        )
        self.made.materials.append(g.Material(name=name, pbrMetallicRoughness=material, doubleSided=True))
        primitive = g.Primitive(
            attributes=g.Attributes(**places),
            indices=self._accessor(mesh.triangles.astype(np.uint32).reshape(-1), "SCALAR", _INDICES),
            material=len(self.made.materials) - 1,
        )
        self.made.meshes.append(g.Mesh(name=name, primitives=[primitive]))
        return len(self.made.meshes) - 1

    def _accessor(self, values: NDArray[Any], kind: str, target: int | None = None, bounds: bool = False) -> int:
        """Numbers put into the block; their place in the list of accessors."""
        g = self._g
        if values.dtype != np.uint32:
            values = values.astype(np.float32)
        data = values.tobytes()
        self.made.bufferViews.append(
            g.BufferView(buffer=0, byteOffset=len(self._block), byteLength=len(data), target=target)
        )
        self._block += data
        accessor = g.Accessor(
            bufferView=len(self.made.bufferViews) - 1,
            componentType=_UNSIGNED if values.dtype == np.uint32 else _FLOAT,
            count=len(values),
            type=kind,
        )
        if bounds:
            columns = values.reshape(len(values), -1)
            accessor.min, accessor.max = columns.min(axis=0).tolist(), columns.max(axis=0).tolist()
        self.made.accessors.append(accessor)
        return len(self.made.accessors) - 1

    def animate(self, rows: Array, seconds: float) -> None:
        """Poses (frames, n, 7) of all nodes but the first, at a constant rate."""
        g = self._g
        times = self._accessor(np.linspace(0.0, seconds, len(rows)), "SCALAR", bounds=True)
        animation = g.Animation(name="trajectory", samplers=[], channels=[])
        for number in range(rows.shape[1]):
            turns = rows[:, number, [4, 5, 6, 3]].copy()
            for k in range(1, len(turns)):
                # The shorter way from one quaternion to the next.
                if turns[k] @ turns[k - 1] < 0.0:
                    turns[k] *= -1.0
            for path, values, kind in (("translation", rows[:, number, :3], "VEC3"), ("rotation", turns, "VEC4")):
                output = self._accessor(np.ascontiguousarray(values), kind)
                animation.samplers.append(g.AnimationSampler(input=times, output=output, interpolation="LINEAR"))
                target = g.AnimationChannelTarget(node=1 + number, path=path)
                animation.channels.append(g.AnimationChannel(sampler=len(animation.samplers) - 1, target=target))
        self.made.animations.append(animation)

    def written(self) -> bytes:
        """The whole file."""
        self.made.buffers = [self._g.Buffer(byteLength=len(self._block))]
        self.made.set_binary_blob(bytes(self._block))
        return b"".join(self.made.save_to_bytes())


def _linear(color: Array) -> Array:
    """Colors of screens (sRGB) as linear ones, which glTF has."""
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


def _pygltflib() -> Any:
    try:
        return import_module("pygltflib")
    except ImportError:
        raise ImportError("glTF files need pygltflib, which is not installed; install the extra meshes") from None
