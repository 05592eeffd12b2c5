"""Input of every section of a report: the rows, the facts of the run, and the folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from cpbench.analysis import cautions, contradictions, failures, reliability, starts
from cpbench.analysis import table as rows_of
from cpbench.analysis.contradictions import Contradiction
from cpbench.analysis.failures import Reason
from cpbench.analysis.histories import COLUMNS as HISTORY_COLUMNS
from cpbench.analysis.line_styles import line_styles
from cpbench.analysis.participation import participating, restricted, without
from cpbench.analysis.profiles import Profile, performance_profile
from cpbench.analysis.ranking import Ranking, formulation, rankings
from cpbench.analysis.run_table import RunTable
from cpbench.analysis.table import ResultGroup
from cpbench.report.figures import PALETTE
from cpbench.report.text import counted, one_line, plain, solve_command
from cpbench.verification import Status


@dataclass(frozen=True, eq=False)
class ComparedTimes:
    """The times of the solvers of a formulation that are ranked.

    Attributes
    ----------
    times : problems × labels [s], ∞ for a failure. lost : where the answer was lost on its way back.
    """

    times: pd.DataFrame
    lost: pd.DataFrame

    @cached_property
    def profile(self) -> Profile:
        """Their performance profile."""
        return performance_profile(self.times, lost=self.lost)


class ProblemOrigin(NamedTuple):
    """Source and licence of the problems of a family, as their files say it; '' where they do not."""

    source: str
    licence: str


@dataclass(frozen=True)
class Run:
    """The rows of a run, in fixed order, with the facts of the run, where the report goes, judged iterates
    (`analysis.histories`) of the solves that were recorded, the restrictions on publishing, by name, of solvers
    that are left out, where its problems are from by family, and
    whether results.csv is beside the report. `count_stationary`: stationary answers are among the solved.
    `parted`: the rows before several starts of a problem were made cases of one formulation (`analysis.starts`).
    `whole`: all rows of the file, where these are they: what is computed of them is taken from there.
    `waiting`: pairs of problems of which no pair has run yet. They are in no table: they are not failures.
    `line_styles`: that of each label in every figure, from all rows of the file.
    """

    rows: pd.DataFrame
    meta: Mapping[str, Any]
    folder: Path
    histories: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=list(HISTORY_COLUMNS)))
    left_out: Mapping[str, str] = field(default_factory=dict)
    origins: Mapping[str, ProblemOrigin] = field(default_factory=dict[str, ProblemOrigin])
    has_csv: bool = True
    count_stationary: bool = False
    line_styles: Mapping[str, int] = field(default_factory=dict)
    parted: pd.DataFrame | None = None
    whole: RunTable | None = None
    waiting: int = 0

    @property
    def incomplete(self) -> str:
        """Sentence about pairs that have not run yet; '' without any."""
        inside = int((self.rows["status"] == str(Status.NOT_RUN)).sum())
        every = counted(len(self.rows) + self.waiting, "pair")
        return f"Incomplete: {inside + self.waiting} of {every} not run yet." if inside + self.waiting else ""

    @property
    def stationary(self) -> str:
        """Sentence about stationary answers; '' without any."""
        if self.count_stationary:
            return "stationary answers are counted as solved (--count-stationary)"
        count = int((self.rows["status"] == str(Status.STATIONARY)).sum())
        return f"{count} more stationary, not counted as solved" if count else ""

    @property
    def read(self) -> pd.DataFrame:
        """The rows as they were read: a problem from several starts is one problem."""
        return self.rows if self.parted is None else self.parted

    @cached_property
    def remarks(self) -> list[str]:
        """`cautions.remarks` of all rows: what the lines below the answer say."""
        return list(cautions.remarks(self.read))

    @property
    def all_rows(self) -> str:
        """Place of the full list of rows."""
        return "`results.csv`" if self.has_csv else "the results file"

    @cached_property
    def rankings(self) -> list[Ranking]:
        """The answer of every group in which a solver was started."""
        return rankings(self.rows, self.meta.get("solvers") or {}) if self.whole is None else self.whole.rankings

    # what several sections ask for is found once: in a million rows each takes seconds

    @cached_property
    def parts(self) -> list[tuple[ResultGroup, pd.DataFrame]]:
        """The groups, each with the rows of the solvers that took part."""
        return [(group, participating(rows)) for group, rows in rows_of.groups(self.rows)]

    @cached_property
    def compared(self) -> dict[ResultGroup, ComparedTimes]:
        """The times of each group that its tables, its profile and the page are of."""
        return {group: ComparedTimes(rows_of.times(rows), rows_of.lost(rows)) for group, rows in self.parts}

    @cached_property
    def timed(self) -> pd.DataFrame:
        """All rows with the `time` that figures and tables are of: what the files of rows hold."""
        return rows_of.with_time(self.read)

    @cached_property
    def disturbance(self) -> str:
        """Return what speaks against the times of the run; '' where nothing does."""
        return cautions.disturbance(self.read, self.meta)

    @cached_property
    def noise(self) -> float:
        """Ratio up to which its times may differ by the machine alone."""
        return cautions.noise(self.read, self.meta)

    @cached_property
    def contradictions(self) -> list[Contradiction]:
        """Rows that cannot all be right, of those that are reported (`contradictions.of_results`)."""
        return contradictions.of_results(self.meta, self.read) if self.whole is None else self.whole.contradictions

    @cached_property
    def false_claims(self) -> pd.DataFrame:
        """Rows that claim what is not so (`reliability.false_claims`)."""
        return reliability.false_claims(self.rows)

    @cached_property
    def failures(self) -> list[Reason]:
        """Reasons why started pairs were not solved."""
        return failures.failures(self.rows)

    @cached_property
    def refusals(self) -> list[Reason]:
        """Reasons why pairs were never started although their solver is there."""
        failed = failures.failures(self.rows, refused=True)
        return [reason for reason in failed if reason.status != Status.UNAVAILABLE]

    def local(self, text: str) -> str:
        """Return a text without the folder of this machine."""
        return text.replace(str(Path.cwd()) + os.sep, "")

    def again(self, row: Any) -> str:
        """Return the command that runs a row's pair again."""
        return self.local(solve_command(row, (self.meta.get("solvers") or {}).get(row["label"])))


def assembled(
    given: RunTable,
    folder: Path,
    histories: pd.DataFrame | None = None,
    *,
    publishable: bool = False,
    origins: Mapping[str, ProblemOrigin] | None = None,
    has_csv: bool = True,
    count_stationary: bool = False,
    address: Callable[[str], str] = str,
) -> Run:
    """Return the run that a report is about.

    Parameters
    ----------
    given : the rows of the results store, with facts of the run by name (command, date, timeout [s], machine, ...).
    folder : of the report. histories : judged iterates of recorded solves, in the columns of `analysis.histories`.
    publishable : whether solvers whose figures must not be published are left out of everything. has_csv : whether
    results.csv is beside the report. count_stationary : whether answers that are stationary only are among the solved.
    origins : source and licence of the problems, by family. address : what stands for the address of a problem.
    """
    rows = _without_folders(given.rows, address)
    begun = rows["fingerprint"].isin(rows.loc[rows["status"] != str(Status.NOT_RUN), "fingerprint"])
    waiting = int((~begun).sum()) if begun.any() else 0
    rows = rows[begun].reset_index(drop=True) if waiting else rows
    run = Run(rows, given.meta, folder, has_csv=has_csv, line_styles=line_styles(rows, len(PALETTE)))
    run = replace(run, origins=origins or {}, waiting=waiting)
    if histories is not None:
        run = replace(run, histories=histories)
    if count_stationary:
        run = replace(run, rows=rows_of.counting_stationary(run.rows), count_stationary=True)
    run = _publishable(run) if publishable else run
    changed = count_stationary or bool(run.left_out)
    return replace(run, parted=run.rows, rows=starts.merged(run.rows), whole=None if changed else given)


def _publishable(run: Run) -> Run:
    """Return the run without the solvers whose figures must not be published: neither their rows nor their metadata."""
    metadata: Mapping[str, Mapping[str, Any]] = run.meta.get("solvers") or {}
    left_out = restricted(run.rows, metadata)
    kept = {label: one for label, one in metadata.items() if one.get("name") not in left_out}
    rows = without(run.rows, left_out)
    return replace(run, rows=rows, meta={**run.meta, "solvers": kept}, left_out=left_out)


def _without_folders(rows: pd.DataFrame, address: Callable[[str], str]) -> pd.DataFrame:
    """Return addresses and messages relative to the working folder: a report shows no home folder."""
    here, home = str(Path.cwd()).rstrip(os.sep) + os.sep, str(Path.home()).rstrip(os.sep) + os.sep
    return rows.assign(
        address=_each_once(rows["address"], lambda text: address(text).removeprefix(here)),
        message=_each_once(rows["message"], lambda text: text.replace(here, "").replace(home, f"~{os.sep}")),
    )


def _each_once(values: pd.Series, function: Callable[[str], str]) -> pd.Series:
    """Apply a function once to each text: of a million rows few differ in it."""
    return values.map({text: function(text) for text in values.unique()}).astype(values.dtype)


def group_name(run: Run, group: ResultGroup) -> str:
    """Return the formulation, with what tells it from other groups of the same formulation, as Markdown."""
    return plain(group_name_text(run, group))


def group_name_text(run: Run, group: ResultGroup) -> str:
    """Return the same as plain text."""
    return one_line(formulation(group, [g for g, _ in run.parts]))
