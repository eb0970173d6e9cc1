"""How values are written and read: each form writes what it reads, and things are lists of fields of such forms."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, Protocol

from assembly.assembly import Assembly
from assembly.constraints.model.constraint import Constraint
from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.scene_file.fields import at, bad, each, members

__all__ = ["Field", "Form", "Listed", "OneOf", "OrNull", "Parts", "Plain", "Record"]


@dataclass
class Parts:
    """The format's version, and what values refer to: bodies and constraints by name, faces and surfaces by index."""

    scene: Assembly
    version: int
    constraints: dict[str, Constraint] = field(default_factory=dict)
    faces: list[Face] = field(default_factory=list)
    surfaces: list[NurbsSurface] = field(default_factory=list)
    _indices: dict[int, int] = field(default_factory=dict)

    def index(self, table: list[Any], value: Any) -> int:
        """The index of a value in one of the tables, to which it is added where it is new."""
        index = self._indices.setdefault(id(value), len(table))
        if index == len(table):
            table.append(value)
        return index


class Form(Protocol):
    """How one kind of value stands in a document. The path is where, for messages."""

    def write(self, path: str, value: Any, parts: Parts) -> Any:
        """What `json` is to write."""

    def read(self, path: str, value: Any, parts: Parts) -> Any:
        """The value, of what `json` has read."""


class Plain:
    """A value that refers to nothing.

    Parameters
    ----------
    read : callable
        (path, what `json` has read) -> value.
    write : callable, optional
        What `json` is to write; the value itself by default.
    """

    def __init__(self, read: Callable[[str, Any], Any], write: Callable[[Any], Any] | None = None) -> None:
        self._read = read
        self._write = write

    def write(self, path: str, value: Any, parts: Parts) -> Any:
        """See `Form`."""
        return value if self._write is None else self._write(value)

    def read(self, path: str, value: Any, parts: Parts) -> Any:
        """See `Form`."""
        return self._read(path, value)


class Listed:
    """Any number of values of one form."""

    def __init__(self, form: Form) -> None:
        self._form = form

    def write(self, path: str, value: Any, parts: Parts) -> Any:
        """See `Form`."""
        return [self._form.write(f"{path}[{k}]", item, parts) for k, item in enumerate(value)]

    def read(self, path: str, value: Any, parts: Parts) -> Any:
        """See `Form`."""
        return each(path, value, lambda where, item: self._form.read(where, item, parts))


class OrNull:
    """A value of a form, or none."""

    def __init__(self, form: Form) -> None:
        self._form = form

    def write(self, path: str, value: Any, parts: Parts) -> Any:
        """See `Form`."""
        return None if value is None else self._form.write(path, value, parts)

    def read(self, path: str, value: Any, parts: Parts) -> Any:
        """See `Form`."""
        return None if value is None else self._form.read(path, value, parts)


class Field:
    """A value of a thing, by name.

    Parameters
    ----------
    name : str
        In the document.
    form : Form
    of : str or callable, optional
        The thing's attribute, dotted perhaps, or what finds the value; the name by default.
    argument : str, optional
        The constructor's; the name by default.
    since : int
        The first version of the format that has the field; older files mean the constructor's default.
    """

    def __init__(
        self,
        name: str,
        form: Form,
        of: str | Callable[[Any], Any] | None = None,
        argument: str | None = None,
        since: int = 1,
    ) -> None:
        self.name = name
        self.form = form
        self.of: Callable[[Any], Any] = of if callable(of) else attrgetter(of or name)
        self.argument = argument or name
        self.since = since


class Record:
    """A thing with fields.

    Parameters
    ----------
    kind : type, or several
        What the thing is; of several, the class that makes them first.
    *fields : Field
        In the order in which they are written.
    make : callable, optional
        Takes the fields' values by their arguments' names; the class by default.
    """

    def __init__(self, kind: type | tuple[type, ...], *fields: Field, make: Callable[..., Any] | None = None) -> None:
        self.kinds = kind if isinstance(kind, tuple) else (kind,)
        self.kind = self.kinds[0]
        self.fields = fields
        self.make: Callable[..., Any] = make or self.kind

    def write(self, path: str, value: Any, parts: Parts) -> dict[str, Any]:
        """See `Form`."""
        return {item.name: item.form.write(f"{path}.{item.name}", item.of(value), parts) for item in self.fields}

    def read(self, path: str, value: Any, parts: Parts, before: Sequence[str] = ()) -> Any:
        """See `Form`; `before` are fields that the caller reads."""
        fields = [item for item in self.fields if item.since <= parts.version]
        came = members(path, value, [*before, *(item.name for item in fields)])[len(before) :]
        arguments = {
            item.argument: item.form.read(f"{path}.{item.name}", part, parts)
            for item, part in zip(fields, came, strict=True)
        }
        with at(path, {item.argument: item.name for item in fields}):
            return self.make(**arguments)


class OneOf:
    """A thing of one of several kinds, which the field `type` says."""

    def __init__(self, kinds: Mapping[str, Record]) -> None:
        self.kinds = kinds

    def write(self, path: str, value: Any, parts: Parts, **before: Any) -> dict[str, Any]:
        """See `Form`; `before` are fields of the caller's."""
        for word, record in self.kinds.items():
            if type(value) in record.kinds:
                return {"type": word, **before, **record.write(path, value, parts)}
        known = ", ".join(record.kind.__name__ for record in self.kinds.values())
        raise InputError(f"{path} is {value!r}; expected one of what scene files hold: {known}")

    def record(self, path: str, value: Any) -> Record:
        """What the field `type` says, read first because it decides which fields there are."""
        known = ", ".join(self.kinds)
        if not isinstance(value, dict):
            raise bad(path, value, "an object")
        if "type" not in value:
            raise InputError(f"{path} has no field 'type'; expected one of {known}")
        word = value["type"]
        if not isinstance(word, str) or word not in self.kinds:
            raise bad(f"{path}.type", word, f"one of {known}")
        return self.kinds[word]

    def read(self, path: str, value: Any, parts: Parts, before: Sequence[str] = ()) -> Any:
        """See `Form`; `before` are fields that the caller reads."""
        return self.record(path, value).read(path, value, parts, ("type", *before))
