"""Linear and quadratic programs in the LP format of CPLEX, by the reader of HiGHS, in a process that may die.

What HiGHS warns of is refused with its words, for it means that something was left out or changed: a constant in a
row, a coefficient below 1e-12.
"""

from __future__ import annotations

import importlib.util
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.formulations.base import Info, Problem
from cpbench.formulations.qp import QP
from cpbench.plain_text import printable
from cpbench.storage.base import Format, build, formats, no_member, read_text, stem
from cpbench.storage.mps import noted, program
from cpbench.storage.trial import require_survivor

_LARGEST = 1 << 28
_SECONDS = 60.0


class LP(Format):
    """Needs highspy. Names of unknowns are kept."""

    name = "lp"
    summary = "LP format of CPLEX: linear and quadratic programs, without integers and sets, by HiGHS"
    suffixes = (".lp",)
    text = True

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.suffix.lower() in self.suffixes

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        if importlib.util.find_spec("highspy") is None:
            raise FormatError(path, "", "needs HiGHS to be read: pip install highspy (or cpbench[backends])")
        text = read_text(path)
        if len(text) > _LARGEST:
            raise FormatError(path, "", f"has {len(text) / 1e6:.0f} MB of text, at most {_LARGEST / 1e6:.0f} are read")
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "problem.lp"  # HiGHS goes by the suffix
            copy.write_text(text, encoding="latin-1")
            require_survivor(path, lambda: _model(copy), "HiGHS", _SECONDS)
            model, complaint = _model(copy)
        if model is None or complaint:
            raise FormatError(path, "", f"is no program that HiGHS reads whole: {complaint}")
        return _problem(path, model)


def _model(path: Path) -> tuple[Any, str]:
    """Return the model of HiGHS, None where it reads none, and what it says of it in one line."""
    import highspy

    reader, log = highspy.Highs(), path.with_suffix(".log")
    log.unlink(missing_ok=True)
    reader.setOptionValue("output_flag", False)  # else it greets
    reader.setOptionValue("log_to_console", False)
    reader.setOptionValue("log_file", os.fspath(log))
    reader.setOptionValue("output_flag", True)
    reader.setOptionValue("small_matrix_value", 1e-12)  # the least that HiGHS allows
    status = reader.readModel(os.fspath(path))
    model = None if status == highspy.HighsStatus.kError else reader.getModel()
    if status == highspy.HighsStatus.kOk:
        return model, ""
    lines = [line.strip() for line in log.read_text("latin-1").splitlines()] if log.exists() else []
    told = [line for line in lines if line and not line.startswith(("Running HiGHS", "Includes third", "|", "-->"))]
    text = " ".join(told).replace(os.fspath(path), path.name)
    return model, printable(text[:300]) or f"status {status.name}"


def _problem(path: Path, model: Any) -> Problem:
    import highspy

    lp = model.lp_
    names = list(lp.col_names_) or [f"x{j + 1}" for j in range(lp.num_col_)]
    for name, kind in zip(names, lp.integrality_, strict=False):
        if kind != highspy.HighsVarType.kContinuous:
            what = {"kInteger": "integer", "kSemiContinuous": "semi-continuous"}.get(kind.name, kind.name)
            raise FormatError(path, printable(name), f"is an unknown of the kind {what}: no formulation has them")
    by_columns = lp.a_matrix_.format_ == highspy.MatrixFormat.kColwise
    A = _compressed(lp.a_matrix_, (lp.num_row_, lp.num_col_), by_columns=by_columns)
    n = lp.num_col_
    L = _compressed(model.hessian_, (n, n), by_columns=True) if model.hessian_.dim_ else sp.csr_array((n, n))
    maximize = lp.sense_ == highspy.ObjSense.kMaximize
    parts = program(
        path,
        sp.csr_array(L + sp.tril(L, -1).T),
        np.array(lp.col_cost_, float),
        A,
        (np.array(lp.row_lower_, float), np.array(lp.row_upper_, float)),
        (np.array(lp.col_lower_, float), np.array(lp.col_upper_, float)),
        maximize=maximize,
    )
    info = Info(properties=noted(lp.offset_, maximize, names))
    return build(path, QP, "", name=stem(path), info=info, **parts)


def _compressed(matrix: Any, shape: tuple[int, int], *, by_columns: bool) -> sp.csr_array:
    """Return a matrix of HiGHS by rows."""
    triple: Any = (np.array(matrix.value_, float), np.array(matrix.index_, int), np.array(matrix.start_, int))
    kept = int(triple[2][-1]) if triple[2].size else 0
    triple = (triple[0][:kept], triple[1][:kept], triple[2])
    return sp.csr_array((sp.csc_array if by_columns else sp.csr_array)(triple, shape=shape))


formats.add("lp", LP())
