"""Layouts of Siconos text: LCP, AVI, MLCP in two, relay, second-order cone LCP; those of contact stand below.

LCP, AVI   n  M  q[n]                      an AVI's polyhedron has no place in it
MLCP       st1 st2 n m; with st1: block ends up to n + m, block kinds (0 equality, 1 complementarity), M, q;
           with st2: A B C D row by row, a, b
MLCP, old  n m lines  A B C D a b, row by row
relay      n  M  q[n] lb[n] ub[n]
SOCLCP     n nc  M  q[n]  cone ends[nc + 1] from 0  tau[nc]     ‖x_T‖ ≤ tau x_N: tau is our cone_mu
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.formulations.conic import SOCLCP
from cpbench.formulations.linear import AVI, LCP, MLCP, Relay
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone
from cpbench.storage.base import build, stem
from cpbench_problems.formats.siconos_matrix import Cursor, read_matrix

logger = logging.getLogger("cpbench.storage")

Builder: TypeAlias = Callable[[], Problem]
"""A problem that was read to its last number; making it still checks its data (NaN, negative friction)."""


def builder(c: Cursor, cls: type[Problem], **parts: Any) -> Builder:
    return partial(build, c.path, cls, "", name=stem(c.path), **parts)


def read_lcp(c: Cursor) -> Builder:
    n = c.integer("n")
    M, q = read_matrix(c, "M", (n, n)), c.numbers("q", n)
    c.finish()
    return builder(c, LCP, M=M, q=q)


def read_avi(c: Cursor) -> Builder:
    n = c.integer("n")
    M, q = read_matrix(c, "M", (n, n)), c.numbers("q", n)
    c.finish()
    if not c.signature:
        logger.warning("%s: this layout has no place for the set X of an AVI: X is the whole space", c.path)
    return builder(c, AVI, M=M, q=q)


def read_relay(c: Cursor) -> Builder:
    n = c.integer("n")
    M = read_matrix(c, "M", (n, n))
    q, lb, ub = (c.numbers(name, n) for name in ("q", "lb", "ub"))
    c.finish()
    return builder(c, Relay, M=M, q=q, lb=lb, ub=ub)


def read_soclcp(c: Cursor) -> Builder:
    n, nc = c.integer("n"), c.integer("nc")
    M, q = read_matrix(c, "M", (n, n)), c.numbers("q", n)
    ends = c.integers("cone ends", nc + 1)
    if ends[0] != 0 or ends[-1] != n or (np.diff(ends) < 1).any():
        raise c.error("cone ends", f"do not rise from 0 to {n}")
    tau = c.numbers("tau", nc)
    c.finish()
    kind = np.full(nc, float(Cone.SECOND_ORDER))
    return builder(c, SOCLCP, M=M, q=q, cone_kind=kind, cone_size=np.diff(ends).astype(float), cone_mu=tau)


def read_mlcp(c: Cursor) -> Builder:
    """Read both layouts of today; M and (A, B, C, D) must agree where a file has both."""
    st1, st2, n, m = (c.integer(field) for field in ("st1", "st2", "n", "m"))
    if st1 > 1 or st2 > 1 or not st1 + st2:
        raise c.error("st1", f"and st2 are {st1} and {st2}, expected 0 or 1, one of them 1")
    parts: dict[str, Any] = {}
    if st1:
        parts = _by_blocks(c, n, m)
    if st2:
        other = _abcd(c, n, m)
        for field, value in parts.items():
            difference = matrices.max_abs(matrices.dense(value) - other[field])
            if difference > 0:
                raise c.error(field, f"differs from the one in M and q by {difference:g}, expected the same")
        parts = parts or other
    # some files end with a recorded answer, u (its first number lost), v and w
    c.finish(answers=(n + 2 * m - 1, n + 2 * m) if n + m else ())
    return builder(c, MLCP, **parts)


def read_mlcp_old(c: Cursor) -> Builder:
    n, m, lines = (c.integer(field) for field in ("n", "m", "lines"))
    if lines != n + m:
        raise c.error("M", f"has {lines} rows, expected {n + m} (n + m = {n} + {m})")
    parts = _abcd(c, n, m)
    c.finish()
    return builder(c, MLCP, **parts)


def _by_blocks(c: Cursor, n: int, m: int) -> dict[str, Any]:
    """Return A, B, C, D, a, b of M and q, whose blocks of equalities and complementarities may come in any order."""
    ends = [c.integer("blocks")]
    while ends[-1] < n + m:
        ends.append(c.integer("blocks"))
    kinds = c.integers("block kinds", len(ends) - 1)
    sizes = np.diff(ends)
    if ends[0] != 0 or ends[-1] != n + m or (sizes < 0).any() or (kinds > 1).any() or sizes[kinds == 0].sum() != n:
        raise c.error(
            "blocks", f"end at {ends} with kinds {kinds.tolist()}, expected {n} equalities, {m} complementarities"
        )
    M, q = read_matrix(c, "M", (n + m, n + m)), c.numbers("q", n + m)
    free = np.repeat(kinds == 0, sizes)
    e, i = np.flatnonzero(free), np.flatnonzero(~free)
    return {
        "A": M[np.ix_(e, e)],
        "B": M[np.ix_(i, i)],
        "C": M[np.ix_(e, i)],
        "D": M[np.ix_(i, e)],
        "a": q[e],
        "b": q[i],
    }


def _abcd(c: Cursor, n: int, m: int) -> dict[str, Any]:
    shapes = {"A": (n, n), "B": (m, m), "C": (n, m), "D": (m, n)}
    parts: dict[str, Any] = {name: c.numbers(name, r * k).reshape(r, k) for name, (r, k) in shapes.items()}
    return parts | {"a": c.numbers("a", n), "b": c.numbers("b", m)}


# -------------------------------------------------------------------------------------------------------------- contact
# Siconos text of contact problems; d rows a contact, normal first.
#
#     FC2D, FC3D      d nc  M  q  mu[nc]                          d = 2, 3
#     GFC2D, GFC3D    d nc  M  H  q[n] b[d nc] mu[nc]             our f and w
#     RFC2D, RFC3D    d nc  M  q  mu[nc] mu_r[nc]                 d = 3, 5: rolling
#     GRFC2D, GRFC3D  d nc  M  H  q[n] b[d nc] mu[nc] mu_r[nc]
#     plasticity      3 nc model  M  q  yield parameters; older files: 3 nc  M  q  eta[nc] theta[nc], as in RFC2D
#
# Only the count of numbers tells FC3D from RFC2D (and GFC3D from GRFC2D). Where that says nothing, a guess is on the
# side of FC3D: without contacts, and for one contact when the last number is a lone digit ('a guess follows').


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
