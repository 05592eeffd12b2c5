"""Siconos text files (.dat): which problem stands in one, and writing them with all digits.

A file of Siconos carries no word of its kind. One is accepted when exactly one layout (`siconos_layouts`)
reads it to its last number (`Cursor.finish` says what may follow); its name and its folder are no
evidence. Two kinds cannot be detected: an AVI, whose polyhedron has no place in the file, is written like an LCP,
and rolling friction in the plane like plasticity of old. What we write ends with a line that names its format, which
Siconos does not read and we do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.formulations import (
    FrictionContact,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    RollingFrictionContact,
)
from cpbench.formulations.base import Problem
from cpbench.formulations.conic import SOCLCP
from cpbench.formulations.contact import ContactProblem, LocalContact
from cpbench.formulations.global_contact import GlobalContact
from cpbench.formulations.linear import AVI, LCP, MLCP, Relay
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.storage.base import Format, formats, no_member
from cpbench_problems.formats.siconos_layouts import (
    Builder,
    contact_reader,
    is_plasticity,
    read_avi,
    read_lcp,
    read_mlcp,
    read_mlcp_old,
    read_relay,
    read_soclcp,
)
from cpbench_problems.formats.siconos_matrix import SIGNED, Cursor


def write_lcp(p: LCP) -> str:
    """Write n, M, q."""
    n = p.q.size
    return f"{n}\n{text_matrix(p.M)}{text_rows(p.q, n or 1)}"


def write_mlcp(p: MLCP) -> str:
    """Write M with q, and A, B, C, D too where they are dense (Siconos' own solvers want both)."""
    n, m = p.a.size, p.b.size
    M, q = matrices.block([[p.A, p.C], [p.D, p.B]]), np.concatenate([p.a, p.b])
    dense = not matrices.is_sparse(M)
    ends = [0] + ([n] if n else []) + ([n + m] if m else [])
    kinds = (["0"] if n else []) + (["1"] if m else [])
    text = f"1\n{int(dense)}\n{n}\n{m}\n{' '.join(map(str, ends))} \n{' '.join(kinds)} \n{text_matrix(M)}"
    text += text_rows(q, n + m or 1)
    if dense:
        text += "".join(text_rows(matrices.dense(X).reshape(-1), X.shape[1] or 1) for X in (p.A, p.B, p.C, p.D))
        text += text_rows(p.a, n or 1) + text_rows(p.b, m or 1)
    return text


def write_avi(p: AVI) -> str:
    """Write n, M, q; refuse a set X, for which there is no place."""
    if not p.only_box or np.isfinite(p.lb).any() or np.isfinite(p.ub).any():
        raise FormatError(p.name or p.node, "", "has a set X: Siconos text has no place for it, .h5 has")
    n = p.q.size
    return f"{n}\n{text_matrix(p.M)}{text_rows(p.q, n or 1)}"


def write_relay(p: Relay) -> str:
    """Write n, M, q, lb, ub."""
    n = p.q.size
    return f"{n}\n{text_matrix(p.M)}{''.join(text_rows(x, n or 1) for x in (p.q, p.lb, p.ub))}"


def write_soclcp(p: SOCLCP) -> str:
    """Write n, nc, M, q, cone ends, tau; refuse cones that are not of second order."""
    other = (p.cone_kind != Cone.SECOND_ORDER) | ~np.isfinite(p.cone_mu)
    if other.any():
        i = int(np.flatnonzero(other)[0])
        kind = Cone(int(p.cone_kind[i])).name.lower()
        raise FormatError(
            p.name or p.node,
            f"cone_kind {i}",
            f"is {kind} with mu = {p.cone_mu[i]:g}: Siconos text has second-order cones with finite mu, .h5 has all",
        )
    n, nc = p.q.size, p.cone_size.size
    ends = " ".join(str(int(end)) for end in (0, *np.cumsum(p.cone_size)))
    return f"{n}\n{nc}\n{text_matrix(p.M)}{text_rows(p.q, n or 1)}{ends}\n{text_rows(p.cone_mu, nc or 1)}"


def write_fc(p: LocalContact) -> str:
    """Write d, nc, M, q, mu, and mu_r with rolling."""
    vectors = "".join(text_rows(x, x.size or 1) for x in (p.q, *_coefficients(p)))
    return f"{p.dimension}\n{p.nc}\n{text_matrix(p.W)}{vectors}"


def write_gfc(p: GlobalContact) -> str:
    """Write d, nc, M, H, q, b, mu, and mu_r with rolling; refuse joints, for which there is no place."""
    if p.b.size:
        raise FormatError(
            p.name or p.node, "G", f"has {p.b.size} bilateral constraints: Siconos text has no place for them, .h5 has"
        )
    vectors = "".join(text_rows(x, x.size or 1) for x in (p.f, p.w, *_coefficients(p)))
    return f"{p.dimension}\n{p.nc}\n{text_matrix(p.M)}{text_matrix(p.H)}{vectors}"


def _coefficients(p: ContactProblem) -> list[Vector]:
    return [getattr(p, name) for name in ("mu", "mu_r") if hasattr(p, name)]


def text_matrix(M: Matrix) -> str:
    """Write the matrix block of `M` with all its digits: dense, or a CSparse triplet."""
    rows, cols = M.shape
    if not matrices.is_sparse(M):
        body = text_rows(matrices.dense(M).T.reshape(-1), max(cols, 1))
        return f"0\n{rows}\n{cols}\n{rows}\t{cols}\n{body}"
    coo = sp.coo_array(M)
    entries = zip(coo.row.tolist(), coo.col.tolist(), coo.data.tolist(), strict=True)
    lines = "".join(f"    {i} {j} : {v!r}\n" for i, j, v in entries)
    heading = (
        f"CSparse triplet, written by cpbench\ntriplet: {rows}-by-{cols}, nzmax: {max(coo.nnz, 1)} nnz: {coo.nnz}\n"
    )
    return f"2\n{rows}\n{cols}\n1\n{heading}{lines}"


def text_rows(x: Vector, width: int) -> str:
    """Write numbers with all their digits, `width` to a line."""
    words = list(map(repr, x.tolist()))
    return "".join(" ".join(words[k : k + width]) + "\n" for k in range(0, len(words), width))


class SiconosText(Format):
    """One kind of problem in a .dat file.

    `dimension` is that of the problems, where they have one. `guessed`: whether a file may be of this kind without
    saying so. `also`: what else has this layout; a file that fits is then refused unless it or the caller says so.
    """

    suffixes = (".dat",)

    def __init__(
        self,
        kind: str,
        node: str,
        readers: tuple[Callable[[Cursor], Builder], ...],
        write: Callable[[Any], str],
        dimension: int | None = None,
        *,
        guessed: bool = True,
        also: str = "",
    ) -> None:
        # one class, many formats: what a Format declares on its class is set on the instance
        self.name = f"siconos-{kind.partition(',')[0].lower()}"  # type: ignore[misc]
        self.summary, self.writes = f"Siconos text: {kind}", frozenset({node})  # type: ignore[misc]
        self.readers, self._write, self.dimension = readers, write, dimension
        self.guessed, self.also = guessed, also

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.suffix.lower() == ".dat"

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        fitting, refusals = _attempt(Cursor(path), [self])
        if not fitting:
            raise max(refusals, key=lambda refusal: refusal[0])[2]
        return fitting[0][1]()

    def load_any(self, others: Sequence[Format], path: Path, member: str) -> Problem:
        no_member(path, member)
        kinds = [f for f in (self, *others) if isinstance(f, SiconosText)]
        c = Cursor(path, guess=True)
        signed = next((f for f in kinds if c.signature == f.name), None)
        if signed is not None:
            return signed.load(path, member)
        fitting, refusals = _attempt(c, [f for f in kinds if f.guessed])
        names = sorted({kind.name for kind, _ in fitting} | {kind.also for kind, _ in fitting if kind.also})
        if len(fitting) == 1 and len(names) == 1:
            return fitting[0][1]()
        if fitting:
            raise FormatError(path, "", f"fits the layouts of {' and '.join(names)}: say which with --format")
        if is_plasticity(c.again()):
            raise FormatError(path, "", "is a plasticity problem: no formulation of this version has it")
        _, name, cause = max(refusals, key=lambda refusal: refusal[0])
        raise FormatError(
            path, cause.field, f"{cause.cause} (no Siconos layout fits to its last number, nearest {name})"
        )

    def holds(self, problem: Problem) -> bool:
        return super().holds(problem) and getattr(problem, "dimension", None) == self.dimension

    def encode(self, problem: Problem, *, compress: bool) -> bytes:
        if getattr(problem, "dimension", None) != self.dimension:
            raise FormatError(problem.name or problem.node, "dimension", f"does not fit {self.name}")
        return f"{self._write(problem)}{SIGNED} {self.name}\n".encode("ascii")


def _attempt(
    c: Cursor, kinds: Sequence[SiconosText]
) -> tuple[list[tuple[SiconosText, Builder]], list[tuple[int, str, FormatError]]]:
    """Return the readers that come to the file's last number, and the refusals of the others with how far they came."""
    fitting: list[tuple[SiconosText, Builder]] = []
    refusals: list[tuple[int, str, FormatError]] = []
    for kind in kinds:
        for reader in kind.readers:
            attempt = c.again()
            try:
                fitting.append((kind, reader(attempt)))
            except FormatError as cause:
                refusals.append((attempt.at, kind.name, cause))
    return fitting, refusals


for _format in (
    SiconosText("LCP", "lcp", (read_lcp,), write_lcp),
    SiconosText("AVI, without its set", "avi", (read_avi,), write_avi, guessed=False),
    SiconosText("MLCP", "mlcp", (read_mlcp, read_mlcp_old), write_mlcp),
    SiconosText("relay", "relay", (read_relay,), write_relay),
    SiconosText("SOCLCP", "soclcp", (read_soclcp,), write_soclcp),
    *(SiconosText(f"FC{d}D, local", "fc", (contact_reader(FrictionContact, d),), write_fc, d) for d in (2, 3)),
    *(
        SiconosText(f"GFC{d}D, global", "gfc", (contact_reader(GlobalFrictionContact, d),), write_gfc, d)
        for d in (2, 3)
    ),
    SiconosText("RFC3D, local rolling", "rfc", (contact_reader(RollingFrictionContact, 5),), write_fc, 5),
    SiconosText(
        "RFC2D, local rolling",
        "rfc",
        (contact_reader(RollingFrictionContact, 3),),
        write_fc,
        3,
        also="plasticity as older files have it",
    ),
    *(
        SiconosText(
            f"GRFC{(d + 1) // 2}D, global rolling",
            "grfc",
            (contact_reader(GlobalRollingFrictionContact, d),),
            write_gfc,
            d,
        )
        for d in (3, 5)
    ),
):
    formats.add(_format.name, _format)
