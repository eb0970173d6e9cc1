"""Test in one pass whether a STEP file's text is certainly whole: `syntax.first_fault` would find no fault in it.

The test accepts less than `first_fault` does. A text that it rejects is examined again there, by regular expressions
that can say where and what is wrong. Functions advance over a text, bytes followed by a few zeros, from one position to
the next; -1 stands for a text that is rejected.
"""

from __future__ import annotations

from collections import namedtuple

import numpy as np

from assembly._kernel import kernel

# Zeros after a text: functions look ahead no farther than this.
PADDING = 32
_APOSTROPHE, _QUOTE, _HASH, _EQUALS, _SEMICOLON = (ord(mark) for mark in "'\"#=;")
_OPEN, _CLOSE, _COMMA, _DOT, _SLASH, _STAR, _DOLLAR = (ord(mark) for mark in "(),./*$")
_PLUS, _MINUS, _BANG, _UNDERSCORE, _E_HIGH, _E_LOW = (ord(mark) for mark in "+-!_Ee")
_ZERO, _NINE, _A_HIGH, _F_HIGH, _Z_HIGH, _A_LOW, _Z_LOW = (ord(mark) for mark in "09AFZaz")
_SPACE, _TAB, _LINE, _RETURN = (ord(mark) for mark in " \t\n\r")
_END = np.frombuffer(b"END-ISO-10303-21;", np.uint8).copy()
_DIGITS = 9

# References: the statement that has a number; for every reference, the statement that it is in, and its number.
References = namedtuple("References", "statement owner number")


@kernel(inline=True)
def _is_digit(c):
    return _ZERO <= c <= _NINE


@kernel(inline=True)
def _is_letter(c):
    return _A_LOW <= c <= _Z_LOW or _A_HIGH <= c <= _Z_HIGH or c == _UNDERSCORE


@kernel(inner=True)
def _after_blank(text, at, end):
    """The position after white space, zeros and comments."""
    while at < end:
        c = text[at]
        if c == 0 or c == _SPACE or _TAB <= c <= _RETURN:
            at += 1
        elif c == _SLASH and text[at + 1] == _STAR:
            at += 2
            while at < end and not (text[at] == _STAR and text[at + 1] == _SLASH):
                at += 1
            if at >= end:
                return -1
            at += 2
        else:
            break
    return at


@kernel(inner=True)
def _after_string(text, at, end):
    """The position after a string, which ends at an apostrophe before a comma or a parenthesis."""
    at += 1
    while at < end:
        if text[at] == _APOSTROPHE:
            k = at + 1
            while k < end and (text[k] == _SPACE or text[k] == _LINE or text[k] == _RETURN):
                k += 1
            if text[k] == _COMMA or text[k] == _CLOSE:
                return at + 1
        at += 1
    return -1


@kernel(inner=True)
def _after_digits(text, at):
    while _is_digit(text[at]):
        at += 1
    return at


@kernel(inner=True)
def _after_real(text, at):
    """The position after a number; an exponent needs a point before it."""
    if text[at] == _PLUS or text[at] == _MINUS:
        at += 1
    whole = _after_digits(text, at)
    if text[whole] != _DOT:
        return whole if whole > at else -1
    part = _after_digits(text, whole + 1)
    if whole == at and part == whole + 1:
        return -1
    if text[part] == _E_HIGH or text[part] == _E_LOW:
        sign = part + 1
        if text[sign] == _PLUS or text[sign] == _MINUS:
            sign += 1
        power = _after_digits(text, sign)
        if power > sign:
            return power
    return part


@kernel(inner=True)
def _after_name(text, at):
    """The position after a keyword; the same position if there is none."""
    k = at + 1 if text[at] == _BANG else at
    if not _is_letter(text[k]):
        return at
    while _is_letter(text[k]) or _is_digit(text[k]):
        k += 1
    return k


@kernel(inner=True)
def _after_value(text, at, end):
    """The position after a value that is no reference."""
    c = text[at]
    if c == _APOSTROPHE:
        return _after_string(text, at, end)
    if c == _DOLLAR or c == _STAR:
        return at + 1
    if c == _DOT and _is_letter(text[at + 1]):
        at = _after_name(text, at + 1)
        return at + 1 if text[at] == _DOT else -1
    if c == _QUOTE:
        k = at + 1
        while _is_digit(text[k]) or _A_HIGH <= text[k] <= _F_HIGH:
            k += 1
        return k + 1 if k > at + 1 and text[k] == _QUOTE else -1
    return _after_real(text, at)


@kernel(inner=True)
def _number(text, at):
    """The number after a hash, and the position after it; the number is -1 if it has no digits or too many."""
    stop = _after_digits(text, at + 1)
    if not 1 <= stop - at - 1 <= _DIGITS:
        return -1, stop
    number = 0
    for k in range(at + 1, stop):
        number = 10 * number + text[k] - _ZERO
    return number, stop


@kernel(inner=True)
def _after_items(text, at, end, references, counts):
    """The position after the items of a statement, all parentheses closed. `counts`: statements, references so far."""
    depth = 0
    begin = at
    while at < end and text[at] != _SEMICOLON:
        c = text[at]
        if c == _COMMA:
            at = _after_blank(text, at + 1, end)
            if at < 0 or text[at] == _COMMA or text[at] == _CLOSE or text[at] == _SEMICOLON:
                return -1
            continue
        if c == _CLOSE:
            depth -= 1
            at = _after_blank(text, at + 1, end)
            if at < 0 or depth < 0:
                return -1
            c = text[at]
            if not (c == _COMMA or c == _CLOSE or c == _SEMICOLON or c == _BANG or _is_letter(c)):
                return -1
            continue
        if c == _OPEN or c == _BANG or _is_letter(c):
            at = _after_blank(text, _after_name(text, at), end)
            if at < 0 or text[at] != _OPEN:
                return -1
            depth += 1
            at = _after_blank(text, at + 1, end)
            if at < 0 or text[at] == _COMMA or text[at] == _SEMICOLON:
                return -1
            continue
        if c == _HASH:
            number, at = _number(text, at)
            if number < 0 or counts[0] == 0:
                return -1
            references.owner[counts[1]] = counts[0] - 1
            references.number[counts[1]] = number
            counts[1] += 1
        else:
            at = _after_value(text, at, end)
        if at >= 0:
            at = _after_blank(text, at, end)
        if at < 0 or not (text[at] == _COMMA or text[at] == _CLOSE):
            return -1
    return at if depth == 0 and begin < at < end else -1


@kernel(inner=True)
def _after_statement(text, at, end, references, counts):
    """The position after a statement that begins here."""
    if text[at] == _HASH:
        number, at = _number(text, at)
        while text[at] == _SPACE or text[at] == _TAB:
            at += 1
        known = references.statement
        if not 0 <= number < known.size or text[at] != _EQUALS or known[number] >= 0:
            return -1
        known[number] = counts[0]
        counts[0] += 1
        at = _after_blank(text, at + 1, end)
        if at < 0 or not (text[at] == _OPEN or text[at] == _BANG or _is_letter(text[at])):
            return -1
    else:
        k = at
        while _is_letter(text[k]) and text[k] != _UNDERSCORE or k > at and (_is_digit(text[k]) or text[k] == _MINUS):
            k += 1
        stop = _after_blank(text, k, end)
        if k > at and stop >= 0 and text[stop] == _SEMICOLON:
            return stop + 1
    at = _after_items(text, at, end, references, counts)
    return at + 1 if at >= 0 else -1


@kernel(inner=True, allocates=True)
def _lead_on(references, statements, count):
    """Whether every reference leads to a statement, and no chain of references leads back to its own statement."""
    known = references.statement
    referred = np.zeros(statements, dtype=np.int64)
    first = np.zeros(statements + 1, dtype=np.int64)
    for k in range(count):
        number = references.number[k]
        if number >= known.size or known[number] < 0:
            return False
        referred[known[number]] += 1
        first[references.owner[k] + 1] += 1
    # Statements that nothing refers to are removed until none is left. References are in the order of their statements.
    for s in range(statements):
        first[s + 1] += first[s]
    waiting = np.empty(statements, dtype=np.int64)
    top = 0
    for s in range(statements):
        if referred[s] == 0:
            waiting[top] = s
            top += 1
    done = 0
    while top > 0:
        top -= 1
        done += 1
        s = waiting[top]
        for k in range(first[s], first[s + 1]):
            target = known[references.number[k]]
            referred[target] -= 1
            if referred[target] == 0:
                waiting[top] = target
                top += 1
    return done == statements


@kernel(signatures="(u1[::1],)", allocates=True)
def is_whole(text):
    """Whether a text is a list of well-formed statements up to its end mark, and `_lead_on` accepts its references."""
    end = text.size - PADDING
    hashes = 0
    for k in range(end):
        if text[k] == _HASH:
            hashes += 1
    statement = np.full(end, -1, dtype=np.int64)
    references = References(statement, np.empty(hashes, dtype=np.int64), np.empty(hashes, dtype=np.int64))
    counts = np.zeros(2, dtype=np.int64)
    at = _after_blank(text, 0, end)
    while 0 <= at < end:
        last = 0
        while last < _END.size and (text[at + last] == _END[last] or (text[at + last] ^ 32) == _END[last] >= _A_HIGH):
            last += 1
        if last == _END.size:
            return _lead_on(references, counts[0], counts[1])
        at = _after_statement(text, at, end, references, counts)
        if at >= 0:
            at = _after_blank(text, at, end)
    return False
