"""Files that a STEP file refers to: the parts of an assembly, each in a file of its own beside it."""

from __future__ import annotations

import re
from pathlib import Path

__all__ = ["References", "references_of"]

_WORD = b"DOCUMENT_FILE"
_DOCUMENT = re.compile(rb"\bDOCUMENT_FILE\s*\(\s*'((?:[^']|'')*+)'")
# Of other documents, drawings say, no shapes are made.
_SUFFIXES = {".stp", ".step", ".p21"}


class References:
    """What a file refers to, and what these do.

    Attributes
    ----------
    files : list of Path
        Those that are there, in order.
    last : dict
        Those of these that refer to no others, by the names by which they are referred to.
    missing : list of str
        Names of those that are not there.
    """

    def __init__(self) -> None:
        self.files: list[Path] = []
        self.last: dict[str, Path] = {}
        self.missing: list[str] = []

    def add(self, text: bytes, folder: Path) -> bool:
        """Those of one more file, whose text and folder these are; whether it has any."""
        has_any = False
        # Few files have any, and a search for the word is quicker by far.
        for found in _DOCUMENT.findall(text) if _WORD in text else ():
            name = found.replace(b"''", b"'").decode("utf-8", "replace")
            if Path(name).suffix.lower() not in _SUFFIXES:
                continue
            has_any = True
            file = folder / name
            if not file.is_file():
                if name not in self.missing:
                    self.missing.append(name)
            elif file not in self.files:
                self.files.append(file)
                if not self.add(file.read_bytes(), folder):
                    self.last[name] = file
        return has_any


def references_of(text: bytes, folder: Path) -> References:
    """Files that a text refers to, looked for in a folder."""
    found = References()
    found.add(text, folder)
    return found
