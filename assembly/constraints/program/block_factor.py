"""Cholesky factorization by blocks of six (`constraints/program/hessian_blocks.py`): the step of scenes of many bodies.

Row i of the factor is a panel: its blocks side by side, each column by column, so that six rows of one column are next
to each other and all strides are known to the compiler. It is made from the Hessian's row and from the rows k above
that reach column i,

    U_i.  =  U_ii^-T (H_i. - sum_k U_ki^T U_k.).

In panel k the blocks from column i on are contiguous; so are most of the blocks of panel i that they are subtracted
from.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._lanes import load_lanes, store_lanes
from assembly.constraints.program.hessian_blocks import blocks_at


@kernel(inner=True)
def greatest_diagonal(lagrangian, blocks):
    """The largest entry on the diagonal, without its sign; not finite if one is not."""
    layout = blocks_at(blocks, 0)
    most = 1.0
    for p in range(layout.count):
        at = 6 * blocks[layout.first + p]
        for i in range(6):
            value = abs(lagrangian[at + i, i])
            if not value < math.inf:
                return value
            most = max(most, value)
    return most


@kernel(inner=True)
def place_panel(lagrangian, blocks, i, shift, panels, o, count, positions):
    """Write row i of the Hessian + shift I to the panel of `count` blocks at o; its columns' places to `positions`."""
    layout = blocks_at(blocks, 0)
    first = blocks[layout.panel + i]
    for p in range(count):
        positions[blocks[layout.across + first + p]] = o + 36 * p
    for l in range(o, o + 36 * count):
        panels[l] = 0.0
    for e in range(blocks[layout.first + i], blocks[layout.first + i + 1]):
        position = blocks[layout.position + e]
        at = o + 36 * (position // 2)
        if position % 2 == 1:
            for r in range(6):
                for c in range(6):
                    panels[at + 6 * c + r] = lagrangian[6 * e + c, r]
        else:
            for r in range(6):
                for c in range(6):
                    panels[at + 6 * c + r] = lagrangian[6 * e + r, c]
    for r in range(6):
        panels[o + 7 * r] += shift


@kernel(inline=True)
def turn_block(panels, factor, turned):
    """Write the transpose of the block at `factor` to `turned`."""
    for r in range(6):
        for c in range(6):
            turned[6 * r + c] = panels[factor + 6 * c + r]


@kernel(inner=True)
def subtract_blocks(panels, at, turned, source, count):
    """Subtract the block `turned` times the `count` blocks from `source` on from the blocks from `at` on.

    A column of six numbers is handled as two vectors of four lanes, which overlap in two numbers.
    """
    a0, b0 = load_lanes(turned, 0), load_lanes(turned, 2)
    a1, b1 = load_lanes(turned, 6), load_lanes(turned, 8)
    a2, b2 = load_lanes(turned, 12), load_lanes(turned, 14)
    a3, b3 = load_lanes(turned, 18), load_lanes(turned, 20)
    a4, b4 = load_lanes(turned, 24), load_lanes(turned, 26)
    a5, b5 = load_lanes(turned, 30), load_lanes(turned, 32)
    for c in range(6 * count):
        s = source + 6 * c
        o = at + 6 * c
        y = load_lanes(panels, o)
        z = load_lanes(panels, o + 2)
        x = panels[s]
        y = y - x * a0
        z = z - x * b0
        x = panels[s + 1]
        y = y - x * a1
        z = z - x * b1
        x = panels[s + 2]
        y = y - x * a2
        z = z - x * b2
        x = panels[s + 3]
        y = y - x * a3
        z = z - x * b3
        x = panels[s + 4]
        y = y - x * a4
        z = z - x * b4
        x = panels[s + 5]
        y = y - x * a5
        z = z - x * b5
        store_lanes(y, panels, o)
        store_lanes(z, panels, o + 2)


@kernel(inline=True)
def solve_column(panels, o, c, count):
    """Multiply the first `count` numbers at c by U^-T; U is the block at o, whose diagonal is stored inverted."""
    for r in range(count):
        s = panels[c + r]
        for l in range(r):
            s -= panels[o + 6 * r + l] * panels[c + l]
        panels[c + r] = s * panels[o + 7 * r]


@kernel(inner=True)
def finish_panel(panels, o, count):
    """Factorize the block on the diagonal and scale the others; False where that is not positive definite."""
    for c in range(6):
        at = o + 6 * c
        solve_column(panels, o, at, c)
        pivot = panels[at + c]
        for l in range(c):
            pivot -= panels[at + l] * panels[at + l]
        if not pivot > 0.0:
            return False
        panels[at + c] = 1.0 / math.sqrt(pivot)
    for c in range(6, 6 * count):
        solve_column(panels, o, o + 6 * c, 6)
    return True


@kernel(signatures="(f8[:, ::1], i8[::1], f8, f8[::1], i8[::1], f8[::1])")
def factorize_blocks(lagrangian, blocks, shift, panels, positions, turned):
    """Write U of lagrangian + shift I = U^T U to the panels, its diagonal inverted. Returns 1, or 0 if there is none.

    Called by its address, because only few scenes are large enough to need it.
    """
    layout = blocks_at(blocks, 0)
    for i in range(layout.count):
        first = blocks[layout.panel + i]
        count = blocks[layout.panel + i + 1] - first
        o = 36 * first
        place_panel(lagrangian, blocks, i, shift, panels, o, count, positions)
        for e in range(blocks[layout.meeting + i], blocks[layout.meeting + i + 1]):
            k = blocks[layout.meeting_row + e]
            p = blocks[layout.panel + k] + blocks[layout.meeting_at + e]
            end = blocks[layout.panel + k + 1]
            turn_block(panels, 36 * p, turned)
            while p < end:
                # Take together the blocks that are contiguous in both panels.
                at = positions[blocks[layout.across + p]]
                run = 1
                while p + run < end and positions[blocks[layout.across + p + run]] == at + 36 * run:
                    run += 1
                subtract_blocks(panels, at, turned, 36 * p, run)
                p += run
        if not finish_panel(panels, o, count):
            return 0
    return 1


@kernel(inner=True)
def forward_blocks(blocks, panels, b, x):
    """Solve U^T x = b, b in the order of the unknowns, x in that of the factor."""
    layout = blocks_at(blocks, 0)
    for k in range(layout.count):
        p = 6 * blocks[layout.place + k]
        for i in range(6):
            x[p + i] = b[6 * k + i]
    for k in range(layout.count):
        first = blocks[layout.panel + k]
        o = 36 * first
        at = 6 * k
        for r in range(6):
            s = x[at + r]
            for l in range(r):
                s -= panels[o + 6 * r + l] * x[at + l]
            x[at + r] = s * panels[o + 7 * r]
        for p in range(first + 1, blocks[layout.panel + k + 1]):
            to = 6 * blocks[layout.across + p]
            for c in range(6):
                f = 36 * p + 6 * c
                for r in range(6):
                    x[to + c] -= panels[f + r] * x[at + r]


@kernel(inner=True)
def substitute_blocks(blocks, panels, b, x):
    """Solve U^T U x = b in place of b; x is scratch."""
    layout = blocks_at(blocks, 0)
    forward_blocks(blocks, panels, b, x)
    for k in range(layout.count - 1, -1, -1):
        first = blocks[layout.panel + k]
        o = 36 * first
        at = 6 * k
        for p in range(first + 1, blocks[layout.panel + k + 1]):
            to = 6 * blocks[layout.across + p]
            for c in range(6):
                s = x[to + c]
                f = 36 * p + 6 * c
                for r in range(6):
                    x[at + r] -= panels[f + r] * s
        for c in range(5, -1, -1):
            s = x[at + c] * panels[o + 7 * c]
            x[at + c] = s
            for r in range(c):
                x[at + r] -= panels[o + 6 * c + r] * s
    for k in range(layout.count):
        p = 6 * blocks[layout.place + k]
        for i in range(6):
            b[6 * k + i] = x[p + i]


@kernel(signatures="(i8[::1], f8[::1], f8[::1], f8[::1], i8)")
def solve_blocks(blocks, panels, b, x, half):
    """Solve U^T U x = b; if `half` is 1, U^T x = b in the order of the factor. x replaces b. Called by its address."""
    if half == 0:
        substitute_blocks(blocks, panels, b, x)
        return 0
    forward_blocks(blocks, panels, b, x)
    for i in range(b.size):
        b[i] = x[i]
    return 0
