"""Intervals of doubles, rounded outward.

An interval is a pair (lo, hi). Every operation of doubles errs by half a unit of the last place at most, so

    down(x) = x - (|x| 2^-52 + 1e-300) <= the exact value <= up(x)

for sums, differences, products, quotients and square roots (the relative term is twice the half unit, which pays for
the roundings of down and up themselves; the absolute one is for numbers that underflow). Elementary functions are
widened by 8 units: the libraries in use promise 4 or less. A result that is NaN or has no known bound becomes the
whole line.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel

# The distance from one to the next double above it.
EPSILON = 2.0**-52
TINY = 1e-300
LIBRARY = 8.0 * EPSILON
# The sine and cosine of larger arguments get the bounds -1 and 1.
FAR = 1e8


@kernel(inline=True)
def down(x):
    """A double below x, and below what was rounded to x."""
    return x - (abs(x) * EPSILON + TINY)


@kernel(inline=True)
def up(x):
    """A double above x, and above what was rounded to x."""
    return x + (abs(x) * EPSILON + TINY)


@kernel(inline=True)
def widened(lo, hi, part):
    """An interval with both ends moved outward by a part of themselves; the whole line where one is not a number."""
    lo = lo - (abs(lo) * part + TINY)
    hi = hi + (abs(hi) * part + TINY)
    if not (lo <= hi):
        return -math.inf, math.inf
    return lo, hi


@kernel(inline=True)
def isum(a, b):
    return widened(a[0] + b[0], a[1] + b[1], EPSILON)


@kernel(inline=True)
def idifference(a, b):
    return widened(a[0] - b[1], a[1] - b[0], EPSILON)


@kernel(inline=True)
def iproduct(a, b):
    p = a[0] * b[0]
    q = a[0] * b[1]
    r = a[1] * b[0]
    s = a[1] * b[1]
    if not (p + q + r + s == p + q + r + s):  # zero times infinity, or both infinities: the whole line either way
        return -math.inf, math.inf
    return widened(min(min(p, q), min(r, s)), max(max(p, q), max(r, s)), EPSILON)


@kernel(inline=True)
def isquare(a):
    p = a[0] * a[0]
    q = a[1] * a[1]
    lo = 0.0 if a[0] <= 0.0 <= a[1] else min(p, q)
    return max(lo * (1.0 - EPSILON) - TINY, 0.0), up(max(p, q))


@kernel(inline=True)
def iquotient(a, b):
    if b[0] <= 0.0 <= b[1]:
        return -math.inf, math.inf
    p = a[0] / b[0]
    q = a[0] / b[1]
    r = a[1] / b[0]
    s = a[1] / b[1]
    if not (p + q + r + s == p + q + r + s):
        return -math.inf, math.inf
    return widened(min(min(p, q), min(r, s)), max(max(p, q), max(r, s)), EPSILON)


@kernel(inline=True)
def meet(a, b):
    """The intersection of two intervals that enclose the same number; the first if rounding makes them disjoint."""
    lo = max(a[0], b[0])
    hi = min(a[1], b[1])
    if not (lo <= hi):
        return a
    return lo, hi


@kernel(inline=True)
def magnitude(a):
    """Largest absolute value."""
    return max(abs(a[0]), abs(a[1]))


@kernel(inline=True)
def reaches(lo, hi, first, period):
    """Whether first + k period lies in [lo, hi] for an integer k, or nearly."""
    k = math.floor((hi - first) / period + 1e-7)
    return first + k * period >= lo - 1e-7 * period


@kernel(inline=True)
def iwave(lo, hi, p, q, top):
    """Bounds of a sine or cosine from its values p and q at the ends; `top` is where its value is one.

    An extremum closer than 1e-7 of a period to the interval counts as inside.
    """
    low = min(p, q)
    high = max(p, q)
    if hi - lo > 1e-7:
        if reaches(lo, hi, top, 2.0 * math.pi):
            high = 1.0
        if reaches(lo, hi, top + math.pi, 2.0 * math.pi):
            low = -1.0
    elif hi != lo:
        # Between its ends the function leaves its chord by at most an eighth of the square of the width.
        bend = 0.125 * (hi - lo) * (hi - lo)
        low -= bend
        high += bend
    low, high = widened(low, high, LIBRARY)
    return max(low, -1.0), min(high, 1.0)


@kernel(inner=True, exact=True)
def isine(lo, hi):
    """Bounds of the sine."""
    if not (abs(lo) < FAR and abs(hi) < FAR):
        return -1.0, 1.0
    p = math.sin(lo)
    return iwave(lo, hi, p, math.sin(hi) if hi != lo else p, 0.5 * math.pi)


@kernel(inner=True, exact=True)
def icosine(lo, hi):
    """Bounds of the cosine."""
    if not (abs(lo) < FAR and abs(hi) < FAR):
        return -1.0, 1.0
    p = math.cos(lo)
    return iwave(lo, hi, p, math.cos(hi) if hi != lo else p, 0.0)


@kernel(inner=True, exact=True)
def ipower(a, b):
    """Bounds of a ** b: integer exponents for any base, others for bases that are not negative."""
    low, high = a
    if b[0] == b[1] and b[0] == math.floor(b[0]) and abs(b[0]) < 1e9:
        n = b[0]
        p = low**n
        q = high**n
        if n < 0.0 and low <= 0.0 <= high:
            return -math.inf, math.inf
        if n == 2.0 * math.floor(0.5 * n):
            least = min(p, q)
            if n > 0.0 and low <= 0.0 <= high:
                least = 0.0
            lo, hi = widened(least, max(p, q), LIBRARY)
            return max(lo, 0.0), hi
        return widened(min(p, q), max(p, q), LIBRARY)
    # A negative base has powers at the integers among the exponents.
    if high < 0.0 or (low < 0.0 and b[0] != b[1]):
        return -math.inf, math.inf
    low = max(low, 0.0)
    p = low ** b[0]
    q = low ** b[1]
    r = high ** b[0]
    s = high ** b[1]
    if not (p + q + r + s == p + q + r + s):
        return -math.inf, math.inf
    lo, hi = widened(min(min(p, q), min(r, s)), max(max(p, q), max(r, s)), LIBRARY)
    # An exponent interval that contains zero: the base one has the value one, between the corners anyway.
    return max(lo, 0.0), hi


@kernel(inner=True, exact=True)
def iarctangent2(a, b):
    """Bounds of the angle of (b, a), and whether the cut of the negative axis may lie inside."""
    if b[0] <= 0.0 and a[0] <= 0.0 <= a[1]:
        return -math.pi - LIBRARY, math.pi + LIBRARY, True
    p = math.atan2(a[0], b[0])
    q = math.atan2(a[0], b[1])
    r = math.atan2(a[1], b[0])
    s = math.atan2(a[1], b[1])
    lo, hi = widened(min(min(p, q), min(r, s)), max(max(p, q), max(r, s)), LIBRARY)
    return lo, hi, False


_GROW = 1.0 + 16.0 * EPSILON


@kernel(inline=True)
def middle_of(x, o, k):
    """A double in the k-th of the pairs at x[o:]."""
    return 0.5 * (x[o + 2 * k] + x[o + 2 * k + 1])


@kernel(inner=True, exact=True)
def off_of(x, o):
    """Upper bound of the distance from the middle of a box, three pairs, to any point in it."""
    a = x[o + 1] - x[o]
    b = x[o + 3] - x[o + 2]
    c = x[o + 5] - x[o + 4]
    # Half the width, and the rounding of the middle itself.
    size = abs(x[o]) + abs(x[o + 2]) + abs(x[o + 4])
    return _GROW * (0.5 * math.sqrt(a * a + b * b + c * c) + EPSILON * size)


@kernel(inner=True, exact=True)
def most(x, o):
    """Upper bound of the norm of a vector that three pairs enclose."""
    a = magnitude((x[o], x[o + 1]))
    b = magnitude((x[o + 2], x[o + 3]))
    c = magnitude((x[o + 4], x[o + 5]))
    return _GROW * math.sqrt(a * a + b * b + c * c)
