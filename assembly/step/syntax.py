"""Whether a file's text has the form of a STEP file (ISO 10303-21): OCCT's parser may not end on one that has not.

Checked is the order of tokens in every statement, that parentheses match, that no two statements have one number, that
there is a statement for each reference, and that none refers to itself; not what the statements say. Where OCCT is
more lenient than the standard, as with apostrophes in strings, or stricter, as with blanks, so is this. What it does
not know (scopes, sections of the third edition) counts as damaged.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

__all__ = ["first_fault", "is_step", "mended"]

# Groups are not possessive: before Python 3.11.5 those are matched wrongly. No two of their parts begin alike.
# A string ends at an apostrophe before a comma or a parenthesis; others are of its text.
_STRING = rb"'[^']*+(?:'(?![ \r\n]*+[,)])[^']*+)*'(?=[ \r\n]*+[,)])"
_COMMENT = rb"/\*[^*]*+\*++(?:[^/*][^*]*+\*++)*/"
_BLANK = rb"(?:[\s\0]|" + _COMMENT + rb")*"
_REFERENCE = rb"\#\d{1,18}+"
_NAME = rb"!?[A-Za-z_][A-Za-z0-9_]*+"
_REAL = rb"[+-]?(?:\d++(?:\.\d*+(?:[Ee][+-]?\d++)?)?|\.\d++(?:[Ee][+-]?\d++)?)"
_VALUES = [_STRING, _REFERENCE, rb"\.[A-Za-z0-9_]*[A-Za-z_][A-Za-z0-9_]*\.", _REAL, rb"[$*]", rb'"[0-9A-F]++"']
_VALUE = rb"(?:" + rb"|".join(_VALUES) + rb")"
# What stands in the parentheses of a statement, each with what may come next.
_ITEM = rb"|".join(
    [
        _VALUE + _BLANK + rb"(?=[,)])",
        rb"," + _BLANK + rb"(?=[^,);])",
        rb"\)" + _BLANK + rb"(?=[,);!_A-Za-z])",
        rb"(?:" + _NAME + _BLANK + rb")?\(" + _BLANK + rb"(?=[^,;])",
    ]
)
_INSTANCE = _REFERENCE + rb"[ \t]*+=" + _BLANK + rb"(?=[(!_A-Za-z])"
_STATEMENT = re.compile(_BLANK + rb"(?:(?:" + _INSTANCE + rb")?(?:" + _ITEM + rb")+|[A-Za-z][A-Za-z0-9-]*+);" + _BLANK)
_BEGIN = re.compile(_BLANK + rb"(?i:ISO-10303-21)" + _BLANK + rb";")
_END = re.compile(_BLANK + rb"(?i:END-ISO-10303-21);" + _BLANK)
_TEXTS = re.compile(_STRING + rb"|" + _COMMENT)
# The number of a statement: its own where an equals sign follows, else a reference.
_NUMBERS = re.compile(rb"(" + _REFERENCE + rb")([ \t]*+=)?")
_NUMBER = np.dtype([("begin", int), ("end", int), ("value", int), ("own", bool)])
Mask = NDArray[np.bool_]
Records = NDArray[np.void]
_IS_MARK = np.isin(np.arange(256), [ord(mark) for mark in "();"])


def is_step(text: bytes) -> bool:
    """Whether a text begins as a STEP file does."""
    return _BEGIN.match(text) is not None


def first_fault(text: bytes) -> int | None:
    """The line, from 1, of the first statement that has not the form of one, or None. After the end all may follow."""
    at = 0
    while not (end := _END.match(text, at)) and (statement := _STATEMENT.match(text, at)):
        at = statement.end()
    bare = _bare(text[:at])
    numbers = _numbers(bare)
    faults = [_first_unmatched(bare), _first_of(numbers, _is_taken(numbers))]
    # What comes after a fault of form may be referred to before it.
    faults.append(_first_of(numbers, _is_lost(numbers)) if end else at)
    places = [place for place in faults if place is not None]
    return text.count(b"\n", 0, min(places)) + 1 if places else None


def mended(text: bytes) -> bytes:
    """The statements that have the form of one, the first of each number; `$` stands for references that are lost."""
    kept: list[bytes] = []
    taken: set[bytes] = set()
    at = 0
    while at < len(text) and not _END.match(text, at):
        statement = _STATEMENT.match(text, at)
        at = statement.end() if statement else text.find(b";", at) + 1 or len(text)
        if statement and _first_unmatched(bare := _bare(statement.group())) is None:
            own = [found[1].lstrip(b"#0") for found in _NUMBERS.finditer(bare) if found[2]]
            if taken.isdisjoint(own):
                taken.update(own)
                kept.append(statement.group())
    if kept and kept[-1].strip().upper() != b"ENDSEC;":
        kept.append(b"ENDSEC;\n")
    whole = b"".join(kept)
    numbers = _numbers(_bare(whole))
    parts, at = [], 0
    for begin, end, _, _ in numbers[_is_lost(numbers)].tolist():
        parts += [whole[at:begin], b"$"]
        at = end
    return b"".join(parts) + whole[at:] + b"END-ISO-10303-21;\n"


def _bare(statements: bytes) -> bytes:
    """The statements with zeros for their strings and comments, which may have any characters."""
    return _TEXTS.sub(lambda found: bytes(len(found.group())), statements)


def _first_unmatched(bare: bytes) -> int | None:
    """Where the first parenthesis closes nothing, or the first statement ends within parentheses."""
    marks = np.frombuffer(bare, np.uint8)
    places = np.flatnonzero(_IS_MARK[marks])
    marks = marks[places]
    depth = np.cumsum((marks == ord("(")).astype(np.int32) - (marks == ord(")")))
    wrong = (depth < 0) | ((marks == ord(";")) & (depth > 0))
    return int(places[np.argmax(wrong)]) if wrong.any() else None


def _numbers(bare: bytes) -> Records:
    """The numbers of statements, in their order."""
    found = _NUMBERS.finditer(bare)
    return np.fromiter(((*each.span(), int(each[1][1:]), each[2] is not None) for each in found), _NUMBER)


def _first_of(numbers: Records, which: Mask) -> int | None:
    return int(numbers["begin"][np.argmax(which)]) if which.any() else None


def _is_taken(numbers: Records) -> Mask:
    """Whether each is a statement's own and was another's before."""
    own = np.flatnonzero(numbers["own"])
    _, first = np.unique(numbers["value"][own], return_index=True)
    taken = numbers["own"].copy()
    taken[own[first]] = False
    return taken


def _is_lost(numbers: Records) -> Mask:
    """Whether each is a reference to no statement, or one of those by which a statement refers to itself in the end."""
    known, index = np.unique(numbers["value"], return_inverse=True)
    own = numbers["own"]
    given = np.zeros(len(known), bool)
    given[index[own]] = True
    owner = np.maximum.accumulate(np.where(own, np.arange(len(numbers)), -1))
    refers = ~own & (owner >= 0)
    begin, end = index[owner[refers]], index[refers]
    graph = coo_array((np.ones(len(begin), bool), (begin, end)), shape=(len(known), len(known)))
    _, group = connected_components(graph, directed=True, connection="strong")
    several = np.bincount(group, minlength=1) > 1
    lost = ~own & ~given[index]
    lost[refers] |= (begin == end) | (several[group[begin]] & (group[begin] == group[end]))
    return lost
