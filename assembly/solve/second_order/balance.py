"""How well multipliers balance the slope of the objective: in a file of its own, which kernels may import."""

from __future__ import annotations

__all__ = ["UNBALANCED"]

# Multipliers that leave more of the objective's slope are balanced anew.
UNBALANCED = 1e-9
