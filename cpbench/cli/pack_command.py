"""`cpbench pack`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from cpbench import matrices, storage
from cpbench.cli.options import force_option
from cpbench.cli.routes import sizes_line
from cpbench.errors import ProblemError
from cpbench.formulations import LCP, MLCP, QP, FrictionContact, GlobalFrictionContact, Problem

_FILE = click.Path(path_type=Path)


@click.command()
@click.argument("output", type=_FILE)
@click.option("--lcp", nargs=2, type=_FILE, metavar="M q", help="0 <= z _|_ Mz + q >= 0")
@click.option("--mlcp", nargs=6, type=_FILE, metavar="A B C D a b", help="Au + Cv + a = 0, 0 <= v _|_ Du + Bv + b >= 0")
@click.option("--qp", nargs=2, type=_FILE, metavar="Q p", help="min 1/2 z'Qz + p'z")
@click.option("--inequality", nargs=2, type=_FILE, metavar="A b", help="with --qp: Az >= b")
@click.option("--equality", nargs=2, type=_FILE, metavar="C d", help="with --qp: Cz = d")
@click.option("--bounds", nargs=2, type=_FILE, metavar="lb ub", help="with --qp: lb <= z <= ub")
@click.option("--fc", nargs=3, type=_FILE, metavar="W q mu", help="frictional contact, local")
@click.option("--gfc", nargs=5, type=_FILE, metavar="M H f w mu", help="frictional contact, global")
@click.option(
    "--axes",
    type=click.Choice(["NTT", "TTN", "NT", "TN"]),
    default=None,
    help="Order of the rows of a contact (default: normal first).",
)
@click.option("--name", default="", help="Name of the problem (default: name of the file).")
@force_option
def command(output: Path, name: str, force: bool, axes: str | None, **given: Any) -> None:
    """Make a problem file from matrices and vectors in .npy, .npz, .mtx or .csv files."""
    kinds = [k for k in ("lcp", "mlcp", "qp", "fc", "gfc") if given[k]]
    if len(kinds) != 1:
        raise click.UsageError("give exactly one of --lcp, --mlcp, --qp, --fc, --gfc")
    problem = _BUILD[kinds[0]](given, axes, name or output.stem)
    storage.save(problem, output, force=force)
    click.echo(f"{output} ({problem.node}: {sizes_line(problem)})")


def _lcp(given: dict[str, Any], axes: str | None, name: str) -> Problem:
    M, q = given["lcp"]
    return LCP(M=storage.read_matrix(M), q=storage.read_vector(q), name=name)


def _mlcp(given: dict[str, Any], axes: str | None, name: str) -> Problem:
    *blocks, a, b = given["mlcp"]
    A, B, C, D = (storage.read_matrix(path) for path in blocks)
    return MLCP(A=A, B=B, C=C, D=D, a=storage.read_vector(a), b=storage.read_vector(b), name=name)


def _qp(given: dict[str, Any], axes: str | None, name: str) -> Problem:
    Q, p = given["qp"]
    parts: dict[str, Any] = {}
    for option, matrix, vector in (("inequality", "A", "b"), ("equality", "C", "d")):
        if given[option]:
            parts[matrix] = storage.read_matrix(given[option][0])
            parts[vector] = storage.read_vector(given[option][1])
    if given["bounds"]:
        parts["lb"], parts["ub"] = (storage.read_vector(path) for path in given["bounds"])
    return QP.build(storage.read_matrix(Q), storage.read_vector(p), name=name, **parts)


def _fc(given: dict[str, Any], axes: str | None, name: str) -> Problem:
    W, q, mu = (read(path) for read, path in zip(_MATRIX_VECTOR_VECTOR, given["fc"], strict=True))
    d = _dimension("fc", q.size, mu.size)
    order = _order(axes, d, mu.size)
    return FrictionContact(W=W[order][:, order], q=q[order], mu=mu, dimension=d, name=name)


def _gfc(given: dict[str, Any], axes: str | None, name: str) -> Problem:
    M, H, f, w, mu = given["gfc"]
    w, mu = storage.read_vector(w), storage.read_vector(mu)
    d = _dimension("gfc", w.size, mu.size)
    order = _order(axes, d, mu.size)
    H = storage.read_matrix(H)
    H = matrices.sparse(H)[:, order] if matrices.is_sparse(H) else H[:, order]
    f = storage.read_vector(f)
    return GlobalFrictionContact(M=storage.read_matrix(M), H=H, f=f, w=w[order], mu=mu, dimension=d, name=name)


_MATRIX_VECTOR_VECTOR = (storage.read_matrix, storage.read_vector, storage.read_vector)
_BUILD = {"lcp": _lcp, "mlcp": _mlcp, "qp": _qp, "fc": _fc, "gfc": _gfc}


def _dimension(node: str, rows: int, nc: int) -> int:
    if nc == 0 or rows % nc or rows // nc not in (2, 3):
        raise ProblemError(f"{node}.mu", f"has {nc} contacts for {rows} rows; there must be 2 or 3 rows a contact")
    return rows // nc


def _order(axes: str | None, d: int, nc: int) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Row numbers that put the normal first."""
    if axes is not None and len(axes) != d:
        raise ProblemError("axes", f"'{axes}' names {len(axes)} rows a contact, the data have {d}")
    within = np.roll(np.arange(d), 1) if axes and axes.endswith("N") else np.arange(d)
    return (np.arange(nc)[:, None] * d + within).ravel()
