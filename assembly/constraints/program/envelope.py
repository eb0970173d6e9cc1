"""Where the Hessian of the Lagrangian has entries, and where its factor has them.

Unknowns are numbered bodies first, six each, then four of every lifted pair. Row i of the upper triangle reaches to
last[i] among the bodies (or, of a pair's own unknowns, to the end of its four); a pair's blocks with its two bodies are
listed apart, in `folds`. Factorized in that order, one such pair would fill the rows of all later bodies. So in the
factor the unknowns of a pair stand behind the later one of its bodies: unknown i is number place[i] there, and row p
of the factor reaches to ends[p].

    order = Sparsity(places (last, place, ends), folds, scratch, blocks)

`folds` (pairs + 1, 2) holds the first unknowns of the two bodies, negative for a fixed one, and in its last row the
number of pairs, and 1 if blocks are used instead of all this (`constraints/program/hessian_blocks.py`). `scratch` has
one row of n numbers, or where there are blocks thirteen rows of at least 36. There are few arrays, because each costs
every call some nanoseconds. Where dexterities couple all bodies, no pair is listed and `last` alone says where entries
are.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.program.hessian_blocks import blocks_at, is_blocked


@kernel(inline=True)
def listed_folds(order):
    """The number of lifted pairs that `folds` lists."""
    folds = order.folds
    return folds[folds.shape[0] - 1, 0]


@kernel(inner=True)
def clear_upper(order, n, hessian):
    """Set the entries of the Hessian to zero."""
    if is_blocked(order):
        for i in range(6 * blocks_at(order.blocks, 0).blocks):
            for j in range(6):
                hessian[i, j] = 0.0
        return
    last, folds = order.places[0], order.folds
    for i in range(n):
        for j in range(i, last[i] + 1):
            hessian[i, j] = 0.0
    count = listed_folds(order)
    for k in range(count):
        u = n - 4 * (count - k)
        for side in range(2):
            at = folds[k, side]
            if at >= 0:
                for i in range(at, at + 6):
                    for j in range(u, u + 4):
                        hessian[i, j] = 0.0


@kernel(inner=True)
def place_upper(hessian, n, order, shift, matrix):
    """The upper triangle of hessian + shift I, in the order of the factor."""
    places, folds = order.places, order.folds
    last, place, ends = places[0], places[1], places[2]
    count = listed_folds(order)
    if count == 0:
        for i in range(n):
            for j in range(i, last[i] + 1):
                matrix[i, j] = hessian[i, j]
            matrix[i, i] += shift
        return
    for p in range(n):
        for c in range(p, ends[p] + 1):
            matrix[p, c] = 0.0
    for i in range(n):
        p = place[i]
        for j in range(i, last[i] + 1):
            matrix[p, place[j]] = hessian[i, j]
        matrix[p, p] += shift
    for k in range(count):
        u = n - 4 * (count - k)
        for side in range(2):
            at = folds[k, side]
            if at >= 0:
                for i in range(at, at + 6):
                    for j in range(u, u + 4):
                        p, c = place[i], place[j]
                        matrix[min(p, c), max(p, c)] = hessian[i, j]


@kernel(inner=True)
def close_envelope(last, n):
    """Let no row end before the row above it."""
    for i in range(1, n):
        last[i] = max(last[i], last[i - 1])


@kernel(inner=True)
def place_folds(n, order):
    """The order of the factor, for `last` and `folds` as they are: see the heading."""
    places, folds = order.places, order.folds
    last, place, ends = places[0], places[1], places[2]
    count = listed_folds(order)
    first = n - 4 * count
    # Count the pairs that stand before each body; to this end, first those right behind each body.
    for i in range(n):
        ends[i] = 0
    ahead = 0
    for k in range(count):
        behind = max(folds[k, 0], folds[k, 1])
        if behind < 0:
            ahead += 1
        else:
            ends[behind] += 1
    before = ahead
    for at in range(0, first, 6):
        for i in range(at, at + 6):
            place[i] = i + 4 * before
        before += ends[at]
        # From here on: where the next pair behind this body begins.
        ends[at] = place[at] + 6
    ahead = 0
    for k in range(count):
        u = first + 4 * k
        behind = max(folds[k, 0], folds[k, 1])
        if behind < 0:
            start = 4 * ahead
            ahead += 1
        else:
            start = ends[behind]
            ends[behind] += 4
        for i in range(4):
            place[u + i] = start + i
    for i in range(n):
        ends[i] = i
    for i in range(n):
        ends[place[i]] = max(ends[place[i]], place[last[i]])
    for k in range(count):
        u = first + 4 * k
        for side in range(2):
            at = folds[k, side]
            if at >= 0:
                low = min(place[at], place[u])
                ends[low] = max(ends[low], max(place[at + 5], place[u + 3]))
    close_envelope(ends, n)
