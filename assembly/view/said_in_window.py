"""Names and axes as things of the scene, for meshcat's own window, whose page is not ours.

A name is a sprite, a picture of text that always faces the eye, of the same size wherever it is. It hangs below what it
names, and moves with that.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.view.commands import ROOT, Command, mesh_commands, path_of
from assembly.view.item import Item, Picture
from assembly.view.marks import arrow
from assembly.view.motion import aligned

__all__ = ["axes_of", "round_length", "said_in_window"]

Array = NDArray[np.float64]
# Pixels of letters in a sprite of 256, and its height in parts of that of the window at a distance of one.
_LETTERS, _HEIGHT = 32, 0.16
# How long the arms of the axes are at most, and how thick, in parts of the scene's radius.
_ARM, _THICK = 0.25, 0.004


def round_length(most: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not more."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(k * power for k in (1.0, 2.0, 5.0) if k * power <= most * (1.0 + 1e-12)))


def _sprite(path: str, text: str, at: Array, scale: Array) -> Iterator[Command]:
    """Commands that write text at a place, in coordinates that what is above the path has scaled."""
    texture = {
        "uuid": f"{path}:texture",
        "type": "_text",
        "text": text,
        "font_size": _LETTERS,
        "font_face": "sans-serif",
    }
    material = {
        "uuid": f"{path}:material",
        "type": "SpriteMaterial",
        "map": texture["uuid"],
        "transparent": True,
        "depthTest": False,
        "sizeAttenuation": False,
    }
    matrix = np.diag([*(_HEIGHT / scale), 1.0])
    matrix[:3, 3] = at / scale
    described: dict[str, Any] = {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [],
        "materials": [material],
        "textures": [texture],
        "object": {"uuid": path, "type": "Sprite", "material": material["uuid"], "matrix": np.eye(4).ravel().tolist()},
    }
    yield {"type": "set_object", "path": path, "object": described}
    yield {"type": "set_transform", "path": path, "matrix": matrix.T.ravel().tolist()}


def axes_of(picture: Picture) -> tuple[list[Item], float]:
    """Three arrows from the lowest corner of the bodies, and how long they are in the scene: a round number."""
    bodies = np.concatenate([item.points for item in picture.items if item.kind == "bodies"])
    length = round_length(_ARM / picture.scale)
    mesh = arrow(0.0, length * picture.scale, _THICK, 2.5 * _THICK)
    corner = bodies.min(axis=0)
    turns = aligned(np.eye(3))
    arms = [Item(("axes", name), mesh, (0.14, 0.15, 0.18), corner, turns[k]) for k, name in enumerate("xyz")]
    return arms, length


def said_in_window(picture: Picture) -> Iterator[Command]:
    """Commands for the names that a style asks for, and for a length at the axes."""
    style = picture.style
    for item in picture.items:
        if item.label and item.kind in style.labels_asked:
            scale = item.scale.reshape(-1, 3)[0]
            if scale.min() > 0.0:
                yield from _sprite(f"{path_of(item)}/name", item.label, np.zeros(3), scale)
    if not (style.axes or style.scale_bar):
        return
    arms, length = axes_of(picture)
    for arm, name, way in zip(arms, "xyz", np.eye(3), strict=True):
        yield from mesh_commands(arm)
        said = f"{name}  {style.length(length)}" if name == "x" and style.scale_bar else name
        # Children of an arrow are placed in its axes, whose z axis is along the arrow.
        end = arm.rotation.T @ ((length * picture.scale + 0.06) * way)
        yield from _sprite(f"{ROOT}/axes/{name}/name", said, end, np.ones(3))
