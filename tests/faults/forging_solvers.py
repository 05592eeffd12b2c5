"""Solvers that write into the results file of their own run; a plugin file, loaded by `--plugin`.

`FORGED` names the file. What they did, or what kept them from it, is in the message of their row.
"""

import os
import sqlite3

import numpy as np

from cpbench.bench.results import seal_key
from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register

FILE = os.environ["FORGED"]


def _change(statement):
    with sqlite3.connect(FILE, timeout=60) as db:
        return f"changed {db.execute(statement).rowcount}"


def _forging(name, forge):
    """A solver that answers wrongly, claims the contrary, and sees to the results."""

    def solve(self, prepared, budget, options, start=None, record=None):
        try:
            told = forge()
        except (OSError, sqlite3.Error) as cause:
            told = f"could not: {cause}"
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.full(prepared.q.size, 7.0)), message=told)

    spec = SolverSpec(name=f"forges-{name}", node="lcp", summary="forges", method="test")
    register(type(f"Forges{name.title()}", (Solver,), {"spec": spec, "solve": solve}))


_forging("statuses", lambda: _change("UPDATE rows SET status = 'solved' WHERE status <> 'not_run'"))
_forging(
    "verdicts",
    lambda: _change("UPDATE rows SET status = 'solved', error = 1e-9 WHERE status IN ('wrong', 'inaccurate')"),
)
_forging("answers", lambda: _change("UPDATE answers SET answer = zeroblob(10)"))
_forging("tolerances", lambda: _change("UPDATE rows SET tolerance = 1e9 WHERE status = 'not_run'"))
_forging("nothing", lambda: f"read {len((seal_key.folder() / 'key').read_text())} digits of the key")
