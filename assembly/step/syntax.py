"""Whether a text has the form of a STEP file (ISO 10303-21); on other texts OCCT's parser may hang.

Checked is the order of tokens within the parentheses of every statement, that these match, that no two statements have
one number, that there is a statement for each reference, and that none refers to itself; not what the statements say.
Where OCCT is more lenient than the standard, as with apostrophes in strings, or stricter, as with blanks, so is this.
What it does not know (scopes, sections of the third edition) counts as damaged.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from assembly.step.scanning import PADDING, is_whole

__all__ = ["Fault", "first_fault", "is_step", "mended"]

# Groups are not possessive: before Python 3.11.5 those are matched wrongly. No two of their parts begin alike.
# A string ends at an apostrophe before a comma or a parenthesis; others are of its text.
_STRING = rb"'[^']*+(?:'(?![ \r\n]*+[,)])[^']*+)*'(?=[ \r\n]*+[,)])"
_COMMENT = rb"/\*[^*]*+\*++(?:[^/*][^*]*+\*++)*/"
_BLANK = rb"[\s\0]*+(?:" + _COMMENT + rb"[\s\0]*+)*"
_REFERENCE = rb"\#\d{1,18}+"
_NAME = rb"!?[A-Za-z_][A-Za-z0-9_]*+"
_REAL = rb"[+-]?(?:\d++(?:\.\d*+(?:[Ee][+-]?\d++)?)?|\.\d++(?:[Ee][+-]?\d++)?)"
_CHOICE = rb"\.(?=[0-9]*+[A-Za-z_])[A-Za-z0-9_]++\."
_VALUE = rb"(?:" + rb"|".join([_STRING, _REFERENCE, _CHOICE, _REAL, rb"[$*]", rb'"[0-9A-F]++"']) + rb")"
# What stands in the parentheses of a statement, each with what may come next.
_ITEM = rb"|".join(
    [
        _VALUE + _BLANK + rb"(?=[,)])",
        rb"," + _BLANK + rb"(?=[^,);])",
        rb"\)" + _BLANK + rb"(?=[,);!_A-Za-z])",
        rb"(?:" + _NAME + _BLANK + rb")?\(" + _BLANK + rb"(?=[^,;])",
    ]
)
# A statement is a word, or begins, has items, and ends. A match remembers each of its items: so many at a time.
_WORD = re.compile(_BLANK + rb"[A-Za-z][A-Za-z0-9-]*+" + _BLANK + rb";" + _BLANK)
_HEAD = re.compile(_BLANK + rb"(?:" + _REFERENCE + rb"[ \t]*+=" + _BLANK + rb"(?=[(!_A-Za-z]))?")
_ITEMS = re.compile(rb"(?:" + _ITEM + rb"){1,1000}")
_STOP = re.compile(rb";" + _BLANK)
_BEGIN = re.compile(_BLANK + rb"(?i:ISO-10303-21)" + _BLANK + rb";")
_END = re.compile(_BLANK + rb"(?i:END-ISO-10303-21);" + _BLANK)
_TEXTS = re.compile(_STRING + rb"|" + _COMMENT)
_PIECES = re.compile(_STRING + rb"|" + _COMMENT + rb"|;")
# The number of a statement: its own where an equals sign follows, else a reference.
_NUMBERS = re.compile(rb"(" + _REFERENCE + rb")([ \t]*+=)?")
_NUMBER = np.dtype([("begin", int), ("end", int), ("value", int), ("own", bool)])
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
Records = NDArray[np.void]
_IS_MARK = np.isin(np.arange(256), [ord(mark) for mark in "();"])


class Fault(NamedTuple):
    """What is wrong with a text.

    Attributes
    ----------
    line : int
        Where, from 1.
    is_lost : bool
        A reference that leads nowhere; what is a statement and which one it is, is clear everywhere.
    """

    line: int
    is_lost: bool


def is_step(text: bytes) -> bool:
    """Whether a text begins as a STEP file does."""
    return _BEGIN.match(text) is not None


def first_fault(text: bytes) -> Fault | None:
    """The first statement without the form of one or with the number of another one, else the first lost reference.

    None where there is no fault. After the end all may follow.
    """
    if is_whole(np.frombuffer(text + bytes(PADDING), np.uint8).copy()):
        return None
    at = 0
    while not (end := _END.match(text, at)) and (after := _after_statement(text, at)):
        at = after
    bare = _bare(text[:at])
    numbers = _numbers(bare)
    faults = [] if end else [at]
    faults += [*_unmatched(bare)[0][:1].tolist(), *numbers["begin"][_is_taken(numbers)][:1].tolist()]
    lost = [] if faults else numbers["begin"][_is_lost(numbers)][:1].tolist()
    places = faults or lost
    return Fault(text.count(b"\n", 0, min(places)) + 1, bool(lost)) if places else None


def mended(text: bytes) -> bytes:
    """The statements that have the form of one, the first of each number; `$` stands for references that are lost."""
    kept: list[bytes] = []
    at = 0
    while at < len(text) and not _END.match(text, at):
        if after := _after_statement(text, at):
            kept.append(text[at:after])
        else:
            after = _after_semicolon(text, at)
        at = after
    if kept and kept[-1].strip().upper() != b"ENDSEC;":
        kept.append(b"ENDSEC;\n")
    kept = _without(kept, _unmatched(_bare(b"".join(kept)))[1])
    numbers = _numbers(_bare(b"".join(kept)))
    ends = np.cumsum([len(statement) for statement in kept])
    kept = _without(kept, np.searchsorted(ends, numbers["begin"][_is_taken(numbers)], "right"))
    whole = b"".join(kept)
    numbers = _numbers(_bare(whole))
    parts, at = [], 0
    for begin, end, _, _ in numbers[_is_lost(numbers)].tolist():
        parts += [whole[at:begin], b"$"]
        at = end
    return b"".join(parts) + whole[at:] + b"END-ISO-10303-21;\n"


def _after_semicolon(text: bytes, at: int) -> int:
    """Behind the next semicolon, if possible one that is in no string or comment."""
    for found in _PIECES.finditer(text, at):
        if found[0] == b";":
            return found.end()
    return text.find(b";", at) + 1 or len(text)


def _without(statements: list[bytes], gone: Indices) -> list[bytes]:
    left_out = set(gone.tolist())
    return [statement for k, statement in enumerate(statements) if k not in left_out]


def _after_statement(text: bytes, at: int) -> int | None:
    """Where the next statement begins, if there is one at this place; its parentheses may not match."""
    if word := _WORD.match(text, at):
        return word.end()
    begin = at = _HEAD.match(text, at).end()  # type: ignore[union-attr]  # It matches nothing, too.
    while items := _ITEMS.match(text, at):
        at = items.end()
    stop = _STOP.match(text, at) if at > begin else None
    return stop.end() if stop else None


def _bare(statements: bytes) -> bytes:
    """The statements with zeros for their strings and comments, which may have any characters."""
    return _TEXTS.sub(lambda found: bytes(len(found.group())), statements)


def _unmatched(bare: bytes) -> tuple[Indices, Indices]:
    """Where parentheses close nothing or semicolons stand within some, and of which statements, counted from 0."""
    text = np.frombuffer(bare, np.uint8)
    places = np.flatnonzero(_IS_MARK[text])
    ends = text[places] == ord(";")
    statement = np.cumsum(ends) - ends
    depth = np.cumsum((text[places] == ord("(")).astype(np.int32) - (text[places] == ord(")")))
    depth -= np.append(0, depth[ends])[statement]
    wrong = (depth < 0) | (ends & (depth != 0))
    return places[wrong], statement[wrong]


def _numbers(bare: bytes) -> Records:
    """The numbers of statements, in their order."""
    found = _NUMBERS.finditer(bare)
    return np.fromiter(((*each.span(), int(each[1][1:]), each[2] is not None) for each in found), _NUMBER)


def _is_taken(numbers: Records) -> Mask:
    """Whether each is a statement's own and was another's before."""
    own = np.flatnonzero(numbers["own"])
    _, first = np.unique(numbers["value"][own], return_index=True)
    taken: Mask = numbers["own"].copy()
    taken[own[first]] = False
    return taken


def _is_lost(numbers: Records) -> Mask:
    """Whether each is a reference to no statement, or one of those by which a statement refers to itself in the end."""
    known, index = np.unique(numbers["value"], return_inverse=True)
    own: Mask = numbers["own"]
    given = np.zeros(len(known), bool)
    given[index[own]] = True
    owner = np.maximum.accumulate(np.where(own, np.arange(len(numbers)), -1))
    refers = ~own & (owner >= 0)
    begin, end = index[owner[refers]], index[refers]
    graph = coo_array((np.ones(len(begin), bool), (begin, end)), shape=(len(known), len(known)))
    _, group = connected_components(graph, directed=True, connection="strong")
    several = np.bincount(group, minlength=1) > 1
    lost: Mask = ~own & ~given[index]
    lost[refers] |= (begin == end) | (several[group[begin]] & (group[begin] == group[end]))
    return lost
