"""Names of files: which suffix is of which format, what writes it, and what reads it."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from assembly.errors import InputError, file_path

__all__ = ["checked_suffix", "not_of_another", "other_format", "read_elsewhere"]

# Suffixes of formats, what writes those, and what reads them.
_FORMATS = {
    ".step": ("STEP", "asm.write_step", "asm.read_step"),
    ".stp": ("STEP", "asm.write_step", "asm.read_step"),
    ".json": ("scene", "Assembly.save", "asm.load"),
    ".html": ("HTML", "asm.view.save_html", None),
    ".stl": ("STL", "asm.write_stl", "asm.read_picture"),
    ".obj": ("OBJ", None, "asm.read_picture"),
    ".ply": ("PLY", None, "asm.read_picture"),
    ".dae": ("Collada", None, "asm.read_picture"),
    ".iges": ("IGES", "asm.write_iges", "asm.read_iges"),
    ".igs": ("IGES", "asm.write_iges", "asm.read_iges"),
    ".brep": ("BREP", "asm.write_brep", "asm.read_brep"),
    ".brp": ("BREP", "asm.write_brep", "asm.read_brep"),
    ".glb": ("glTF", "asm.write_gltf", "asm.read_picture"),
    ".gltf": ("glTF", None, "asm.read_picture"),
    ".urdf": ("URDF", "asm.write_urdf", "asm.read_urdf"),
}


def other_format(file: Path, own: tuple[str, ...]) -> tuple[str, str] | None:
    """The format, and what writes it, if the suffix of a file is another's than those of one's own."""
    suffix = file.suffix.lower()
    if suffix in own or suffix not in _FORMATS:
        return None
    name, writer, _ = _FORMATS[suffix]
    return name, "this library does not write them" if writer is None else f"{writer} writes these"


def read_elsewhere(file: Path, own: tuple[str, ...]) -> str:
    """The end of a message about a file that is not what a reader takes: what reads files with such a suffix."""
    suffix = file.suffix.lower()
    reader = None if suffix in own or suffix not in _FORMATS else _FORMATS[suffix][2]
    return "" if reader is None else f"; {reader} reads {suffix} files"


def not_of_another(path: str | PathLike[str], *suffixes: str) -> Path:
    """A path that may end in anything but the suffix of another format than that of these suffixes.

    Parameters
    ----------
    path
    suffixes
        In small letters, with the point.

    Raises
    ------
    TypeError
        No path.
    InputError
        It ends in a suffix of another format, saying what writes that.
    """
    file = file_path("path", path)
    if other_format(file, suffixes) is not None:
        raise _unfit(file, suffixes, " or ".join(suffixes))
    return file


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
    raise _unfit(file, suffixes, shown or " or ".join(suffixes))


def _unfit(file: Path, own: tuple[str, ...], expected: str) -> InputError:
    other = other_format(file, own)
    name, hint = (f", a name of {other[0]} files", f"; {other[1]}") if other else ("", "")
    return InputError(f"path is {str(file)!r}{name}; expected a name that ends in {expected}{hint}")
