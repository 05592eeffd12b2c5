"""What the commands about conversions share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from cpbench import matrices
from cpbench.conversions import Conversion
from cpbench.formulations import Kind, Problem
from cpbench.graph import ALL, EXACT, Apply


def _kinds(_: click.Context, __: click.Parameter, value: str) -> frozenset[Kind]:
    return EXACT if value == "exact" else ALL


def kinds_option(f: Callable[..., Any], default: str = "exact") -> Callable[..., Any]:
    """`--routes exact|all` as a set of kinds, in the argument `kinds`."""
    return click.option(
        "--routes",
        "kinds",
        type=click.Choice(["exact", "all"]),
        default=default,
        show_default=True,
        callback=_kinds,
        help="all: approximate, relaxed and merely necessary conversions too.",
    )(f)


def sizes_line(problem: Problem) -> str:
    """`n = 20, m = 3, 61 nonzeros`."""
    sizes = ", ".join(f"{symbol} = {size}" for symbol, size in problem.sizes().items())
    nonzeros = sum(matrices.nnz(v) for v in problem.data().values() if v.ndim == 2)
    operations = sum(F.operations for F in problem.maps().values())
    return f"{sizes}, {nonzeros} nonzeros" + (f", {operations} operations" if problem.maps() else "")


def size_after(problem: Problem, edge: Conversion, apply: Apply) -> str:
    """What `edge` makes of `problem`: predicted where the edge can (~, at most), else measured by converting."""
    foreseen = edge.predict(problem)
    return sizes_line(apply(edge, problem)) if foreseen is None else f"~ {foreseen}"
