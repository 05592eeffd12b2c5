"""Which models with pairs are square complementarity problems, and which of their equations no variables match."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import maximum_bipartite_matching

from cpbench.formulations.base import Problem
from cpbench.formulations.expressions.derivatives import derivative
from cpbench.formulations.linear import AVI, MLCP
from cpbench.formulations.nonlinear import MiCP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Sparse
from cpbench.foundation.text import counted, some_of
from cpbench.storage.base import unknowns
from cpbench_problems.formats.mof_functions import Affine
from cpbench_problems.formats.mof_model import Model, slack

_SHOWN = 3


def squared(model: Model, objective: str) -> tuple[Model, str]:
    """Return the complementarity problem that a model with pairs is, and that its `objective` (as the file has it) is
    left out for it, "" where there is none.

    Equations without a variable stand beside the free variables without a row, in their order; which beside which
    changes no solution. A fixed variable without a row needs none. An objective is left out where nothing is free to
    choose.

    Raises FormatError where a choice remains: where the rest is not square, a row is an inequality or such a variable
    has bounds. That is a mathematical program with complementarity constraints (MPCC).
    """
    alone = [k for k in range(len(model.names)) if k not in model.pairs]
    fixed = [k for k in alone if model.lb[k] == model.ub[k]]
    free = [k for k in alone if np.isinf(model.lb[k]) and np.isinf(model.ub[k])]
    bounded = len(alone) - len(fixed) - len(free)
    if model.above or bounded or len(free) != len(model.equal):
        raise model.refused("", _refusal(model, [k for k in alone if k not in fixed], bounded))
    pairs = dict(model.pairs)
    pairs |= {k: slack(model.functions, row) for k, row in zip(free, model.equal, strict=True)}
    pairs |= {k: Affine([], [], 0.0) for k in fixed}
    left_out = ""
    if model.sense != "feasibility":
        left_out = f"the objective ({objective}) is left out: pairs and equations are as many as the variables"
    square = dataclasses.replace(model, pairs=pairs, equal=[], sense="feasibility", objective=None, complementary=True)
    return square, left_out


def _refusal(model: Model, alone: Sequence[int], bounded: int) -> str:
    rest = counted(len(model.equal), "equation")
    if model.above:
        rest += f" and {counted(len(model.above), 'inequality', 'inequalities')}"
    named = f" ({some_of([model.names[k] for k in alone], _SHOWN)})" if alone else ""
    those = f", {bounded} of them with bounds" if bounded else ""
    todo = "cpbench has no such formulation"
    if not model.above and len(alone) > len(model.equal):
        todo += f": fix {len(alone) - len(model.equal)} of these variables for a complementarity problem"
    return (
        f"is an MPCC (a mathematical program with complementarity constraints), not a square complementarity problem: "
        f"beside {counted(len(model.pairs), 'pair')} there are {rest} for "
        f"{counted(len(alone), 'variable')}{named}{those}; {todo}"
    )


def unmatched(problem: Problem) -> str:
    """Return which equations of a complementarity problem have fewer variables than they are, or which free variables
    are in fewer functions, "" where there are none: by a largest matching of the places of entries, before any solve.

    Equations are the functions beside free variables; beside others a function may be 0 or not.
    """
    if isinstance(problem, MLCP):
        n, entries = problem.a.size, matrices.sparse(matrices.block([[problem.A, problem.C], [problem.D, problem.B]]))
        free = np.arange(entries.shape[0]) < n
    elif isinstance(problem, AVI | MiCP):
        free = np.isinf(problem.lb) & np.isinf(problem.ub)
        if not free.any():
            return ""
        if isinstance(problem, AVI):
            entries = matrices.sparse(problem.M)
        else:
            _, indices, indptr = derivative(problem.F)
            size = (len(indptr) - 1,) * 2
            entries = sp.csr_array((np.ones(len(indices)), np.array(indices), np.array(indptr)), shape=size)
    else:
        return ""
    names = list(unknowns(problem.info)) or [f"z[{k}]" for k in range(free.size)]
    at = np.flatnonzero(free)
    for lines, what, where, few in (
        (entries[at], "equation", "beside ", "variable"),
        (sp.csr_array(entries.T)[at], "free variable", "", "function"),
    ):
        rows, columns = _too_few(sp.csr_array(lines))
        if rows:
            shown = f"{where}{some_of([names[at[k]] for k in rows], _SHOWN)}"
            within = f" ({some_of([names[k] for k in columns], _SHOWN)})" if columns else ""
            text = f"{counted(len(rows), what)} ({shown}) with {counted(len(columns), few)} between them{within}"
            return f"structurally singular: {text}"
    return ""


def _too_few(lines: Sparse) -> tuple[list[int], list[int]]:
    """Return rows that have fewer columns between them than they are, and these columns: what alternating paths reach
    from a row that a largest matching leaves out; nothing where all are matched."""
    lines.eliminate_zeros()
    match = maximum_bipartite_matching(sp.csr_matrix(lines), perm_type="column")
    beside = {column: row for row, column in enumerate(match.tolist()) if column >= 0}
    rows = np.flatnonzero(match < 0).tolist()[:1]
    columns = dict[int, None]()
    for row in rows:  # which grows
        for column in lines.indices[lines.indptr[row] : lines.indptr[row + 1]].tolist():
            if column not in columns:
                columns[column] = None
                rows.append(beside[column])
    return sorted(rows), sorted(columns)
