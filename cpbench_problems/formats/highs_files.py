"""Linear and quadratic programs in MPS, QPS and CPLEX's LP format, by the readers of HiGHS, in a process that may die.

What HiGHS warns of is refused with its words, for it means that something was left out or changed: a constant in a
row, a coefficient below 1e-12, a bound given twice. A maximum is the minimum of the opposite.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.formulations.base import Info, Problem
from cpbench.formulations.programs import QP
from cpbench.foundation.text import printable
from cpbench.storage.base import OFFSET, SENSE, UNKNOWNS, Format, build, formats, no_member, read_text, stem
from cpbench_problems.formats import two_sided
from cpbench_problems.formats.trial import require_survivor

_NAME = re.compile(r"^NAME[ \t]+(\S+)", re.MULTILINE)
"""The line of MPS."""
_TRIANGLE = re.compile(r"\A.*?(\n(QUADOBJ|QSECTION)[^\n]*\n|\Z)|\n\S.*", re.DOTALL)
"""What stands before and behind the lines of one triangle of Q."""
_LARGEST = 1 << 28
_SECONDS = 60.0


class _HighsFormat(Format):
    """Base of what HiGHS reads. Names of unknowns are kept."""

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.suffix.lower() in self.suffixes

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        if importlib.util.find_spec("highspy") is None:
            raise FormatError(path, "", "needs HiGHS to be read: pip install highspy (or cpbench[backends])")
        text = read_text(path)
        if len(text) > _LARGEST:
            raise FormatError(path, "", f"has {len(text) / 1e6:.0f} MB of text, at most {_LARGEST / 1e6:.0f} are read")
        self._require_clear(path, text)
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / f"problem{self.suffixes[0]}"  # HiGHS goes by the suffix
            copy.write_text(text, encoding="utf-8")
            require_survivor(path, lambda: _extract(copy), "HiGHS", _SECONDS)
            model = _found(path, copy)
        named = _NAME.search(text)  # HiGHS keeps none
        return _problem(path, named[1] if named else stem(path), model)

    def _require_clear(self, path: Path, text: str) -> None:
        """Raise FormatError where programs read a text differently, and HiGHS says nothing."""


class MPS(_HighsFormat):
    """Rows of type N beside the objective have no effect and are left out."""

    name = "mps"
    summary = "MPS and QPS: linear and quadratic programs, without integers and sets, by HiGHS"
    suffixes = (".mps", ".qps", ".sif")

    def _require_clear(self, path: Path, text: str) -> None:
        pairs = [frozenset(words.split()[:2]) for words in _TRIANGLE.sub("", text).splitlines()]
        if len(pairs) > len(set(pairs)):
            raise FormatError(path, "QUADOBJ", "has a product twice, or both triangles: expected one; QMATRIX has both")


class LP(_HighsFormat):
    """CPLEX's text, whose objective may have products in brackets."""

    name = "lp"
    summary = "LP format of CPLEX: linear and quadratic programs, without integers and sets, by HiGHS"
    suffixes = (".lp",)


def _extract(path: Path) -> None:
    """Read a file by HiGHS and write what it finds beside it: in a separate process, for HiGHS prints."""
    import highspy

    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    reader, log = highspy.Highs(), path.with_suffix(".log")
    reader.setOptionValue("log_to_console", False)
    reader.setOptionValue("log_file", os.fspath(log))
    reader.setOptionValue("small_matrix_value", 1e-12)  # the least that HiGHS allows
    status = reader.readModel(os.fspath(path))
    lines = [line.strip() for line in log.read_text("latin-1").splitlines()] if log.exists() else []
    printed = [line for line in lines if line and not line.startswith(("Running HiGHS", "Includes third", "|", "-->"))]
    words = " ".join(printed).replace(os.fspath(path), path.name)
    model = reader.getModel()
    lp, Q = model.lp_, model.hessian_
    names = list(lp.col_names_) or [f"x{j + 1}" for j in range(lp.num_col_)]
    header = {
        "complaint": "" if status == highspy.HighsStatus.kOk else words or f"status {status.name}",
        "names": names,
        "kinds": [kind.name for kind in lp.integrality_],
        "maximize": lp.sense_ == highspy.ObjSense.kMaximize,
        "offset": lp.offset_,
        "by_columns": lp.a_matrix_.format_ == highspy.MatrixFormat.kColwise,
    }
    arrays = {
        "cost": lp.col_cost_,
        **{f"columns.{side}": getattr(lp, f"col_{side}_") for side in ("lower", "upper")},
        **{f"rows.{side}": getattr(lp, f"row_{side}_") for side in ("lower", "upper")},
        **{f"A.{part}": getattr(lp.a_matrix_, f"{part}_") for part in ("value", "index", "start")},
        **{f"Q.{part}": getattr(Q, f"{part}_") for part in ("value", "index", "start")},
    }
    np.savez(path.with_suffix(".npz"), **{name: np.asarray(array) for name, array in arrays.items()})
    path.with_suffix(".json").write_text(json.dumps(header))


def _found(path: Path, copy: Path) -> dict[str, Any]:
    """Return what `_extract` has written; raises FormatError where that is not the whole problem."""
    try:
        model: dict[str, Any] = json.loads(copy.with_suffix(".json").read_text())
        with np.load(copy.with_suffix(".npz"), allow_pickle=False) as arrays:
            model |= {name: arrays[name] for name in arrays.files}
    except (OSError, ValueError):
        raise FormatError(path, "", "is no program: HiGHS stops when it reads the file") from None
    if model["complaint"]:
        text = printable(model["complaint"][:300])
        raise FormatError(path, "", f"is no program that HiGHS reads whole: {text}")
    for name, kind in zip(model["names"], model["kinds"], strict=False):
        if kind != "kContinuous":
            what = {"kInteger": "integer", "kSemiContinuous": "semi-continuous"}.get(kind, kind)
            raise FormatError(path, printable(name[:60]), f"is an unknown of the kind {what}: no formulation has them")
    return model


def _problem(path: Path, name: str, model: dict[str, Any]) -> Problem:
    n, m = model["cost"].size, model["rows.lower"].size
    if n == 0:
        raise FormatError(path, "", "has no unknowns, expected a linear or quadratic program")
    A = _compressed(model, "A", (m, n), by_columns=model["by_columns"])
    L = _compressed(model, "Q", (n, n), by_columns=True) if model["Q.value"].size else sp.csr_array((n, n))
    sides, bounds = ((model[f"{part}.lower"], model[f"{part}.upper"]) for part in ("rows", "columns"))
    lower, upper = map(two_sided.infinite, sides)
    lb, ub = map(two_sided.infinite, bounds)
    if (doubtful := np.flatnonzero((lb == 0.0) & (ub < 0.0))).size:
        j = doubtful[0]
        cause = f"has the bounds 0 and {ub[j]:g}: an upper bound below 0 alone means no lower one to some readers"
        raise FormatError(path, printable(model["names"][j][:60]), f"{cause}; write LO or MI, too")
    two_sided.require_sides(path, lower, upper, "A")
    sign, sense = (-1.0, {SENSE: "max"}) if model["maximize"] else (1.0, {})
    properties = ({OFFSET: sign * model["offset"]} if model["offset"] else {}) | sense | {UNKNOWNS: model["names"]}
    return build(
        path,
        QP,
        "",
        name=name,
        info=Info(properties=properties),
        Q=sign * sp.csr_array(L + sp.tril(L, -1).T),
        p=sign * model["cost"],
        **two_sided.uncrossed({"lb": lb, "ub": ub, **two_sided.rows(A, lower, upper)}),
    )


def _compressed(model: dict[str, Any], name: str, shape: tuple[int, int], *, by_columns: bool) -> sp.csr_array:
    """Return a matrix of HiGHS by rows."""
    value, index, start = (model[f"{name}.{part}"] for part in ("value", "index", "start"))
    kept = int(start[-1]) if start.size else 0
    triple: Any = (value[:kept].astype(float), index[:kept].astype(int), start.astype(int))
    return sp.csr_array((sp.csc_array if by_columns else sp.csr_array)(triple, shape=shape))


formats.add("lp", LP())
formats.add("mps", MPS())
