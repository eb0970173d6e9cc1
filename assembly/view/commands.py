"""A picture as the commands meshcat's viewer obeys.

A command is a dictionary, packed as MessagePack; arrays are its extension types 0x16 (uint32) and 0x17 (float32).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import umsgpack
from numpy.typing import NDArray

from assembly.view.mesh import Mesh
from assembly.view.picture import FIELD_OF_VIEW, Color, Item, Picture

__all__ = ["ROOT", "commands", "packed"]

Command = dict[str, Any]
# Everything drawn hangs here, so that it can be taken away at once.
ROOT = "/assembly"
_CAMERA = "/Cameras/default/rotated/<object>"
_LIGHT = "/Lights/FillLight/<object>"
# From above to below.
_BACKGROUND = ((1.0, 1.0, 1.0), (0.87, 0.90, 0.94))
_IDENTITY = np.eye(4).ravel().tolist()


def _array(rows: NDArray[Any], kind: str) -> Command:
    code, name, dtype = {"float": (0x17, "Float32Array", "<f4"), "index": (0x16, "Uint32Array", "<u4")}[kind]
    size = rows.shape[1] if kind == "float" else 1
    data = umsgpack.Ext(code, np.ascontiguousarray(rows, dtype=dtype).tobytes())
    return {"itemSize": size, "type": name, "array": data, "normalized": False}


def _geometry(mesh: Mesh, identifier: str) -> Command:
    attributes = {"position": _array(mesh.vertices, "float"), "normal": _array(mesh.normals, "float")}
    data = {"attributes": attributes, "index": _array(mesh.triangles, "index")}
    return {"uuid": identifier, "type": "BufferGeometry", "data": data}


def _material(color: Color, in_front: bool, identifier: str) -> Command:
    red, green, blue = (round(255.0 * part) for part in color)
    material: Command = {
        "uuid": identifier,
        "type": "MeshPhongMaterial",
        "color": red << 16 | green << 8 | blue,
        "specular": 0x4A4A4A,
        "shininess": 70.0,
        "side": 2,  # both sides: open surfaces have an inside to look at
    }
    if in_front:
        # Transparent things are drawn last.
        material.update(transparent=True, opacity=0.85, depthTest=False)
    return material


def _path(item: Item) -> str:
    # The viewer splits at slashes, which a name may hold.
    return "/".join([ROOT, *(part.replace("/", "\N{DIVISION SLASH}") for part in item.path)])


def _property(path: str, name: str, value: Any) -> Command:
    return {"type": "set_property", "path": path, "property": name, "value": value}


def commands(picture: Picture) -> Iterator[Command]:
    """Commands that draw a picture over whatever was drawn before."""
    yield {"type": "delete", "path": ROOT}
    for item in picture.items:
        path = _path(item)
        described = {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [_geometry(item.mesh, f"{path}:geometry")],
            "materials": [_material(item.color, item.in_front, f"{path}:material")],
            "object": {
                "uuid": path,
                "type": "Mesh",
                "geometry": f"{path}:geometry",
                "material": f"{path}:material",
                "matrix": _IDENTITY,
            },
        }
        yield {"type": "set_object", "path": path, "object": described}
        yield {"type": "set_transform", "path": path, "matrix": item.matrix.T.ravel().tolist()}
    for path in ("/Grid", "/Axes"):
        yield _property(path, "visible", False)
    for name, color in zip(("top_color", "bottom_color"), _BACKGROUND, strict=True):
        yield _property("/Background", name, list(color))
    # The viewer's camera lives in axes with y upward.
    x, y, z = picture.eye.tolist()
    yield _property(_CAMERA, "position", [x, z, -y])
    yield _property(_CAMERA, "fov", FIELD_OF_VIEW)
    # Over the left shoulder of whoever looks.
    left = np.array([y, -x, 0.0])
    light = picture.eye + 0.9 * left + [0.0, 0.0, 0.9 * np.linalg.norm(picture.eye)]
    yield _property(_LIGHT, "position", (10.0 * light).tolist())
    yield _property(_LIGHT, "intensity", 0.45)


def packed(command: Command) -> bytes:
    """A command as MessagePack."""
    data: bytes = umsgpack.packb(command)
    return data
