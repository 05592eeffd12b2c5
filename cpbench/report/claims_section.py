"""Claims of every solver and what became of them: one table of a run, those of cpbench first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cpbench.analysis.reliability import NEAR, claim_counts
from cpbench.report.run import Run, each
from cpbench.report.text import code, table

TITLE = "Claims of each solver"
HEAD = ("solver", "claims made", "confirmed", "near", "false", "false: no solution", "undecided")
EXPLAINED = (
    "A claim is that the problem that the solver was given is solved, or that it has no solution. Confirmed: as "
    f"measured there, or proved. Near: the error is within {NEAR:g} times the tolerance. False: beyond that. False, no "
    "solution: there is a verified answer. Undecided: rounding decides, nothing proves that there is no solution, or "
    "the solver's own problem is not known. Solvers of cpbench stand first."
)


def claim_lines(run: Run) -> list[Sequence[str]]:
    """Return the cells of the table, of the labels with a claim: solvers of cpbench first, then in order of name."""
    counts = claim_counts(run.read)
    sheets = run.meta.get("solvers") or {}
    counts = counts[counts["made"] > 0].reset_index()
    foreign = [not sheets.get(label, {}).get("native") for label in counts["label"]]
    ordered = counts.assign(foreign=foreign).sort_values(["foreign", "label"], kind="stable")
    columns = ("made", "confirmed", "near", "false", "nonexistence", "open")
    return [[str(one.label), *(str(getattr(one, name) or "·") for name in columns)] for one in each(ordered)]


def claims_section(run: Run) -> Iterator[str]:
    """Yield the table; nothing without a claim."""
    lines = claim_lines(run)
    if lines:
        yield f"## {TITLE}"
        yield table(HEAD, ([code(label), *cells] for label, *cells in lines), right=range(1, len(HEAD)))
        yield EXPLAINED
