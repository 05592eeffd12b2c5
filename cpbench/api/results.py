"""The results of a benchmark: rows as a table, a ranking, figures, a report, a comparison."""

from __future__ import annotations

import html
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench.foundation.text import counted

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from cpbench.analysis.comparison import Comparison, ComparisonSide, Thresholds
    from cpbench.analysis.contradictions import Contradiction
    from cpbench.analysis.ranking import Ranking


MAGIC = b"SQLite format 3\x00"
"""First bytes of a results file."""


def is_results_file(path: str | Path) -> bool:
    """Return whether a file is one of results, by its first bytes; a pipe, which may never have any, is none."""
    try:
        if not Path(path).is_file():
            return False
        with Path(path).open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


class Results:
    """The rows of a results file, one a pair of a problem and a solver.

    Parameters
    ----------
    path : the file that `cpbench.run` or `cpbench run` wrote. remarks : what a reader should know of the run.

    Raises StoreError where it is not a results file.
    """

    def __init__(self, path: str | Path, *, remarks: Sequence[str] = ()) -> None:
        self.path = Path(path)
        self.remarks = tuple(remarks)
        from cpbench.analysis.run_table import RunTable

        with Store(self.path) as store:
            self._run = RunTable.of(store.table(), store.meta())
            self._histories = list(store.histories())

    @property
    def frame(self) -> pd.DataFrame:
        """The rows: problem, solver, status, error, solve [s] and all else that was measured; a copy."""
        return self._run.stored.copy()

    @property
    def meta(self) -> Mapping[str, Any]:
        """Facts of the run by name: command, date, machine, solvers, ..."""
        return self._run.meta

    @property
    def contradictions(self) -> list[Contradiction]:
        """Rows that cannot all be right: claims, answers and verdicts on one problem."""
        return self._run.contradictions

    @property
    def rankings(self) -> list[Ranking]:
        """A ranking of each formulation, with a sentence that says what to use."""
        return self._run.rankings

    def plot(
        self,
        kind: str,
        node: str = "",
        *,
        solvers: Sequence[str] = (),
        families: Sequence[str] = (),
        tolerance: float = math.nan,
        start: str = "",
        **options: Any,
    ) -> Figure:
        """Draw a figure of the run; `cpbench plot --help` lists the kinds, `cpbench plot KIND --help` their options.

        Parameters
        ----------
        node : formulation, where the results have several. solvers, families : names or globs, all for none.
        tolerance : of the rows; another than was asked for judges their answers again. start : start policy.
        options : of the kind, as ``metric="iterations"`` of a profile.

        Raises UnknownName for what is not there, CpbenchError where the results have several values and need one.
        """
        from cpbench.bench import history
        from cpbench.report import canvas, figure_kinds, plots
        from cpbench.report.chosen import Choice
        from cpbench.report.run import assembled

        kinds = figure_kinds.find(plots.__name__, kind)
        for name in options:
            if name not in kinds.options:
                from cpbench.errors import UnknownName

                raise UnknownName(f"option of the figure {kind}", name, kinds.options)
        choice = Choice(node, tuple(solvers), tuple(families), tolerance, start)
        run = assembled(self._run, Path(), history.table(self._histories))
        with canvas.drawing(formulas=False):
            figure = kinds.draw(run, choice, **options).figure
        setattr(figure, "_repr_png_", lambda: _png(figure))  # noqa: B010  (it came without pyplot, which notebooks know)
        return figure

    def profile(self, node: str = "", *, metric: str = "time", **choice: Any) -> Figure:
        """Draw the performance profile: the fraction of problems solved within τ times the least cost.

        Parameters
        ----------
        node : formulation, where the results have several. metric : the cost: time, solve, cpu, memory, iterations or
        counter:NAME. choice : as `plot` takes it.
        """
        return self.plot("profile", node, metric=metric, **choice)

    def report(self, folder: str | Path, title: str = "", **choice: Any) -> Path:
        """Write the report into a folder (an offline page, Markdown, figures, rows); returns the page.

        Parameters
        ----------
        choice : `publishable`, `count_stationary`, `data`, as `cpbench report --help` says.

        Raises FormatError where the folder cannot be made.
        """
        from cpbench.api.reports import write_report
        from cpbench.errors import FormatError

        path = Path(folder)
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as cause:
            raise FormatError(path, "", f"cannot be a folder ({cause.strerror or cause})") from None
        with Store(self.path) as store:
            files, _ = write_report(store, path, title or self.path.stem, self._run, **choice)
        return next(file for file in files if file.suffix == ".html")

    def compare(self, base: str | Path | Results, **settings: Any) -> Comparison:
        """Compare with an earlier run: what improved, regressed or is inconclusive.

        Parameters
        ----------
        settings : `margin`, `counter_margin`, `alpha`, `same_machine`, `seed`, `count_stationary`
        (`analysis.comparison.Settings`).
        """
        from cpbench.analysis.comparison import Thresholds, compare

        before = side(base.path if isinstance(base, Results) else Path(base))
        return compare(before, side(self.path), Thresholds(**settings))

    def __len__(self) -> int:
        return len(self._run.stored)

    def __repr__(self) -> str:
        sentences = [*self._warnings, *(ranking.sentence for ranking in self.rankings)]
        return "\n".join([f"Results of {counted(len(self), 'pair')} in {self.path.name}", *sentences, *self.remarks])

    @property
    def _warnings(self) -> list[str]:
        disturbed = [self._run.disturbance] if self._run.disturbance else []
        return [*(f"contradiction: {one}" for one in self.contradictions), *disturbed]

    def _repr_html_(self) -> str:
        from cpbench.report.page import as_html
        from cpbench.report.tables import ranking_table

        parts = [f"<p>{html.escape(line)}</p>" for line in self._warnings]
        for ranking in self.rankings:
            table = as_html(ranking_table(ranking.shown).markdown)
            parts.append(f"<p>{html.escape(ranking.sentence)}</p>{table}")
        return "".join([*parts, *(f"<p>{html.escape(remark)}</p>" for remark in self.remarks)])


def compare_files(
    base: Path,
    new: Path | None,
    labels: tuple[str, str] = ("", ""),
    settings: Thresholds | None = None,
    noise: tuple[str, str] | None = None,
) -> Comparison:
    """Compare two results files, or two labels of one.

    Parameters
    ----------
    base : a results file. new : None to compare `labels` of the base.
    settings : margins and levels, None for the default. noise : two labels of equal code, whose difference is noise.

    Raises CpbenchError where a file has no rows or the sides have no pair in common.
    """
    from cpbench.analysis import comparison

    chosen = settings or comparison.Thresholds()
    if new is None:
        return comparison.compare_labels(side(base), *labels, chosen, noise)
    after = side(new)
    equal = comparison.equal_pairs(after, noise) if noise is not None else None
    return comparison.compare(side(base), after, chosen, equal)


def side(path: Path) -> ComparisonSide:
    """Return the rows and facts of a results file; raises CpbenchError when it has none."""
    with Store(path) as store:
        return side_of(store)


def side_of(store: Store) -> ComparisonSide:
    """Return the rows and facts of a results file that is open; raises CpbenchError when it has no rows."""
    from cpbench.analysis.comparison import ComparisonSide
    from cpbench.generators.collection import address_text

    table = store.table()
    if not len(table):
        raise CpbenchError(f"{store.path}: has no rows; make some with: cpbench run PROBLEMS -o {store.path}")
    addresses = {address: address_text(address) for address in table["address"].unique()}
    table = table.assign(address=table["address"].map(addresses))
    return ComparisonSide(str(store.path), table, store.meta(), store.machines())


def _png(figure: Figure) -> bytes:
    """Return the picture that a notebook shows."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, bbox_inches="tight")
    return buffer.getvalue()
