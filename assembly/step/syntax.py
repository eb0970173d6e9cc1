"""Whether a file's text has the form of a STEP file (ISO 10303-21): OCCT's parser may not end on one that has not.

Checked is the order of tokens in every statement, and that parentheses match; not what the statements say. Where
OCCT is more lenient than the standard, as with apostrophes in strings, or stricter, as with blanks, so is this; what it
does not know (scopes, sections of the third edition) is only read more slowly.
"""

from __future__ import annotations

import re

import numpy as np

__all__ = ["first_fault", "is_step"]

# Groups are not possessive: before Python 3.11.5 those are matched wrongly. No two of their parts begin alike.
# A string ends at an apostrophe before a comma or a parenthesis; others are of its text.
_STRING = rb"'[^']*+(?:'(?![ \r\n]*+[,)])[^']*+)*'(?=[ \r\n]*+[,)])"
_COMMENT = rb"/\*[^*]*+\*++(?:[^/*][^*]*+\*++)*/"
_BLANK = rb"(?:[\s\0]|" + _COMMENT + rb")*"
_NAME = rb"!?[A-Za-z_][A-Za-z0-9_]*+"
_NUMBER = rb"[+-]?(?:\d++(?:\.\d*+(?:[Ee][+-]?\d++)?)?|\.\d++(?:[Ee][+-]?\d++)?)"
_VALUES = [_STRING, rb"\#\d++", rb"\.[A-Za-z0-9_]*[A-Za-z_][A-Za-z0-9_]*\.", _NUMBER, rb"[$*]", rb'"[0-9A-F]++"']
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
_INSTANCE = rb"\#\d++[ \t]*+=" + _BLANK + rb"(?=[(!_A-Za-z])"
_STATEMENT = re.compile(_BLANK + rb"(?:(?:" + _INSTANCE + rb")?(?:" + _ITEM + rb")+|[A-Za-z][A-Za-z0-9-]*+);" + _BLANK)
_BEGIN = re.compile(_BLANK + rb"(?i:ISO-10303-21)" + _BLANK + rb";")
_END = re.compile(_BLANK + rb"(?i:END-ISO-10303-21);" + _BLANK)
_TEXTS = re.compile(_STRING + rb"|" + _COMMENT)


def is_step(text: bytes) -> bool:
    """Whether a text begins as a STEP file does."""
    return _BEGIN.match(text) is not None


def first_fault(text: bytes) -> int | None:
    """The line, from 1, of the first statement that has not the form of one, or None. After the end all may follow."""
    at = 0
    while not (end := _END.match(text, at)) and (statement := _STATEMENT.match(text, at)):
        at = statement.end()
    unmatched = _first_unmatched(text[:at])
    if end and unmatched is None:
        return None
    return text.count(b"\n", 0, at if unmatched is None else unmatched) + 1


def _first_unmatched(statements: bytes) -> int | None:
    """Where the first parenthesis closes nothing, or the first statement ends within parentheses."""
    bare = np.frombuffer(_TEXTS.sub(lambda found: bytes(len(found.group())), statements), np.uint8)
    places = np.flatnonzero(np.isin(bare, [ord(mark) for mark in "();"]))
    marks = bare[places]
    depth = np.cumsum((marks == ord("(")).astype(np.int32) - (marks == ord(")")))
    wrong = (depth < 0) | ((marks == ord(";")) & (depth > 0))
    return int(places[np.argmax(wrong)]) if wrong.any() else None
