"""Models whose pairs leave rows and variables over: complementarity problems where the rest is square, else MPCCs."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from cpbench.foundation.text import counted, some_of
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
