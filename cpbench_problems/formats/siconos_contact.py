"""Siconos text of contact problems; d rows a contact, normal first.

    FC2D, FC3D      d nc  M  q  mu[nc]                          d = 2, 3
    GFC2D, GFC3D    d nc  M  H  q[n] b[d nc] mu[nc]             our f and w
    RFC2D, RFC3D    d nc  M  q  mu[nc] mu_r[nc]                 d = 3, 5: rolling
    GRFC2D, GRFC3D  d nc  M  H  q[n] b[d nc] mu[nc] mu_r[nc]
    plasticity      3 nc model  M  q  yield parameters; older files: 3 nc  M  q  eta[nc] theta[nc], as in RFC2D

Only the count of numbers tells FC3D from RFC2D (and GFC3D from GRFC2D). Where that says nothing, a guess is on the
side of FC3D: without contacts, and for one contact when the last number is a lone digit ('a guess follows').
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench_problems.formats.siconos_linear import Builder, builder
from cpbench_problems.formats.siconos_matrix import Cursor, read_matrix


def contact_reader(formulation: type[Problem], dimension: int) -> Callable[[Cursor], Builder]:
    """Return a reader of problems of a contact formulation with so many rows a contact."""
    fields = {field.name for field in dataclasses.fields(formulation)}

    def read(c: Cursor) -> Builder:
        size, nc = _heading(c, dimension)
        parts = _global(c, size) if "H" in fields else _local(c, size)
        if "mu_r" in fields:
            parts |= _coefficients(c, dimension, nc)
            c.finish()
        else:
            parts["mu"] = c.numbers("mu", nc)
            c.finish(flag=True)
        return builder(c, formulation, **parts, dimension=dimension)

    return read


def is_plasticity(c: Cursor) -> bool:
    """Return whether the file has the layout of a plasticity problem, which is not a formulation here."""
    try:
        d, nc, model = c.integer("d"), c.integer("nc"), c.integer("model")
        if d != 3 or model not in (1, 2):
            return False
        read_matrix(c, "M", (d * nc, d * nc))
        c.numbers("q and yield parameters", d * nc + (2 if model == 1 else 1) * nc)
        c.finish()
    except FormatError:
        return False
    return True


def _heading(c: Cursor, dimension: int) -> tuple[int, int]:
    d = c.integer("d")
    if d != dimension:
        raise c.error("d", f"is {d}, expected {dimension}")
    nc = c.integer("nc")
    return d * nc, nc


def _local(c: Cursor, size: int) -> dict[str, Any]:
    return {"W": read_matrix(c, "M", (size, size)), "q": c.numbers("q", size)}


def _global(c: Cursor, size: int) -> dict[str, Any]:
    M = read_matrix(c, "M", None)
    n = M.shape[0]
    H = read_matrix(c, "H", (n, size))
    return {"M": M, "H": H, "f": c.numbers("q", n), "w": c.numbers("b", size)}


def _coefficients(c: Cursor, dimension: int, nc: int) -> dict[str, Any]:
    if c.guess and dimension == 3 and nc == 0:
        raise c.error("nc", "is 0, expected contacts: without any, friction without rolling has this layout too")
    mu = c.numbers("mu", nc)
    if c.guess and dimension == 3 and nc == 1 and c.left and c.tokens[c.at] in ("0", "1"):
        raise c.error("mu_r", f"is a lone {c.tokens[c.at]}, which follows friction without rolling too")
    return {"mu": mu, "mu_r": c.numbers("mu_r", nc)}
