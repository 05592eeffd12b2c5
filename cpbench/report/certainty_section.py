"""The section of a report about certificates: levels and forward errors, and what is known of each problem."""

from __future__ import annotations

from collections.abc import Iterator

from cpbench.analysis import certainty
from cpbench.report.run import Run
from cpbench.report.text import code, number, plain, table

LISTED = 40
"""The most rows of a list."""


def certainties(run: Run) -> Iterator[str]:
    """Yield levels by solver, answers that pass and are far from the solution, and problems without a proof; nothing
    where no certificate was sought."""
    labels = certainty.by_label(run.rows)
    if not len(labels):
        return
    yield f"## How certain the answers are ({int(labels['verified'].sum())} verified)"
    yield (
        "*Proved*: an exact solution is known, and the answer is within the tolerance of it. *Enclosed*: the same, of "
        "a box that provably holds a solution. *Stationary*: as proved, of a program that is not convex, so that only "
        "the first-order conditions are proved. *Distant*: a solution is known, and the answer is farther from it; it "
        "may still meet the tolerance by its error, or be near another solution. *Refuted*: a box around the answer "
        "provably holds none. *Measured*: none of these. *Disproved*: a false claim that is refuted, or away from the "
        "only solution by more than ten times the tolerance. The distance (forward error) is a bound on "
        "‖answer − solution‖∞/‖solution‖∞; where a problem has several solutions, to the one that was found."
    )
    yield table(
        ["solver", "verified", *certainty.LEVELS, "median distance", "largest", "false claims", "disproved"],
        (
            [
                code(row.label),
                *(str(getattr(row, name)) for name in ("verified", *certainty.LEVELS)),
                number(row.median),
                number(row.largest),
                str(row.false),
                str(row.disproved),
            ]
            for row in labels.itertuples(index=False)
        ),
        right=range(1, 6 + len(certainty.LEVELS)),
    )
    yield from _far(run)
    yield from _problems(run)


def _far(run: Run) -> Iterator[str]:
    far = certainty.far(run.rows)
    if len(far):
        yield f"{len(far)} accepted answers are {certainty.FAR:g} or more from the solution that is known:"
        yield table(
            ["problem", "solver", "measure", "error", "distance", "the only solution, for the matrix is"],
            (
                [
                    plain(row["problem"]),
                    code(row["label"]),
                    row["measure"] or "backward error",
                    number(row["error"]),
                    number(row["distance"]),
                    plain(_only(row["certificate"])),
                ]
                for _, row in far.head(LISTED).iterrows()
            ),
            right=[3, 4],
        )


def _only(certificate: str) -> str:
    """Return the fact that makes the solution unique; a word where none is known."""
    known = next((part for part in certificate.split("; ") if part.startswith("unique: ")), "")
    return known.removeprefix("unique: ") or "not known"


def _problems(run: Run) -> Iterator[str]:
    problems = certainty.by_problem(run.rows)
    known = {level: int((problems["level"] == level).sum()) for level in certainty.LEVELS}
    yield (
        f"Of {len(problems)} problems an answer is proved for {known['proved']} and enclosed for {known['enclosed']}; "
        f"for {known['stationary'] + known['distant']} more a solution is known that is stationary, or distant from "
        "all answers."
    )
    rest = problems[~problems["level"].isin(certainty.KNOWN)]
    if len(rest):
        yield table(
            ["problem", "formulation", "what stops a proof"],
            ([plain(r["problem"]), r["node"], plain(r["reason"])] for _, r in rest.head(LISTED).iterrows()),
        )
