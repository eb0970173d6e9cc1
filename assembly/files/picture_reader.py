"""Triangles read from files, as pictures of bodies."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from assembly._file_names import read_elsewhere
from assembly.errors import InputError, file_path
from assembly.files.stl import the_trimesh
from assembly.kinematics.picture_mesh import PictureMesh
from assembly.step.documents import checked_unit

__all__ = ["picture_of", "read_picture"]

# Triangles that meet at a smaller angle are shaded as one smooth surface [rad].
_SMOOTH = np.deg2rad(30.0)
# These formats are in meters; the others know no unit.
_IN_METERS = (".glb", ".gltf")
_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".dae")


def read_picture(path: str | PathLike[str], *, unit: str = "mm", file_unit: str | None = None) -> PictureMesh:
    """Triangles of a file, for `body.picture`.

    Parameters
    ----------
    path : str or path
        STL, OBJ, PLY, Collada (.dae), or glTF (.glb, .gltf). All meshes of the file become one, where they stand in it.
    unit : str
        Of the body: "um", "mm", "cm", "m", "in" or "ft".
    file_unit : str, optional
        Of the file. By default what the file says; meters of glTF, which is in meters; `unit` where it says nothing.

    Raises
    ------
    InputError
        Another suffix, or a file of no triangles.
    FileNotFoundError
        No such file, or a folder.
    ImportError
        Without trimesh, of the extra `meshes`.

    Notes
    -----
    A mesh is no exact shape: nothing touches it. Axes are those of the file; y is upward in most files of glTF.
    """
    wanted = checked_unit(unit)
    given = None if file_unit is None else checked_unit(file_unit, "file_unit")
    picture, said = picture_of(file_path("path", path))
    return picture.moved((given or said or wanted) / wanted * np.eye(3), np.zeros(3))


def picture_of(source: Path) -> tuple[PictureMesh, float | None]:
    """Triangles of a file in its own unit, and the millimeters of that unit where the file, or its format, says it."""
    if source.suffix.lower() not in _SUFFIXES:
        expected = f"expected a name that ends in one of {', '.join(_SUFFIXES)}{read_elsewhere(source, ())}"
        raise InputError(f"path is {str(source)!r}; {expected}")
    if not source.is_file():
        raise FileNotFoundError(f"path is {str(source)!r}; {'a folder' if source.is_dir() else 'no such file'}")
    trimesh = the_trimesh()
    try:
        scene = trimesh.load_scene(str(source))
        picture = _smooth(trimesh, scene.to_mesh())
        unit = "m" if source.suffix.lower() in _IN_METERS else scene.units
        said = None if unit is None else float(trimesh.units.unit_conversion(unit, "millimeters"))
    except ImportError:
        raise
    except Exception as error:  # whatever its parser trips over, the file is what is wrong
        raise InputError(f"path is {str(source)!r}; expected triangles ({type(error).__name__}: {error})") from None
    return picture, said


def _smooth(trimesh: Any, mesh: Any) -> PictureMesh:
    """The mesh, with vertices of their own on the two sides of an edge, and with the colors of its materials."""
    if hasattr(mesh.visual, "to_color"):
        mesh.visual = mesh.visual.to_color()
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    smooth = trimesh.graph.smooth_shade(mesh, angle=_SMOOTH, facet_minarea=None)
    if len(smooth.faces) != len(mesh.faces):
        smooth = mesh
    colors = smooth.visual.vertex_colors[:, :3] / 255.0 if mesh.visual.defined else None
    return PictureMesh(smooth.vertices, smooth.faces, colors)
