"""A picture as commands of meshcat's viewer.

A command is a dictionary, packed as MessagePack; arrays are its extension types 0x16 (uint32) and 0x17 (float32).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import umsgpack
from numpy.typing import NDArray

from assembly.view.item import FIELD_OF_VIEW, Item, Picture
from assembly.view.motion import quaternions
from assembly.view.outline import Lines

__all__ = ["ROOT", "Command", "commands", "mesh_commands", "motion", "packed", "path_of", "stillness"]

Array = NDArray[np.float64]
Command = dict[str, Any]
# Everything drawn hangs here, so that it can be taken away at once.
ROOT = "/assembly"
_CAMERA = "/Cameras/default/rotated/<object>"
_LIGHT = "/Lights/FillLight/<object>"
# Colors of the background at the top and at the bottom.
_BACKGROUND = ((1.0, 1.0, 1.0), (0.87, 0.90, 0.94))
# Smaller changes are invisible, and lost in single precision.
_MOTIONLESS = 1e-9
# Color of edges.
_EDGE = 0x23262D
_IDENTITY = np.eye(4).ravel().tolist()


def _numbers(values: NDArray[Any], kind: str) -> umsgpack.Ext:
    code, dtype = {"float": (0x17, "<f4"), "index": (0x16, "<u4")}[kind]
    return umsgpack.Ext(code, np.ascontiguousarray(values, dtype=dtype).tobytes())


def _array(rows: NDArray[Any], kind: str) -> Command:
    name = {"float": "Float32Array", "index": "Uint32Array"}[kind]
    size = rows.shape[1] if kind == "float" else 1
    return {"itemSize": size, "type": name, "array": _numbers(rows, kind), "normalized": False}


def _geometry(item: Item, identifier: str) -> Command:
    mesh = item.mesh
    attributes = {"position": _array(mesh.vertices, "float"), "normal": _array(mesh.normals, "float")}
    if mesh.colors is not None:
        attributes["color"] = _array(np.where(np.isnan(mesh.colors), item.color, mesh.colors), "float")
    data = {"attributes": attributes, "index": _array(mesh.triangles, "index")}
    return {"uuid": identifier, "type": "BufferGeometry", "data": data}


def _line_geometry(lines: Lines, identifier: str) -> Command:
    data = {"attributes": {"position": _array(lines.points, "float")}, "index": _array(lines.segments, "index")}
    return {"uuid": identifier, "type": "BufferGeometry", "data": data}


def _material(item: Item, identifier: str) -> Command:
    # Colors of vertices are multiplied by the material's color, which has to be white then.
    colored = item.mesh.colors is not None
    red, green, blue = (round(255.0 * part) for part in ((1.0, 1.0, 1.0) if colored else item.color))
    material: Command = {
        "uuid": identifier,
        "type": "MeshPhongMaterial",
        "color": red << 16 | green << 8 | blue,
        "specular": 0x4A4A4A,
        "shininess": 70.0,
        "side": 2,  # both sides: open surfaces have an inside to look at
    }
    if colored:
        material["vertexColors"] = True
    if item.lines is not None:
        # Drawn slightly farther away than it is, so that it does not hide parts of the lines on it.
        material.update(polygonOffset=True, polygonOffsetFactor=1.0, polygonOffsetUnits=1.0)
    if item.in_front:
        # Transparent things are drawn last.
        material.update(transparent=True, opacity=0.85, depthTest=False)
    elif item.opacity < 1.0:
        # Only the side toward the camera; what is behind it is drawn, too.
        material.update(transparent=True, opacity=item.opacity, depthWrite=False, side=0)
    return material


def _object(path: str, kind: str, geometry: Command, material: Command) -> Command:
    """The command that puts something at a path, which may move it."""
    described = {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [geometry],
        "materials": [material],
        "object": {
            "uuid": path,
            "type": kind,
            "geometry": geometry["uuid"],
            "material": material["uuid"],
            "matrix": _IDENTITY,
        },
    }
    return {"type": "set_object", "path": path, "object": described}


def path_of(item: Item) -> str:
    """Where the viewer has an item; also the identifier of its mesh."""
    # The viewer splits paths at slashes, which names may contain.
    return "/".join([ROOT, *(part.replace("/", "\N{DIVISION SLASH}") for part in item.path)])


def _property(path: str, name: str, value: Any) -> Command:
    return {"type": "set_property", "path": path, "property": name, "value": value}


def mesh_commands(item: Item) -> Iterator[Command]:
    """Commands that put one thing where it is, with its edges."""
    path = path_of(item)
    yield _object(path, "Mesh", _geometry(item, f"{path}:geometry"), _material(item, f"{path}:material"))
    yield {"type": "set_transform", "path": path, "matrix": item.matrix.T.ravel().tolist()}
    if item.lines is not None:
        # Below the item's path, so that it moves with it.
        below = f"{path}/edges"
        material = {"uuid": f"{below}:material", "type": "LineBasicMaterial", "color": _EDGE}
        yield _object(below, "LineSegments", _line_geometry(item.lines, f"{below}:geometry"), material)


def commands(picture: Picture) -> Iterator[Command]:
    """Commands that draw a picture over whatever was drawn before."""
    yield {"type": "delete", "path": ROOT}
    for item in picture.items:
        yield from mesh_commands(item)
    for path in ("/Grid", "/Axes"):
        yield _property(path, "visible", False)
    for name, color in zip(("top_color", "bottom_color"), _BACKGROUND, strict=True):
        yield _property("/Background", name, list(color))
    # The viewer's camera lives in axes with y upward.
    x, y, z = picture.eye.tolist()
    yield _property(_CAMERA, "position", [x, z, -y])
    yield _property(_CAMERA, "fov", FIELD_OF_VIEW)
    # The light is to the left of the camera and above it.
    left = np.array([y, -x, 0.0])
    light = picture.eye + 0.9 * left + [0.0, 0.0, 0.9 * np.linalg.norm(picture.eye)]
    yield _property(_LIGHT, "position", (10.0 * light).tolist())
    yield _property(_LIGHT, "intensity", 0.45)


def _tracks(item: Item, seconds: Array, always: bool) -> list[Command]:
    """What changes of an item's place; if nothing does, its position where there must be something."""
    e = quaternions(item.rotation.reshape(-1, 3, 3))
    series = {
        "position": ("vector3", item.position.reshape(-1, 3)),
        "quaternion": ("quaternion", np.roll(e, -1, axis=1)),  # scalar last
        "scale": ("vector3", item.scale.reshape(-1, 3)),
    }
    return [
        {"name": f".{name}", "type": kind, "times": _numbers(seconds, "float"), "values": _numbers(values, "float")}
        for name, (kind, values) in series.items()
        if np.ptp(values, axis=0).max() > _MOTIONLESS or (always and name == "position")
    ]


def motion(picture: Picture, seconds: float, loop: bool) -> Command:
    """The command that moves what `commands` has drawn, once in so many seconds or again and again."""
    times = picture.times * (seconds / picture.times[-1])
    animations = []
    for item in picture.items:
        # The first item has a track even if it stands still, so that the motion has its length.
        tracks = _tracks(item, times, always=item is picture.items[0])
        if tracks:
            animations.append({"path": path_of(item), "clip": {"fps": 1.0, "name": "motion", "tracks": tracks}})
    options = {"play": True, "repetitions": float("inf") if loop else 1}
    return {"type": "set_animation", "path": ROOT, "animations": animations, "options": options}


def stillness() -> Command:
    """The command that ends a motion."""
    return {"type": "set_animation", "path": ROOT, "animations": [], "options": {"play": False}}


def packed(command: Command) -> bytes:
    """A command as MessagePack."""
    data: bytes = umsgpack.packb(command)
    return data
