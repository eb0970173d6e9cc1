"""Scene files written and read; the format stands in the package's heading."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import Any

from assembly._file_names import not_of_another, read_elsewhere
from assembly.assembly import Assembly
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.tangent import ContactTangent
from assembly.errors import InputError
from assembly.scene_file.body_kinds import BODY, FACE, SURFACE
from assembly.scene_file.fields import at, bad, each, members, whole, written
from assembly.scene_file.kinds import CONSTRAINTS, OBJECTIVES
from assembly.scene_file.records import Listed, Parts
from assembly.scene_file.references import refers_to_others

__all__ = ["load", "save", "scene_text"]

FORMAT = "assembly-scene"
VERSION = 5
_SIGNS = {1: "minimized", -1: "maximized"}


def save(scene: Assembly, path: str | PathLike[str]) -> None:
    """Write a scene as JSON. The same scene gives the same text.

    Parameters
    ----------
    scene : Assembly
    path : str or path
        An existing file is replaced.

    Raises
    ------
    TypeError
        Not an assembly.
    InputError
        A constraint or a term that scene files do not hold, or a coupling of joints that are not in the scene; one that
        is disabled, or of fixed bodies alone; or a path with the suffix of another format.
    OSError
        The file cannot be written.
    """
    if not isinstance(scene, Assembly):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    not_of_another(path, ".json").write_text(scene_text(scene), encoding="ascii")


def scene_text(scene: Assembly) -> str:
    """What `save` writes."""
    return written(_document(scene)) + "\n"


def _document(scene: Assembly) -> dict[str, Any]:
    for item in scene.constraints:
        if not item._is_asked:
            what = "is of fixed bodies alone" if item.enabled else "is disabled"
            raise InputError(
                f"constraint {item.name!r} {what}, which files do not hold; expected scene.remove of it first"
            )
        if isinstance(item, ContactTangent) and item.minimum:
            raise InputError(
                f"tangent {item.name!r} has a minimum, which files do not hold; expected a Contact with it"
            )
    parts = Parts(scene, VERSION, {item.name: item for item in scene.constraints})
    # Bodies first, then their faces: both tables are numbered as their entries come.
    bodies = Listed(BODY).write("bodies", scene.bodies, parts)
    faces = Listed(FACE).write("faces", parts.faces, parts)
    return {
        "format": FORMAT,
        "version": VERSION,
        "surfaces": Listed(SURFACE).write("surfaces", parts.surfaces, parts),
        "faces": faces,
        "bodies": bodies,
        "constraints": Listed(CONSTRAINTS).write("constraints", scene.constraints, parts),
        "objective": [
            OBJECTIVES.write(f"objective[{k}]", term, parts, sign=int(sign))
            for k, (sign, term) in enumerate(scene.objectives)
        ],
    }


def load(path: str | PathLike[str]) -> Assembly:
    """Read a scene that `Assembly.save` wrote, or another program in the same format.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    Assembly
        It solves to the same numbers as the one that was saved, bit for bit.

    Raises
    ------
    InputError
        Not a scene file of this version or an older one; the text names the field by its path, for example
        `surfaces[0].knots[1] has 3 values; expected 4 ...`.
    OSError
        The file cannot be read.
    """
    data = Path(path).read_bytes()
    try:
        document = json.loads(data, object_pairs_hook=_object, parse_int=_integer)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (ValueError, RecursionError) as error:
        elsewhere = read_elsewhere(Path(path), (".json",))
        raise InputError(f"{path} is not JSON ({error}); expected a file of format {FORMAT!r}{elsewhere}") from None
    try:
        return _scene(document)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _integer(digits: str) -> int | float:
    """An integer; a float, infinite perhaps, beyond the digits that surely have a double: a field's check names it."""
    return int(digits) if len(digits) <= 300 else float(digits)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object; JSON leaves open what a repeated field means."""
    fields = dict(pairs)
    if len(fields) < len(pairs):
        twice = next(key for k, (key, _) in enumerate(pairs) if key in (other for other, _ in pairs[:k]))
        raise InputError(f"field {twice!r} stands twice in an object; expected each field once")
    return fields


def _scene(document: Any) -> Assembly:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        found = document.get("format") if isinstance(document, dict) else document
        raise bad("format" if isinstance(document, dict) else "document", found, f"a scene of format {FORMAT!r}")
    version = whole("version", document.get("version"))
    if not 1 <= version <= VERSION:
        newer = "; a newer version of this library wrote the file" if version > VERSION else ""
        raise bad("version", version, f"1 to {VERSION}{newer}")
    tables = ("surfaces",) if version == 1 else ("surfaces", "faces")
    names = ("format", "version", *tables, "bodies", "constraints", "objective")
    _, _, surfaces, *faces, bodies, constraints, objective = members("document", document, names)
    scene = Assembly()
    parts = Parts(scene, version)
    parts.surfaces = Listed(SURFACE).read("surfaces", surfaces, parts)
    if faces:
        parts.faces = Listed(FACE).read("faces", faces[0], parts)

    def body(path: str, value: Any) -> None:
        read = BODY.read(path, value, parts)
        with at(path):
            scene.add(read)

    def term(path: str, value: Any) -> None:
        read = OBJECTIVES.read(path, value, parts, ("sign",))
        sign = whole(f"{path}.sign", value["sign"])
        if sign not in _SIGNS:
            raise bad(f"{path}.sign", sign, " or ".join(f"{key} ({word})" for key, word in _SIGNS.items()))
        with at(path):
            (scene.minimize if sign > 0 else scene.maximize)(read)

    each("bodies", bodies, body)
    _read_constraints(constraints, parts)
    each("objective", objective, term)
    return scene


def _read_constraints(value: Any, parts: Parts) -> None:
    """Constraints in their order, which decides the order of rows; those that refer to others are made after them."""
    records = each("constraints", value, CONSTRAINTS.record)
    made: dict[int, Constraint] = {}
    for k in sorted(range(len(records)), key=lambda k: refers_to_others(records[k])):
        made[k] = item = CONSTRAINTS.read(f"constraints[{k}]", value[k], parts)
        # A name that is taken is reported below.
        parts.constraints.setdefault(item.name, item)
    for k in range(len(records)):
        with at(f"constraints[{k}]"):
            parts.scene.constrain(made[k])
