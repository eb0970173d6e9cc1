"""Scenes as text: an assembly written to a JSON file, and read back to the last bit.

A file is one object, and every field must be there:

    format       "assembly-scene"
    version      1
    surfaces     [{name, degree [p, q], knots [U, V], control_points [n_u][n_v][3], weights [n_u][n_v]}]
    bodies       [{name, fixed, position [3], quaternion [w, x, y, z], shape [{surface, name, reversed}]}]
    constraints  [{type "contact", name, a {body, face}, b {body, face}, unilateral}]
    objective    [{type "point_distance", sign, weight, body, point [3], target [3]} or
                  {type "posture", sign, weight, reference [n][7] or null}]

A face's `surface` is an index into `surfaces`, so that a surface many bodies share is there once. The name of a
surface is null where none was given; the face of a constraint's side is null where the nearest is to be found. A
sign is 1 (minimized) or -1 (maximized). Numbers are the shortest decimals that give back the same doubles.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Any

from assembly.assembly import Assembly
from assembly.constraints.contact import Contact
from assembly.constraints.objectives import Objective, PointDistance, Posture
from assembly.errors import InputError
from assembly.geometry.face import Face
from assembly.geometry.surface import NurbsSurface
from assembly.kinematics.body import Body, BodyFace

__all__ = ["load", "save"]

FORMAT = "assembly-scene"
VERSION = 1
_SIGNS = {1: "minimized", -1: "maximized"}
_SHOWN = 60


# Writing.


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
        A constraint or a term that scene files do not hold.
    OSError
        The file cannot be written.
    """
    if not isinstance(scene, Assembly):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    text = _written(_document(scene), "")
    Path(path).write_text(text + "\n", encoding="ascii")


def _document(scene: Assembly) -> dict[str, Any]:
    surfaces: dict[int, tuple[int, NurbsSurface]] = {}
    bodies = [
        {
            "name": body.name,
            "fixed": body.fixed,
            "position": body.pose.position.tolist(),
            "quaternion": body.pose.quaternion.tolist(),
            "shape": [
                {
                    "surface": surfaces.setdefault(id(side.face.surface), (len(surfaces), side.face.surface))[0],
                    "name": side.name,
                    "reversed": side.face.reversed,
                }
                for side in body.faces
            ],
        }
        for body in scene.bodies
    ]
    return {
        "format": FORMAT,
        "version": VERSION,
        "surfaces": [
            {
                "name": surface.name,
                "degree": list(surface.degree),
                "knots": [knots.tolist() for knots in surface.knots],
                "control_points": surface.control_points.tolist(),
                "weights": surface.weights.tolist(),
            }
            for _, surface in surfaces.values()
        ],
        "bodies": bodies,
        "constraints": [_constraint(constraint) for constraint in scene.constraints],
        "objective": [_term(int(sign), term) for sign, term in scene.objectives],
    }


def _constraint(constraint: Contact) -> dict[str, Any]:
    if type(constraint) is not Contact:
        raise InputError(f"constraint is {constraint!r}; expected a Contact, which is what scene files hold")
    sides = (
        {"body": side.body.name, "face": side.name} if isinstance(side, BodyFace) else {"body": side.name, "face": None}
        for side in (constraint.a, constraint.b)
    )
    return {
        "type": "contact",
        "name": constraint.name,
        "a": next(sides),
        "b": next(sides),
        "unilateral": constraint.unilateral,
    }


def _term(sign: int, term: Objective) -> dict[str, Any]:
    head = {"sign": sign, "weight": term.weight}
    if type(term) is PointDistance:
        point = {"body": term.point.body.name, "point": term.point.coordinates.tolist()}
        return {"type": "point_distance", **head, **point, "target": term.target.tolist()}
    if type(term) is Posture:
        return {"type": "posture", **head, "reference": None if term.reference is None else term.reference.tolist()}
    raise InputError(f"objective is {term!r}; expected PointDistance or Posture, which are what scene files hold")


def _written(value: Any, indent: str) -> str:
    """JSON with a line for every field and every row of a table."""
    inner = indent + " "
    if isinstance(value, dict):
        lines = [f"{json.dumps(key)}: {_written(item, inner)}" for key, item in value.items()]
    elif isinstance(value, list) and any(isinstance(item, (dict, list)) for item in value):
        lines = [_written(item, inner) if isinstance(item, dict) else json.dumps(item) for item in value]
    else:
        return json.dumps(value)
    left, right = "{}" if isinstance(value, dict) else "[]"
    return f"{left}\n{inner}" + f",\n{inner}".join(lines) + f"\n{indent}{right}"


# Reading.


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
        Not a scene file of this version; the text names the field by its path, for example
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
        raise InputError(f"{path} is not JSON ({error}); expected a file of format {FORMAT!r}") from None
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


def _bad(path: str, value: Any, expected: str) -> InputError:
    if isinstance(value, list):
        text = f"a list of {len(value)}"
    else:
        text = "an object" if isinstance(value, dict) else json.dumps(value)
    return InputError(f"{path} is {text if len(text) <= _SHOWN else text[: _SHOWN - 3] + '...'}; expected {expected}")


@contextmanager
def _at(path: str, names: Iterable[str] = ()) -> Iterator[None]:
    """Put the path of a field before what a constructor says of its arguments; `names` are fields of the object."""
    try:
        yield
    except InputError as error:
        text = str(error)
        starts_with_field = any(text.startswith((f"{name} ", f"{name}[")) for name in names)
        raise InputError(f"{path}{'.' if starts_with_field else ': '}{text}") from None


def _fields(path: str, value: Any, names: Sequence[str]) -> list[Any]:
    """Values of an object's fields, which must be these and no others."""
    if not isinstance(value, dict):
        raise _bad(path, value, f"an object with the fields {', '.join(names)}")
    for name in names:
        if name not in value:
            raise InputError(f"{path} has no field {name!r}; expected the fields {', '.join(names)}")
    for name in value:
        if name not in names:
            raise InputError(f"{path} has the unknown field {name!r}; expected only {', '.join(names)}")
    return [value[name] for name in names]


def _each(path: str, value: Any, read: Callable[[str, Any], Any], count: int | None = None) -> list[Any]:
    """The items of a list, each read with its path."""
    if not isinstance(value, list) or (count is not None and len(value) != count):
        raise _bad(path, value, "a list" if count is None else f"a list of {count}")
    return [read(f"{path}[{k}]", item) for k, item in enumerate(value)]


def _flag(path: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise _bad(path, value, "true or false")
    return value


def _text(path: str, value: Any) -> str:
    if not isinstance(value, str):
        raise _bad(path, value, "a string")
    return value


def _text_or_null(path: str, value: Any) -> str | None:
    return None if value is None else _text(path, value)


def _number(path: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(value):
        raise _bad(path, value, "a finite number")
    return float(value)


def _whole(path: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise _bad(path, value, "an integer")
    return value


def _table(path: str, value: Any, depth: int) -> list[Any]:
    """Numbers in lists of the given depth."""
    if depth == 1:
        return _each(path, value, _number)
    return _each(path, value, lambda where, item: _table(where, item, depth - 1))


def _kind(path: str, value: Any, known: Sequence[str]) -> str:
    """The field `type` of an object, read first because it decides which fields there are."""
    if not isinstance(value, dict):
        raise _bad(path, value, "an object")
    if "type" not in value:
        raise InputError(f"{path} has no field 'type'; expected one of {', '.join(known)}")
    kind: Any = value["type"]
    if kind not in known:
        raise _bad(f"{path}.type", kind, f"one of {', '.join(known)}")
    return str(kind)


def _scene(document: Any) -> Assembly:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        found = document.get("format") if isinstance(document, dict) else document
        raise _bad("format" if isinstance(document, dict) else "document", found, f"a scene of format {FORMAT!r}")
    version = _whole("version", document.get("version"))
    if version != VERSION:
        newer = "; a newer version of this library wrote the file" if version > VERSION else ""
        raise _bad("version", version, f"{VERSION}{newer}")
    fields = _fields("document", document, ("format", "version", "surfaces", "bodies", "constraints", "objective"))
    surfaces = _each("surfaces", fields[2], _read_surface)
    scene = Assembly()

    def body(path: str, value: Any) -> None:
        read = _read_body(path, value, surfaces)
        with _at(path):
            scene.add(read)

    def constraint(path: str, value: Any) -> None:
        read = _read_constraint(path, value, scene)
        with _at(path):
            scene.constrain(read)

    def term(path: str, value: Any) -> None:
        sign, read = _read_term(path, value, scene)
        with _at(path):
            (scene.minimize if sign > 0 else scene.maximize)(read)

    _each("bodies", fields[3], body)
    _each("constraints", fields[4], constraint)
    _each("objective", fields[5], term)
    return scene


def _read_surface(path: str, value: Any) -> NurbsSurface:
    names = ("name", "degree", "knots", "control_points", "weights")
    name, degree, knots, points, weights = _fields(path, value, names)
    with _at(path, names):
        return NurbsSurface(
            _table(f"{path}.control_points", points, 3),
            _each(f"{path}.knots", knots, lambda where, item: _table(where, item, 1), 2),
            _each(f"{path}.degree", degree, _whole, 2),
            _table(f"{path}.weights", weights, 2),
            name=_text_or_null(f"{path}.name", name),
        )


def _read_body(path: str, value: Any, surfaces: list[NurbsSurface]) -> Body:
    names = ("name", "fixed", "position", "quaternion", "shape")
    name, fixed, position, quaternion, shape = _fields(path, value, names)

    def face(where: str, item: Any) -> Face:
        index, label, turned = _fields(where, item, ("surface", "name", "reversed"))
        at = _whole(f"{where}.surface", index)
        if not 0 <= at < len(surfaces):
            raise _bad(f"{where}.surface", at, f"an index of one of {len(surfaces)} surfaces")
        return Face(
            surfaces[at],
            name=_text(f"{where}.name", label),
            reversed=_flag(f"{where}.reversed", turned),
        )

    arguments = (
        _text(f"{path}.name", name),
        _each(f"{path}.shape", shape, face) or None,
        _table(f"{path}.position", position, 1),
        _table(f"{path}.quaternion", quaternion, 1),
        _flag(f"{path}.fixed", fixed),
    )
    with _at(path, names):
        return Body(*arguments)


def _body_of(path: str, value: Any, scene: Assembly) -> Body:
    name = _text(path, value)
    with _at(path):
        return scene.body(name)


def _read_constraint(path: str, value: Any, scene: Assembly) -> Contact:
    _kind(path, value, ("contact",))
    names = ("type", "name", "a", "b", "unilateral")
    _, name, a, b, unilateral = _fields(path, value, names)

    def side(where: str, item: Any) -> Body | BodyFace:
        body_name, face_name = _fields(where, item, ("body", "face"))
        body = _body_of(f"{where}.body", body_name, scene)
        label = _text_or_null(f"{where}.face", face_name)
        if label is None:
            return body
        with _at(f"{where}.face"):
            return body.face(label)

    arguments = (
        side(f"{path}.a", a),
        side(f"{path}.b", b),
        _text(f"{path}.name", name),
        _flag(f"{path}.unilateral", unilateral),
    )
    with _at(path, names):
        return Contact(*arguments)


def _read_term(path: str, value: Any, scene: Assembly) -> tuple[int, Objective]:
    kind = _kind(path, value, ("point_distance", "posture"))
    head = ("type", "sign", "weight")
    names = (*head, "body", "point", "target") if kind == "point_distance" else (*head, "reference")
    _, sign, weight, *rest = _fields(path, value, names)
    if _whole(f"{path}.sign", sign) not in _SIGNS:
        meaning = " or ".join(f"{key} ({word})" for key, word in _SIGNS.items())
        raise _bad(f"{path}.sign", sign, meaning)
    factor = _number(f"{path}.weight", weight)
    if kind == "posture":
        rows = None if rest[0] is None else _table(f"{path}.reference", rest[0], 2)
        with _at(path, names):
            return sign, Posture(rows, factor)
    body = _body_of(f"{path}.body", rest[0], scene)
    point = _each(f"{path}.point", rest[1], _number, 3)
    target = _table(f"{path}.target", rest[2], 1)
    with _at(path, names):
        return sign, PointDistance(body.point(*point), target, factor)
