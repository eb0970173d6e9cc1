"""Functions that kernels call without a call: their code is written into the caller.

`numba.extending.intrinsic` makes such functions, but for kernels alone. One that Python calls as well, by its own
definition, is an overload around an intrinsic, which Numba compiles for itself, with a wrapper for C, for each set of
types. Of the loop's 430 functions 96 were such.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import types
from numba.core.typing.templates import infer, infer_global, make_intrinsic_template

__all__ = ["written_by"]


def written_by(function: Callable[..., Any], definition: Callable[..., Any]) -> None:
    """Have kernels call a function of Python's by what a definition writes.

    Parameters
    ----------
    function
        What Python calls.
    definition
        As for `numba.extending.intrinsic`: of the typing context and types of arguments, the signature and a function
        that writes the code.
    """
    template = make_intrinsic_template(function, definition, function.__name__)
    infer(template)
    infer_global(function, types.Function(template))
