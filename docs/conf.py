"""The site of the documentation: `sphinx-build -W docs site` makes it (extra `docs`).

The pages are those of this folder. The reference of all public names and the gallery of examples are written here, from
the packages' tables and the examples' docstrings, each time the site is made.
"""

from __future__ import annotations

import ast
import inspect
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path.insert(0, str(ROOT))

import assembly  # noqa: E402  # the checkout that the site is of

project, author = "assembly", "The assembly maintainers"
release = version = assembly.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc", "sphinx.ext.viewcode"]
html_theme, html_title = "furo", "assembly"
html_copy_source = False
# Written by this file, and read as pages.
GENERATED = DOCS / "generated"
exclude_patterns = ["_build"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
# `Returns` with a type alone, `Attributes` that are not properties: as the docstrings have them.
numpydoc_attributes_as_param_list = True
suppress_warnings = ["misc.highlighting_failure"]
# `name` in a docstring is a public name, and a link where there is one.
default_role = "py:obj"
# What classes have of Python's own is not listed.
INHERITED = ("Exception", "Enum", "tuple", "dict", "str", "ModuleType")
# Rooms of public names, and what a newcomer calls them.
ROOMS = {
    "assembly": "Scenes, joints, contacts, solves",
    "assembly.shapes": "Shapes",
    "assembly.curves": "Curves",
    "assembly.proximity": "Proximity",
    "assembly.view": "Pictures and pages",
    "assembly.cad": "Other CAD libraries",
    "assembly.reference": "A second opinion",
    "assembly.statics": "Forces at rest",
    "assembly.errors": "Errors",
}


def _entry(room: str, name: str, value: object) -> str:
    """What autodoc is to write of a name."""
    if inspect.isclass(value):
        options = f"   :members:\n   :inherited-members: {', '.join(INHERITED)}\n"
        # Of a name that two rooms have, the first is the one that links lead to.
        options += "   :no-index:\n" if room != "assembly" and name in dir(assembly) else ""
        return f".. autoclass:: {room}.{name}\n{options}\n"
    if callable(value):
        return f".. autofunction:: {room}.{name}\n\n"
    return f".. autodata:: {room}.{name}\n   :no-value:\n\n"


def _plain(app: object, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Have docstrings read as they are meant: bars are those of norms, and rows of tables stand as they are."""
    result: list[str] = []
    in_table = False
    for line in lines:
        is_row = line.lstrip().startswith("|") and line.rstrip().endswith("|")
        if is_row and not in_table:
            result += ["::", ""]
        if in_table and not is_row:
            result.append("")
        in_table = is_row
        result.append(f"    {line}" if is_row else line.replace("|", r"\|"))
    lines[:] = result


def _reference() -> None:
    """A page a room, a section a name."""
    for room, title in ROOMS.items():
        module: object = assembly
        for part in room.split(".")[1:]:
            module = getattr(module, part)
        listed = getattr(module, "__all__", None) or [name for name in dir(module) if name[0] != "_"]
        names = sorted(name for name in listed if not inspect.ismodule(getattr(module, name)))
        heading = f"{title}\n{'=' * len(title)}\n\n``import {room}``\n\n"
        entries = [f"{name}\n{'-' * len(name)}\n\n{_entry(room, name, getattr(module, name))}" for name in names]
        (GENERATED / f"{room}.rst").write_text(heading + "".join(entries), encoding="utf-8")


def _gallery() -> None:
    """A page of all examples: the picture, the docstring, the text."""
    parts = ["# Examples\n"]
    for path in sorted((ROOT / "examples").glob("*.py")):
        text = path.read_text(encoding="utf-8")
        about = ast.get_docstring(ast.parse(text)) or ""
        picture = DOCS / "images" / f"{path.stem}.png"
        shown = f"![{path.stem}](../images/{picture.name})\n\n" if picture.exists() else ""
        title = path.stem.replace("_", " ").capitalize()
        parts.append(f"## {title}\n\n{shown}{about}\n\n```{{literalinclude}} ../../examples/{path.name}\n```\n")
    (GENERATED / "examples.md").write_text("\n".join(parts), encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Write the generated pages before any is read."""
    app.connect("autodoc-process-docstring", _plain, priority=100)
    shutil.rmtree(GENERATED, ignore_errors=True)
    GENERATED.mkdir()
    _reference()
    _gallery()
