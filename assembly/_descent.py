"""Down two trees together: a stack of pairs of nodes, and steps that say which pairs of their children are worth it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

# What a step says instead of a child: that it leads to nothing, or that the walk ends.
NONE, STOP = -1, -2


def descend_pairs(step: Callable[..., Any]) -> Callable[..., Any]:
    """The body of a kernel (walk, found, stack) -> (found, whether the stack (n, 2) was long enough), from the roots.

    A step (walk, i, j, found) -> (found, on_f, first, second) tells two children of node i of f, or else of node j of
    g, whose pairs with the other node are looked at later, the second one first.
    """

    def descend(walk: Any, found: Any, stack: Any) -> Any:
        used = min(stack.shape[0], 1)
        fits = used == 1
        stack[:used] = 0
        while used > 0 and fits:
            used -= 1
            i, j = stack[used, 0], stack[used, 1]
            found, on_f, first, second = step(walk, i, j, found)
            if second == STOP:
                break
            fits = (first < 0 and second < 0) or used + 2 <= stack.shape[0]
            for child in (first, second):
                if child >= 0 and fits:
                    stack[used, 0] = child if on_f else i
                    stack[used, 1] = j if on_f else child
                    used += 1
        return found, fits

    return descend
