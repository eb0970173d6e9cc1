"""The source files on which a kernel's machine code depends: its module's own, and those that this one imports.

Numba's disk cache looks at a kernel's own file alone. Here every file that the module reaches by imports counts, so
that an edit is seen by the entries that it may change, and by no others.
"""

from __future__ import annotations

import functools
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from types import FunctionType

__all__ = ["PACKAGE", "source_of", "source_stamp", "sources_of"]

PACKAGE = Path(__file__).resolve().parent.parent

_FROM = re.compile(r"from\s+([\w.]+)\s+import\b(.*)")


@functools.cache
def _file_of(module: str) -> Path | None:
    """The file of a module or package of this package, if there is one."""
    first, *rest = module.split(".")
    if first != PACKAGE.name:
        return None
    place = PACKAGE.joinpath(*rest)
    candidates = (place.with_name(place.name + ".py"), place / "__init__.py")
    return next((path for path in candidates if path.is_file()), None)


def _imports(text: str) -> Iterator[str]:
    """The statements of a source that import something, each as one line without comments.

    Python's own parser takes half a second for the package, this a hundredth of it; a test compares the two. What looks
    like an import and is none, in a docstring, can only add a file.
    """
    lines = text.split("\n")
    for k, line in enumerate(lines):
        if line.lstrip().startswith(("from ", "import ")):
            statement = ""
            for part in lines[k:]:
                statement = f"{statement.rstrip(chr(92))} {part.partition(chr(35))[0].strip()}".lstrip()
                if not statement.endswith("\\") and statement.count("(") == statement.count(")"):
                    break
            yield statement


def _names(listed: str) -> list[str]:
    """The names in a list of imports, without the names that they are given."""
    return [part.split()[0] for part in listed.strip(" ()").split(",") if part.strip()]


def _imported_files(text: str) -> set[Path]:
    """The files that a source imports directly; of a package from which a module is imported, that module alone."""
    found: set[Path | None] = set()
    for statement in _imports(text):
        parts = _FROM.match(statement)
        if parts:
            file = _file_of(parts[1])
            is_package = file is not None and file.name == "__init__.py"
            modules = {_file_of(f"{parts[1]}.{name}") for name in _names(parts[2])} if is_package else {None}
            found |= {module or file for module in modules}
        else:
            found.update(_file_of(name) for name in _names(statement.removeprefix("import")))
    return {path for path in found if path is not None}


@functools.cache
def _read(path: Path) -> tuple[bytes, frozenset[Path]]:
    """The hash of a file and the files that it imports, as it was when it was first read in this process."""
    content = path.read_bytes()
    return hashlib.sha256(content).digest(), frozenset(_imported_files(content.decode()))


@functools.cache
def sources_of(path: Path) -> frozenset[Path]:
    """A file and all files of this package that it reaches by imports.

    It is asked for when the file is imported: a file that is edited while a process runs is known by what the process
    imported.
    """
    reached: set[Path] = set()
    waiting = [path]
    while waiting:
        file = waiting.pop()
        if file not in reached:
            reached.add(file)
            waiting.extend(_read(file)[1])
    return frozenset(reached)


def _functions_in(value: object, found: list[FunctionType]) -> None:
    """Add all functions in a value: itself, in a tuple, and in what these functions close over."""
    if isinstance(value, tuple):
        for part in value:
            _functions_in(part, found)
    function = getattr(value, "py_func", value)  # a kernel that is an entry is a Numba object with a function
    if isinstance(function, FunctionType) and function not in found:
        found.append(function)
        for cell in function.__closure__ or ():
            _functions_in(cell.cell_contents, found)


def source_stamp(function: FunctionType) -> str | None:
    """Hash of all sources that a kernel is made from, and of its place there; None where one cannot be read.

    A kernel made by a factory is made from the functions that it closes over, too, wherever these are defined.
    """
    parts: list[FunctionType] = []
    _functions_in(function, parts)
    try:
        files = {file for part in parts for file in sources_of(source_of(part))}
        hashes = sorted((file.as_posix(), _read(file)[0]) for file in files)
    except OSError:
        return None
    root = PACKAGE.parent.as_posix()
    digest = hashlib.sha256(str(function.__code__.co_firstlineno).encode())
    for name, content in hashes:
        digest.update(name.removeprefix(root).encode() + b"\0" + content)
    return digest.hexdigest()


def source_of(function: FunctionType) -> Path:
    """The file in which a function is defined."""
    return Path(function.__code__.co_filename).resolve()
