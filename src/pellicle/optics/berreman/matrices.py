"""2×2 matrices of numbers, each number a real array, a complex array or a `Pair`."""

from __future__ import annotations

from typing import NamedTuple

from pellicle.optics.pair import Number


class Matrix(NamedTuple):
    """Matrix ((pp, ps), (sp, ss))."""

    pp: Number
    ps: Number
    sp: Number
    ss: Number

    def __matmul__(self, other: Matrix) -> Matrix:
        return Matrix(
            self.pp * other.pp + self.ps * other.sp,
            self.pp * other.ps + self.ps * other.ss,
            self.sp * other.pp + self.ss * other.sp,
            self.sp * other.ps + self.ss * other.ss,
        )


def one_minus(matrix: Matrix) -> Matrix:
    """Return 1 − matrix."""
    return Matrix(1 - matrix.pp, -matrix.ps, -matrix.sp, 1 - matrix.ss)


def one_plus(matrix: Matrix) -> Matrix:
    """Return 1 + matrix."""
    return Matrix(1 + matrix.pp, matrix.ps, matrix.sp, 1 + matrix.ss)


def inverse(matrix: Matrix) -> Matrix:
    """Return the inverse."""
    pp, ps, sp, ss = matrix
    scale = 1 / (pp * ss - ps * sp)
    return Matrix(ss * scale, -ps * scale, -sp * scale, pp * scale)
