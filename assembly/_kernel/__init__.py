"""The only module that uses Numba: `@kernel`, and a cache of compiled entries that cannot be stale.

An entry is a kernel that Python calls, or that other kernels call by its address; it is compiled with all that it
calls. Kernels that only kernels call are marked ``inline`` or ``inner`` and have no machine code of their own.
"""

from assembly._kernel.decorator import kernel

__all__ = ["kernel"]
