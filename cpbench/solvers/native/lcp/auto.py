"""Automatic choice on LCPs: pivoting where it is quick, faces and Newton where M is large and sparse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from cpbench.formulations.lcp import LCP
from cpbench.matrices import is_sparse, nnz
from cpbench.solvers.base import SolverSpec, register
from cpbench.solvers.native.automatic import AutomaticChoice, Phase, automatic_spec

SMALL = 200
"""Up to this many unknowns Lemke's method is done before others have factored M_FF a few times."""
LARGE = 2000
"""Beyond, what takes M apart in dense storage is asked last."""
FEW = 0.1
"""A larger share of nonzeros counts as dense."""
STEPS = 2000
"""Of conjugate gradients on faces, a product with M each, before Newton's method is asked."""


@register
class AutoLCP(AutomaticChoice):
    """Lemke's method on small problems and block principal pivoting on larger ones, then Newton's on equations whose
    stationary points lie elsewhere; conjugate gradients first where M is large, sparse and symmetric.

    Of at most 20 unknowns, all complementary bases are tried in the end: a solution is found if there is one.
    """

    spec: ClassVar[SolverSpec] = automatic_spec(
        "lcp", "auto-lcp", "Lemke, block pivoting, conjugate gradients or Newton, by size and structure"
    )
    members: ClassVar[tuple[str, ...]] = (
        "lemke",
        "bpp",
        "projected-cg",
        "newton-min",
        "newton-fb",
        "newton-pfb",
        "lcp-enumeration",
    )
    kernels: ClassVar[tuple[str, ...]] = ("pivoting", "lemke_judged", "mprgp", "complementary_bases")

    def phases(self, problem: LCP) -> Sequence[Phase]:
        n = problem.q.size
        newton = [Phase("newton-min"), Phase("newton-fb"), Phase("newton-pfb")]
        if n > LARGE and is_sparse(problem.M) and nnz(problem.M) < FEW * n * n:
            faces = [Phase("projected-cg", STEPS)] if problem.symmetric else []
            return [*faces, *newton, Phase("projected-cg"), Phase("bpp"), Phase("lemke")]
        if n <= SMALL:
            return [Phase("lemke"), *newton, Phase("lcp-enumeration")]
        bordered = [Phase("bpp")] if bool(np.all(problem.M.diagonal() > 0)) else []
        return [*bordered, Phase("newton-min"), Phase("lemke"), *newton[1:]]
