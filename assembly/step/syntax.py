"""Whether a file's text has the form of a STEP file (ISO 10303-21): OCCT's parser may not end on one that has not.

Checked is the order of tokens in every statement, and that parentheses match; not what the statements say. What OCCT
takes, as names in lower case, passes. Sections of the standard's third edition (anchors, references) do not.
"""

from __future__ import annotations

import re

import numpy as np

__all__ = ["first_fault", "is_step"]

_STRING = rb"'(?:[^']|'')*+'"
_COMMENT = rb"/\*(?:[^*]|\*(?!/))*+\*/"
_BLANK = rb"(?:\s|" + _COMMENT + rb")*+"
_NAME = rb"!?[A-Za-z_][A-Za-z0-9_]*+"
_NUMBER = rb"[+-]?\d++(?:\.\d*+)?(?:[Ee][+-]?\d++)?"
_VALUES = [_STRING, rb"\#\d++", _NUMBER, rb"\.[A-Za-z0-9_]++\.", rb"[$*]", rb'"[0-9A-F]*+"']
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
_INSTANCE = rb"\#\d++" + _BLANK + rb"=" + _BLANK + rb"(?=[(!_A-Za-z])"
_STATEMENT = re.compile(
    _BLANK + rb"(?:(?:" + _INSTANCE + rb")?(?:" + _ITEM + rb")++|[A-Z][A-Z0-9-]*+" + _BLANK + rb");" + _BLANK
)
_BEGIN = re.compile(_BLANK + rb"ISO-10303-21" + _BLANK + rb";")
_END = re.compile(_BLANK + rb"END-ISO-10303-21" + _BLANK + rb";" + _BLANK)
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
    depth = np.cumsum((bare == ord("(")).astype(np.int64) - (bare == ord(")")))
    wrong = (depth < 0) | ((bare == ord(";")) & (depth > 0))
    return int(np.argmax(wrong)) if wrong.any() else None
