"""The source files on which a kernel's machine code depends: its module, and those that it imports.

Numba's disk cache looks at a kernel's own file alone. Here every file counts that the module reaches by import
statements, so that an edit is seen by the entries that it may change, and by no others. Kernel files import by
statements that are read here (a test of the house's rules says which).
"""

from __future__ import annotations

import functools
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType

from assembly._lazy import IMPORTED_AT

__all__ = ["PACKAGE", "closure_of", "source_of", "source_stamp", "sources_of"]

PACKAGE = Path(__file__).resolve().parent.parent

_FROM = re.compile(r"from\s+([\w.]+)\s+import\b(.*)")


@functools.cache
def _file_of(module: str) -> Path | None:
    """The file of a module or package of this package, if there is one."""
    first, *rest = module.split(".")
    if first != PACKAGE.name:
        return None
    place = PACKAGE.joinpath(*rest)
    candidates = (place / "__init__.py", place.with_name(place.name + ".py"))
    return next((path for path in candidates if path.is_file()), None)


def _imports(text: str) -> Iterator[str]:
    """The statements of a source that import something, each as one line without comments.

    Python's own parser takes half a second for the package, this a hundredth of it; a test compares the two. What looks
    like an import and is none, in a docstring, can only add a file.
    """
    lines = text.splitlines()
    for k, line in enumerate(lines):
        if line.lstrip().startswith(("from", "import")):
            statement = ""
            for part in lines[k:]:
                code = part.partition("#")[0].strip()
                statement += " " + code.rstrip("\\")
                if not code.endswith("\\") and statement.count("(") == statement.count(")"):
                    break
            yield statement.strip()


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
    """The hash of a file and the files that it imports."""
    content = path.read_bytes()
    return hashlib.sha256(content).digest(), frozenset(_imported_files(content.decode("utf-8-sig", "replace")))


@functools.cache
def sources_of(path: Path) -> frozenset[Path]:
    """A file and all files of this package that it reaches by imports."""
    reached: set[Path] = set()
    waiting = [path]
    while waiting:
        file = waiting.pop()
        if file not in reached:
            reached.add(file)
            waiting.extend(_read(file)[1])
    return frozenset(reached)


def source_of(function: FunctionType) -> Path:
    """The file in which a function is defined."""
    return Path(function.__code__.co_filename).resolve()


def closure_of(function: FunctionType) -> list[object]:
    """A function and what it closes over, in a fixed order: values, functions (each once), what these close over."""
    found: list[object] = []
    waiting: list[object] = [function]
    while waiting:
        value = waiting.pop()
        value = getattr(value, "py_func", value)  # an entry is an object of Numba's with a function
        if isinstance(value, FunctionType) and any(value is other for other in found):
            continue
        found.append(value)
        if isinstance(value, FunctionType):
            waiting += [cell.cell_contents for cell in value.__closure__ or ()]
        elif isinstance(value, tuple):
            waiting += value
    return found


def source_stamp(function: FunctionType) -> str | None:
    """Hash of all sources that a kernel is made from; None where one cannot be read or changed while the process runs.

    A kernel made by a factory is made from the functions that it closes over, too, wherever these are defined.
    """
    parts = [part for part in closure_of(function) if isinstance(part, FunctionType)]
    try:
        files = {file for part in parts for file in sources_of(source_of(part))}
        # A file that changed since may have been imported before it did: nobody knows what text its code is of.
        if any(file.stat().st_mtime > IMPORTED_AT for file in files):
            return None
        hashes = sorted((file.as_posix(), _read(file)[0]) for file in files)
    except OSError:
        return None
    root = PACKAGE.parent.as_posix()
    digest = hashlib.sha256()
    for name, content in hashes:
        digest.update(name.removeprefix(root).encode() + b"\0" + content)
    for part in parts:
        # What tells functions of one file apart.
        settings = getattr(part, "kernel_settings", None)
        digest.update(repr((settings, part.__defaults__, part.__kwdefaults__)).encode() + _code(part.__code__))
    return digest.hexdigest()


def _code(code: CodeType) -> bytes:
    """Where a function stands in its file, its instructions and its constants."""
    inner = b"".join(_code(part) for part in code.co_consts if isinstance(part, CodeType))
    # The order of a set of strings is another one in every process.
    constants = [
        sorted(map(repr, part)) if isinstance(part, frozenset) else part
        for part in code.co_consts
        if not isinstance(part, CodeType)
    ]
    return repr((code.co_firstlineno, code.co_code, code.co_names, constants)).encode() + inner
