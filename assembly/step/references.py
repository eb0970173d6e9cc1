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
    """What a file refers to, and what these do: those that are there, in order, and names of those that are not."""

    def __init__(self) -> None:
        self.files: list[Path] = []
        self.missing: list[str] = []

    def add(self, text: bytes, folder: Path) -> None:
        """Those of one more file, whose text and folder these are."""
        # Few files have any, and a search for the word is quicker by far.
        for found in _DOCUMENT.findall(text) if _WORD in text else ():
            name = found.replace(b"''", b"'").decode("utf-8", "replace")
            if Path(name).suffix.lower() not in _SUFFIXES:
                continue
            file = folder / name
            if not file.is_file():
                if name not in self.missing:
                    self.missing.append(name)
            elif file not in self.files:
                self.files.append(file)
                self.add(file.read_bytes(), folder)


def references_of(text: bytes, folder: Path) -> References:
    """Files that a text refers to, looked for in a folder."""
    found = References()
    found.add(text, folder)
    return found
