"""Names of files that are written: which suffix is of which format, and what writes it."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from assembly.errors import InputError, file_path

__all__ = ["checked_suffix", "other_format"]

# Suffixes of formats, and what writes those.
_FORMATS = {
    ".step": ("STEP", "asm.write_step writes these"),
    ".stp": ("STEP", "asm.write_step writes these"),
    ".json": ("scene", "Assembly.save writes these"),
    ".html": ("HTML", "asm.view.save_html writes these"),
    ".stl": ("STL", "asm.write_stl writes these"),
    ".obj": ("OBJ", "this library does not write them"),
    ".iges": ("IGES", "asm.write_iges writes these"),
    ".igs": ("IGES", "asm.write_iges writes these"),
    ".brep": ("BREP", "asm.write_brep writes these"),
    ".brp": ("BREP", "asm.write_brep writes these"),
    ".glb": ("glTF", "asm.write_gltf writes these"),
    ".gltf": ("glTF", "this library does not write them"),
    ".urdf": ("URDF", "asm.write_urdf writes these"),
}


def other_format(file: Path, own: tuple[str, ...]) -> tuple[str, str] | None:
    """The format, and what writes it, if the suffix of a file is another's than those of one's own."""
    suffix = file.suffix.lower()
    return None if suffix in own else _FORMATS.get(suffix)


def checked_suffix(path: str | PathLike[str], *suffixes: str, shown: str | None = None) -> Path:
    """A path that ends in one of some suffixes.

    Parameters
    ----------
    path
    suffixes
        In small letters, with the point.
    shown : str, optional
        Which of them a message names; all by default.

    Raises
    ------
    InputError
        It ends in something else; if that is another format's, saying what writes it.
    """
    file = file_path("path", path)
    if file.suffix.lower() in suffixes:
        return file
    other = other_format(file, suffixes)
    name, hint = (f", a name of {other[0]} files", f"; {other[1]}") if other else ("", "")
    expected = shown or " or ".join(suffixes)
    raise InputError(f"path is {str(file)!r}{name}; expected a name that ends in {expected}{hint}")
