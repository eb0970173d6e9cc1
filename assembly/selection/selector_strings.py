"""Selector strings of CadQuery: what they say, and which of several things they choose.

    expression   operand {"exc" | "except" operand}
    operand      terms {"or" terms},  terms  atom {"and" atom}
    atom         a selector, an expression in parentheses, or "not" and an expression: all that follows it

    >D  <D       farthest along a direction, by centers             >D[i]   the i-th place of those parallel to it
    >>D  <<D     the same                                           >>D[i]  the i-th place of all
    |D  #D       parallel, perpendicular to it                      +D  -D  D   along it, against it
    %KIND        of a kind, as in %PLANE

A direction is X, Y, Z, XY, XZ, YZ or (x, y, z). It is compared with the normals of planes and with straight edges; of
others none is parallel to anything. Places are counted from the least, [-1] is the last, and with < the other way.
CadQuery's views (top is >Y there) are refused: here shapes have faces with such names, and top is the one at +z.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from math import radians

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError

__all__ = ["Seen", "parsed"]

Array = NDArray[np.float64]
Chosen = set[int]
Rule = Callable[["Seen"], Chosen]
# Directions within this angle are parallel: CadQuery's 1e-4 rad.
PARALLEL = 1e-4
# Expressions in expressions, each of which takes some calls on the stack.
_DEEPEST = 50
_SIMPLE = {"X": (1, 0, 0), "Y": (0, 1, 0), "Z": (0, 0, 1), "XY": (1, 1, 0), "XZ": (1, 0, 1), "YZ": (0, 1, 1)}
_VIEWS = {"front": ">Z", "back": "<Z", "left": "<X", "right": ">X", "top": ">Y", "bottom": "<Y"}
_NUMBER = r"\s*([+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)\s*"
_VECTOR = re.compile(rf"\({_NUMBER},{_NUMBER},{_NUMBER}\)")
_DIRECTION = re.compile(r"XY|XZ|YZ|X|Y|Z")
_INDEX = re.compile(r"\[\s*(-?\s*\d+)\s*\]")
_KIND = re.compile(r"[A-Za-z]+")
_VIEW = re.compile("|".join(_VIEWS))


class Seen:
    """What selectors see of things, asked for where a selector needs it.

    Parameters
    ----------
    count : int
        Of the things.
    center
        (3,) of the k-th.
    direction
        Of the k-th, if it is a plane or a straight edge: a unit vector.
    kinds
        Names of the kind of the k-th, in capitals.
    known : sequence of str
        All names of kinds that may be asked for.
    tolerance : float
        Centers that are apart by less along a direction are at one place.
    have_sense : bool
        Whether directions have a sense: those of edges have none.
    """

    def __init__(
        self,
        count: int,
        center: Callable[[int], Array],
        direction: Callable[[int], Array | None],
        kinds: Callable[[int], set[str]],
        known: Sequence[str],
        tolerance: float,
        have_sense: bool,
    ) -> None:
        self.count = count
        self.center = center
        self.direction = direction
        self.kinds = kinds
        self.known = known
        self.tolerance = tolerance
        self.have_sense = have_sense

    def all(self) -> Chosen:
        """All of them."""
        return set(range(self.count))

    def turned(self, direction: Array, angle: float, either: bool) -> Chosen:
        """Those at an angle to a direction, or to it or its opposite."""
        found = set()
        for k in range(self.count):
            own = self.direction(k)
            if own is not None:
                across, along = float(np.linalg.norm(np.cross(direction, own))), float(direction @ own)
                off = np.arctan2(across, abs(along) if either else along)
                if abs(off - angle) < PARALLEL:
                    found.add(k)
        return found

    def at_place(self, among: Chosen, direction: Array, place: int, upward: bool, said: str) -> Chosen:
        """Those at the place of this number along a direction."""
        if not among:
            return set()
        heights = sorted((float(self.center(k) @ direction), k) for k in among)
        groups: list[list[int]] = []
        start = -np.inf
        for height, k in heights:
            if not groups or height - start > self.tolerance:
                groups.append([])
                start = height
            groups[-1].append(k)
        if not upward:
            groups.reverse()
        if not -len(groups) <= place < len(groups):
            raise InputError(f"selector {said!r} asks for place {place}; expected one of {len(groups)} that there are")
        return set(groups[place])


class _Reader:
    """Reads one selector string from left to right."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0
        self._depth = 0

    def read(self) -> Rule:
        rule = self._expression()
        if self._rest():
            raise self._unexpected("'and', 'or', 'exc' or the end")
        return rule

    def _rest(self) -> str:
        """What is left, without the blanks before it."""
        while self._at < len(self._text) and self._text[self._at].isspace():
            self._at += 1
        return self._text[self._at :]

    def _takes(self, *words: str) -> str | None:
        rest = self._rest()
        for word in words:
            if rest.startswith(word):
                self._at += len(word)
                return word
        return None

    def _match(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        found = pattern.match(self._rest())
        if found:
            self._at += found.end()
        return found

    def _unexpected(self, expected: str) -> InputError:
        here = repr(self._rest()) if self._rest() else "its end"
        return InputError(f"selector is {self._text!r}; expected {expected} at {here}")

    def _expression(self) -> Rule:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise InputError(f"selector nests more than {_DEEPEST} times 'not' and '('; expected a shorter one")
        rule = self._operand()
        while self._takes("except", "exc"):
            rule = _without(rule, self._operand())
        self._depth -= 1
        return rule

    def _operand(self) -> Rule:
        rules = [self._terms()]
        while self._takes("or"):
            rules.append(self._terms())
        return lambda seen: set().union(*(rule(seen) for rule in rules))

    def _terms(self) -> Rule:
        rules = [self._atom()]
        while self._takes("and"):
            rules.append(self._atom())
        return lambda seen: set.intersection(*(rule(seen) for rule in rules))

    def _atom(self) -> Rule:
        if self._takes("not"):
            inner = self._expression()
            return lambda seen: seen.all() - inner(seen)
        rest = self._rest()
        if rest.startswith("(") and not _VECTOR.match(rest):
            self._at += 1
            rule = self._expression()
            if not self._takes(")"):
                raise self._unexpected("')'")
            return rule
        return self._selector()

    def _selector(self) -> Rule:
        begin = self._at
        view = self._match(_VIEW)
        if view:
            raise InputError(
                f"selector is {self._text!r} with the view {view[0]!r}, which is {_VIEWS[view[0]]!r} in CadQuery; "
                "expected that, or faces.named(...) for a name"
            )
        sign = self._takes(">>", "<<", ">", "<", "|", "#", "+", "-", "%")
        if sign == "%":
            return self._kind()
        direction = self._direction(sign)
        if sign in (">", "<", ">>", "<<"):
            index = self._match(_INDEX)
            place = -1 if index is None else int(index[1].replace(" ", ""))
            said = self._text[begin : self._at]
            only_parallel = index is not None and sign in (">", "<")
            upward = sign[0] == ">"

            def rule(seen: Seen) -> Chosen:
                among = seen.turned(direction, 0.0, either=True) if only_parallel else seen.all()
                return seen.at_place(among, direction, place, upward, said)

            return rule
        if sign in ("|", "#"):
            angle = 0.0 if sign == "|" else radians(90.0)
            return lambda seen: seen.turned(direction, angle, either=True)
        along = -direction if sign == "-" else direction

        def aligned(seen: Seen) -> Chosen:
            if not seen.have_sense:
                raise InputError(
                    f"selector is {self._text!r}; expected '|' for edges, which have a direction, no sense"
                )
            return seen.turned(along, 0.0, either=False)

        return aligned

    def _kind(self) -> Rule:
        found = self._match(_KIND)
        if not found:
            raise self._unexpected("the name of a kind, such as PLANE")
        name = found[0].upper()

        def rule(seen: Seen) -> Chosen:
            if name not in seen.known:
                raise InputError(
                    f"selector is {self._text!r} with kind {name}; expected one of {', '.join(seen.known)}"
                )
            return {k for k in range(seen.count) if name in seen.kinds(k)}

        return rule

    def _direction(self, sign: str | None) -> Array:
        vector = self._match(_VECTOR)
        if vector:
            given = np.array([float(x) for x in vector.groups()])
        else:
            simple = self._match(_DIRECTION)
            if not simple:
                expected = "a direction, X, Y, Z, XY, XZ, YZ or (x, y, z)"
                raise self._unexpected(expected if sign else f"one of > < >> << | # + - %, or {expected}")
            given = np.array(_SIMPLE[simple[0]], dtype=float)
        size = float(np.linalg.norm(given))
        if not 0.0 < size < np.inf:
            raise InputError(
                f"selector is {self._text!r} with the direction {given.tolist()}; expected one that is finite and not 0"
            )
        return np.asarray(given / size)


def _without(rule: Rule, other: Rule) -> Rule:
    return lambda seen: rule(seen) - other(seen)


def parsed(text: object) -> Rule:
    """What a selector string chooses, as a function of what is seen.

    Raises
    ------
    TypeError
        No string.
    InputError
        A string that CadQuery's grammar does not have; the text says what was expected where.
    """
    if not isinstance(text, str):
        raise TypeError(f"selector is {text!r}; expected a string such as '>Z' or '%CYLINDER and |X'")
    return _Reader(text).read()
