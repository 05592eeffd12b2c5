"""Siconos text files (.dat): which problem stands in one, and writing them.

    LCP          n  M  q[n]
    MLCP         st1 st2 n m; with st1: block ends up to n + m, block kinds (0 equality, 1 complementarity), M, q;
                 with st2: A B C D row by row, a, b
    MLCP, old    n m lines  A B C D a b, row by row
    FC2D, FC3D   d nc  M  q  mu[nc]
    GFC2D, GFC3D d nc  M  H  q[n] b[d nc] mu[nc]      (our f and w)

A file carries no word of its kind. One is accepted when exactly one of these layouts reads it to its last number
(`Cursor.finish` says what may follow); its name and its folder are no evidence. An AVI without polyhedron is
written like an LCP and cannot be told from it. Layouts of other problems are known only to say why they are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from cpbench import matrices
from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.lcp import LCP
from cpbench.formulations.mlcp import MLCP
from cpbench.storage.base import Format, build, formats, no_member, stem
from cpbench.storage.siconos_matrix import Cursor, read_matrix
from cpbench.storage.siconos_write import write_fc, write_gfc, write_lcp, write_mlcp

Made: TypeAlias = Callable[[], Problem]
"""A problem that was read to its last number; making it still checks its data (NaN, negative friction)."""


def read_lcp(c: Cursor) -> Made:
    n = c.integer("n")
    M, q = read_matrix(c, "M", (n, n)), c.numbers("q", n)
    c.finish()
    return partial(build, c.path, LCP, "", name=stem(c.path), M=M, q=q)


def read_mlcp(c: Cursor) -> Made:
    """Both layouts of today; M and (A, B, C, D) must agree where a file has both."""
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
    return partial(build, c.path, MLCP, "", name=stem(c.path), **parts)


def read_mlcp_old(c: Cursor) -> Made:
    n, m, lines = (c.integer(field) for field in ("n", "m", "lines"))
    if lines != n + m:
        raise c.error("M", f"has {lines} rows, expected {n + m} (n + m = {n} + {m})")
    parts = _abcd(c, n, m)
    c.finish()
    return partial(build, c.path, MLCP, "", name=stem(c.path), **parts)


def contact_reader(dimension: int) -> Callable[[Cursor], Made]:
    def read(c: Cursor) -> Made:
        size, nc = _contact_heading(c, dimension)
        W, q, mu = read_matrix(c, "M", (size, size)), c.numbers("q", size), c.numbers("mu", nc)
        c.finish(flag=True)
        return partial(build, c.path, FrictionContact, "", name=stem(c.path), W=W, q=q, mu=mu, dimension=dimension)

    return read


def global_reader(dimension: int) -> Callable[[Cursor], Made]:
    def read(c: Cursor) -> Made:
        size, nc = _contact_heading(c, dimension)
        M = read_matrix(c, "M", None)
        n = M.shape[0]
        H = read_matrix(c, "H", (n, size))
        f, w, mu = c.numbers("q", n), c.numbers("b", size), c.numbers("mu", nc)
        c.finish(flag=True)
        parts = {"M": M, "H": H, "f": f, "w": w, "mu": mu, "dimension": dimension}
        return partial(build, c.path, GlobalFrictionContact, "", name=stem(c.path), **parts)

    return read


class SiconosText(Format):
    """One kind of problem in a .dat file."""

    suffixes = (".dat",)

    def __init__(
        self,
        name: str,
        summary: str,
        node: str,
        readers: tuple[Callable[[Cursor], Made], ...],
        write: Callable[[Any], str],
    ) -> None:
        # one class, six formats: what a Format declares on its class is set on the instance
        self.name, self.summary, self.writes = name, summary, frozenset({node})  # type: ignore[misc]
        self.readers, self._write = readers, write

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.suffix.lower() == ".dat"

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        found, refusals = _attempt(path, [self])
        if not found:
            raise max(refusals, key=lambda refusal: refusal[0])[2]
        return found[0][1]()

    def load_any(self, others: Sequence[Format], path: Path, member: str) -> Problem:
        no_member(path, member)
        kinds = [f for f in (self, *others) if isinstance(f, SiconosText)]
        found, refusals = _attempt(path, kinds)
        if len(found) == 1:
            return found[0][1]()
        if found:
            names = " and ".join(sorted({name for name, _ in found}))
            raise FormatError(path, "", f"fits the layouts of {names}: say which with --format")
        from cpbench.storage.siconos_others import recognise

        other = recognise(path)
        if other:
            raise FormatError(path, "", f"is {other}: no formulation of this version has it")
        _, name, cause = max(refusals, key=lambda refusal: refusal[0])
        raise FormatError(
            path, cause.field, f"{cause.cause} (no Siconos layout fits to its last number, nearest {name})"
        )

    def encode(self, problem: Problem, *, compress: bool) -> bytes:
        if getattr(problem, "dimension", None) not in (None, int(self.name[-2]) if self.name[-1] == "d" else None):
            raise FormatError(problem.name or problem.node, "dimension", f"does not fit {self.name}")
        return self._write(problem).encode("ascii")


def _attempt(
    path: Path, kinds: Sequence[SiconosText]
) -> tuple[list[tuple[str, Made]], list[tuple[int, str, FormatError]]]:
    """What reads the file to its last number, and the refusals of the others with how far they came."""
    tokens = Cursor(path).tokens
    found: list[tuple[str, Made]] = []
    refusals: list[tuple[int, str, FormatError]] = []
    for kind in kinds:
        for reader in kind.readers:
            c = Cursor(path, tokens)
            try:
                found.append((kind.name, reader(c)))
            except FormatError as cause:
                refusals.append((c.at, kind.name, cause))
    return found, refusals


def _contact_heading(c: Cursor, dimension: int) -> tuple[int, int]:
    d = c.integer("d")
    if d != dimension:
        raise c.error("d", f"is {d}, expected {dimension}")
    nc = c.integer("nc")
    return d * nc, nc


def _by_blocks(c: Cursor, n: int, m: int) -> dict[str, Any]:
    """A, B, C, D, a, b from M and q, whose blocks of equalities and complementarities may come in any order."""
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


for _format in (
    SiconosText("siconos-lcp", "Siconos text: LCP", "lcp", (read_lcp,), write_lcp),
    SiconosText("siconos-mlcp", "Siconos text: MLCP", "mlcp", (read_mlcp, read_mlcp_old), write_mlcp),
    *(
        SiconosText(f"siconos-fc{d}d", f"Siconos text: FC{d}D, local", "fc", (contact_reader(d),), write_fc)
        for d in (2, 3)
    ),
    *(
        SiconosText(f"siconos-gfc{d}d", f"Siconos text: GFC{d}D, global", "gfc", (global_reader(d),), write_gfc)
        for d in (2, 3)
    ),
):
    formats.add(_format.name, _format)
