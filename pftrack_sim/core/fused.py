"""Products added unrounded, as BLAS libraries multiply matrices: kernels then equal NumPy's products to the bit.

After a change here, delete the caches of kernels in `__pycache__`: Numba does not see changes in another module.
"""

from __future__ import annotations

from typing import Any

from numba import njit, types
from numba.extending import intrinsic


def _fused(_: Any, a: Any, b: Any, c: Any) -> Any:
    """Product of two numbers plus a third, rounded once."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(a, b, c), generate


fused_multiply_add: Any = intrinsic(_fused)


@njit(cache=True, nogil=True, inline="always")
def fused_dot(row: Any, x: float, y: float, z: float) -> float:
    """Dot product of a `(3,)` array with x, y, z, as an element of the product of two matrices."""
    return fused_multiply_add(row[2], z, fused_multiply_add(row[1], y, row[0] * x))
