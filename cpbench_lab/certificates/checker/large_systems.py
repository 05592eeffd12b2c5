"""Solve a large sparse system over the rationals: digits from SciPy's LU in doubles, residuals in Python's integers.

Each solve gives some digits more, and the residual is taken anew from the integers. From enough digits a common
denominator is read by continued fractions. Whoever asks checks the rows: nothing here is believed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from certificate_file import require
from flint import fmpq, fmpz

BITS, SPARE = 40, 24
"""Binary digits that a solve is asked for, and those of an approximation that may be wrong."""


def large_system(A: list[dict[int, float]], b: list[Any]) -> list[Any]:
    """Return x with A x = b, of rows as dictionaries; raises ValueError where the digits do not come."""
    common = fmpz(1)
    for side in b:
        common = common * side.q // common.gcd(side.q)
    rows, right, at, values, units = [], [], [], [], []
    for i, (row, side) in enumerate(zip(A, b, strict=True)):
        ratios = [value.as_integer_ratio() for value in row.values()]
        unit = max((q for _, q in ratios), default=1)  # the denominators are powers of two
        size = 2.0 ** int(np.frexp(max(map(abs, row.values()), default=1.0))[1])
        rows.append(list(zip(row, [p * (unit // q) for p, q in ratios], strict=True)))
        right.append(int(side.p * (common // side.q)) * unit)
        units.append(1.0 / (unit * size))
        at += [(i, j) for j in row]
        values += [value / size for value in row.values()]
    S: Any = sp.csc_array((values, tuple(np.array(at).T)), shape=(len(A), len(A)))
    columns = np.ldexp(1.0, -np.frexp(abs(S).max(axis=0).toarray().ravel())[1])
    lu = spla.splu(sp.csc_matrix(S @ sp.diags_array(columns)))
    x, rest, places, wanted, sure = [0] * len(A), right, 0, 8 * BITS, -(2**40)
    while True:
        z = columns * lu.solve(np.array([float(v) for v in rest]) * np.array(units))
        top = int(np.frexp(np.abs(z).max())[1]) if z.any() else -BITS
        require(bool(np.isfinite(z).all()) and (not z.any() or places - top > sure), "the system is nearly singular")
        sure = places - top
        if sure >= wanted or not z.any():
            D = denominator([fmpz(v) for v in x], places, max(top, 0) + SPARE)
            if D is not None:
                half = fmpz(1) << max(places - 1, 0)
                return [fmpq((fmpz(v) * D + half) >> places, D * common) for v in x]
            require(bool(z.any()), "no common denominator was found")
            wanted = 2 * sure
        more, less = max(BITS - top, 0), max(top - BITS, 0)
        step = [int(v) << less for v in np.rint(np.ldexp(z, more - less))]
        x = [(v << more) + s for v, s in zip(x, step, strict=True)]
        rest = [(r << more) - sum(v * step[j] for j, v in row) for r, row in zip(rest, rows, strict=True)]
        places += more


def denominator(x: list[Any], places: int, doubt: int) -> Any:
    """Return the D for which all D·x/2^places are whole to the digits that are known, None where it is too long."""
    D, one = fmpz(1), fmpz(1) << places
    for v in x:
        a, part, before, q = one, v * D % one, fmpz(0), fmpz(1)
        part = part - one if 2 * part > one else part
        a, part = one, abs(part)
        while part > (D * q) << doubt:
            k = a // part
            a, part, before, q = part, a - k * part, q, k * q + before
        D *= q
        if 2 * D.bit_length() + doubt + SPARE > places:
            return None
    return D
