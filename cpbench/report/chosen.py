"""The rows that a figure of a run is about: one group of a results file, and the solvers that were asked for.

What is left open is settled where there is one value only, and asked for where there are several; the number of
problems N is that of the group, whichever solvers are shown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.metrics import MetricValues, measured, metric
from cpbench.analysis.participation import participating
from cpbench.errors import CpbenchError, UnknownName
from cpbench.report.figure_kinds import Drawing
from cpbench.report.run import Run
from cpbench.report.text import counted, listed_plainly, one_line, seconds

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIELDS = {"node": "formulations", "set": "sets", "start": "starts", "measure": "measures", "threads": "thread counts"}


@dataclass(frozen=True)
class Choice:
    """Requested rows; '' (0, NaN) accepts any value. `solvers` and `families` may have * and ?."""

    node: str = ""
    solvers: tuple[str, ...] = ()
    families: tuple[str, ...] = ()
    tolerance: float = math.nan
    start: str = ""
    set: str = ""
    measure: str = ""
    threads: int = 0


@dataclass(frozen=True)
class SelectedRows:
    """Rows of the solvers shown, of `problems` problems of a formulation at one tolerance.

    Attributes
    ----------
    kinds : route kind of each label. line_styles : of every label of the file, whatever is shown.
    """

    rows: pd.DataFrame
    histories: pd.DataFrame
    node: str
    tolerance: float
    problems: int
    line_styles: Mapping[str, int]

    @property
    def kinds(self) -> dict[str, str]:
        return rows_of.label_kinds(self.rows)

    def measured(self, name: str) -> tuple[MetricValues, str]:
        """Return a metric of the labels, and a sentence on the labels left out, '' when there is none."""
        values = measured(self.rows, metric(name, self.rows))
        if not values.left_out:
            return values, ""
        return values, f" Left out: no {values.metric.name} of {listed_plainly(list(values.left_out))}."

    @property
    def starts(self) -> str:
        """The starts of the rows as text; '' where they are not recorded."""
        names = sorted({one_line(start) for start in self.rows["start"]} - {""})
        return f"start{'s' * (len(names) > 1)} {', '.join(names)}" if names else ""

    def scope(self, *more: str) -> str:
        """Return the end of a title: what, how many, tolerance, start."""
        of = counted(self.problems, "problem")
        return ", ".join(
            filter(None, (f"{one_line(self.node)}: {of}", f"tolerance {self.tolerance:g}", self.starts, *more))
        )

    def conditions(self) -> str:
        """Return the end of every guide: N, tolerance, limit, start and what counts as solved."""
        most = rows_of.limit(self.rows)
        limit = f"{seconds(most)} a solve" if math.isfinite(most) else "none"
        return (
            f"N = {counted(self.problems, 'problem')} of {one_line(self.node)}; tolerance {self.tolerance:g}; "
            f"limit {limit}; {self.starts or 'start not recorded'}. Solved: the error that we measure on the problem "
            "asked for is at most the tolerance, whatever the solver says."
        )

    def drawing(self, figure: Figure, title: str, guide: str) -> Drawing:
        """Return a figure with its words and its scope; no character of them starts a formula."""
        words = (title, f"{guide} {self.conditions()}", self.scope())
        return Drawing(figure, *(one_line(text).replace("$", r"\$") for text in words))


def choose(run: Run, choice: Choice) -> SelectedRows:
    """Select the rows; raises UnknownName for what is not there, CpbenchError where several are and one is needed."""
    rows = run.rows
    if not len(rows):
        raise CpbenchError("the results have no rows; make some with: cpbench run PROBLEMS -o RESULTS")
    if choice.families:
        families = {str(family) for family in rows["family"]} - {""}
        rows = rows[rows["family"].isin(matching(families, choice.families, "family"))]
    for field, field_name in FIELDS.items():
        rows = _one_of(rows, field, str(getattr(choice, field) or ""), field_name)
    rows = _at(rows, choice.tolerance)
    rows = participating(rows)
    problems = int(rows["fingerprint"].nunique())
    node, tolerance = str(rows["node"].iloc[0]), float(rows["tolerance"].iloc[0])
    if choice.solvers:
        names = {str(label) for label in rows["label"]}
        solver_of = dict(zip(rows["label"], rows["solver"], strict=True))
        wanted = matching(names | set(solver_of.values()), choice.solvers, "solver of the results")
        rows = rows[rows["label"].isin(wanted) | rows["solver"].isin(wanted)]
    return SelectedRows(rows.reset_index(drop=True), run.histories, node, tolerance, problems, run.line_styles)


def matching(labels: set[str], patterns: Sequence[str], what: str) -> set[str]:
    """Return the names that a pattern stands for; brackets are part of a label."""
    matched: set[str] = set()
    for pattern in patterns:
        fitting = {name for name in labels if name == pattern or fnmatchcase(name, pattern.replace("[", "[[]"))}
        if not fitting:
            raise UnknownName(what, pattern, labels)
        matched |= fitting
    return matched


def _one_of(rows: pd.DataFrame, field: str, wanted: str, field_name: str) -> pd.DataFrame:
    """Select the rows of the wanted value of a field, or of the only one."""
    values = rows[field].map(_spelled)
    distinct = sorted(set(values))
    if wanted:
        if wanted not in distinct:
            raise UnknownName(field_name.removesuffix("s"), wanted, distinct)
        return rows[values == wanted]
    if len(distinct) > 1:
        sizes = rows["fingerprint"].groupby(values).nunique()
        shown = ", ".join(f"{value or '(none)'} ({counted(int(sizes[value]), 'problem')})" for value in distinct)
        flag = "--node" if field == "node" else f"-p {field}=VALUE"
        raise CpbenchError(f"the results have {len(distinct)} {field_name}: choose one with {flag}: {shown}")
    return rows


def _spelled(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _at(rows: pd.DataFrame, tolerance: float) -> pd.DataFrame:
    """Return the rows at a tolerance, or at the only one."""
    tolerances = sorted(set(rows["tolerance"]))
    listed = ", ".join(f"{value:g}" for value in tolerances)
    near = [value for value in tolerances if math.isnan(tolerance) or math.isclose(value, tolerance, rel_tol=1e-9)]
    if not near:
        raise CpbenchError(f"--tolerance {tolerance:g}: nothing was run at it; there are {listed}")
    if math.isnan(tolerance) and len(tolerances) > 1:
        raise CpbenchError(f"the results have {len(tolerances)} tolerances: choose one with --tolerance: {listed}")
    return rows[rows["tolerance"] == near[0]]
