"""QP backends called through qpsolvers. What is known of each stands in `qpsolvers_backends.toml`."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import scipy.sparse as sp

from cpbench.formulations.programs import QP
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench_adapters.qp_backend import QPSolversBackend, table_spec
from cpbench_adapters.qp_standard_form import StandardForm
from cpbench_adapters.qp_tolerances import Settings

STORAGE = {"sparse": True, "dense": False, "either": None}


class TabledBackend(QPSolversBackend):
    """A backend as it stands in the table.

    Keys of a row are fields of `SolverSpec` (`requires` without qpsolvers), those of `QPBackend` (`storage` : sparse,
    the default, dense or either), and
    status, iterations : where its word for how it ended, and its count, are in the `extras` of qpsolvers.
    words : what its status numbers mean. limit : name of its iteration limit, where its word does not tell that it was
    reached. exactly_symmetric : whether it takes only a Q that is symmetric to the last bit.
    """

    def __init__(self, row: Mapping[str, Any]) -> None:
        self.row = dict(row)
        self.spec = table_spec(row, node="qp", requires=("qpsolvers", *row["requires"]))
        self.sparse = STORAGE[row.get("storage", "sparse")]
        self.bounds_as_rows, self.needs_inequality = (
            row.get(name, False) for name in ("bounds_as_rows", "needs_inequality")
        )
        self.claims = {word: Claim(claim) for word, claim in row["claims"].items()}

    def setup(self, problem: QP, budget: Budget, options: Any) -> StandardForm:
        form = super().setup(problem, budget, options)
        if not self.row.get("exactly_symmetric") or (form.P != form.P.T).nnz == 0:
            return form
        return dataclasses.replace(form, P=sp.csc_matrix(form.P + form.P.T) / 2)

    def status(self, solution: Any, settings: Settings) -> str:
        limit, words = self.row.get("limit"), self.row.get("words")
        if limit and not solution.found and solution.extras.get("iterations", 0) >= settings[limit]:
            return "iteration limit"
        word = str(_at(solution.extras, self.row["status"]))
        return word if words is None else words.get(word, f"status {word}")

    def counters(self, solution: Any) -> Mapping[str, int]:
        try:
            return {"iterations": int(_at(solution.extras, self.row["iterations"]))}
        except (KeyError, IndexError):  # it counts none, or has not begun
            return {}


def _at(value: Any, path: str) -> Any:
    """Return what is at a path of keys, numbers and attributes."""
    for part in path.split("."):
        if isinstance(value, Mapping):
            value = value[part]
        else:
            value = value[int(part)] if isinstance(value, list) else getattr(value, part)
    return value


def table(kind: str) -> list[dict[str, Any]]:
    """Return the rows of a kind: `backend`, or `licensed` for those of `qpsolvers_licences`."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))[kind]


for _row in table("backend"):
    solvers.add(_row["name"], TabledBackend(_row))
