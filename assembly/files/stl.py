"""Triangles of bodies in STL files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import import_module
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly._file_names import checked_suffix
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.solve.solution import Solution
from assembly.step.placed import placed_bodies
from assembly.view.mesh import body_mesh

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["stl_bytes", "the_trimesh", "write_stl"]

Array = NDArray[np.float64]


def write_stl(path: str | PathLike[str], what: Assembly | Solution | Body | Sequence[Body]) -> None:
    """Write the triangles of bodies where they stand, in their own unit; an STL file knows none.

    Parameters
    ----------
    path : str or path
        Ends in .stl; an existing file is replaced.
    what : Assembly, Solution, Body or several bodies
        Bodies without a shape are left out.

    Raises
    ------
    InputError, TypeError
        Another suffix, no bodies, or none with a shape; nothing is written then.
    ImportError
        Without trimesh, of the extra `meshes`.
    """
    target = checked_suffix(path, ".stl")
    placed = [(body, pose.matrix[:3, :3], pose.position) for body, pose in placed_bodies(what)]
    target.write_bytes(stl_bytes(placed, 1.0))


def stl_bytes(placed: Iterable[tuple[Body, Array, Array]], scale: float) -> bytes:
    """An STL file of bodies that are turned and moved, in this order, and scaled."""
    corners = []
    for body, turn, shift in placed:
        mesh = body_mesh(body)
        if mesh is not None:
            corners.append((mesh.vertices[mesh.triangles] @ turn.T + shift) * scale)
    if not corners:
        raise InputError("what has no body with a shape; expected at least one")
    triangles = np.concatenate(corners)
    trimesh = the_trimesh()
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles), process=False)
    written: bytes = mesh.export(file_type="stl")
    return written


def the_trimesh() -> Any:
    """The module that reads and writes triangles."""
    try:
        return import_module("trimesh")
    except ImportError:
        raise ImportError(
            "meshes of triangles need trimesh, which is not installed; install the extra meshes"
        ) from None
