"""The first screen of the page: the sentence that answers, the profile, the ranking; then what the run was."""

from __future__ import annotations

from collections.abc import Iterator

from cpbench.analysis import cautions
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import REFUSED
from cpbench.analysis.ranking import Ranking
from cpbench.report.html.columns import KEPT, WHOLE
from cpbench.report.html.markup import Markup, element, prose, table
from cpbench.report.participation_sections import publishing
from cpbench.report.run import Run, group_name_text
from cpbench.report.run_sections import contradictions
from cpbench.verification import Status


def overview(run: Run) -> Iterator[Markup]:
    """Yield the places of the answer, its figure and its ranking, then the answers of all formulations and the
    numbers of the run.
    """
    rows = run.rows
    if not len(rows):
        yield element("p", "No pair was planned: no solver is reached from the problems that were read.")
        return
    if restricted := list(publishing(run)):
        yield element("div", prose("\n\n".join(restricted)), class_="note warning")
    waiting = int((rows["status"] == str(Status.NOT_RUN)).sum())
    if run.incomplete:
        yield element("p", run.incomplete, class_="note warning")
    if run.remarks:
        yield element("p", " ".join(f"{remark}." for remark in run.remarks), class_="note warning")
    yield prose("\n\n".join(contradictions(run)))
    yield from _choices(run)
    disturbed = cautions.disturbance(run.read, run.meta)
    if disturbed:
        yield element("p", disturbed, class_="note warning")
    yield element("p", class_="answer", data_answer="")
    yield element("div", data_figure="profile")
    yield element("h3", "Ranking: ", element("span", data_group_name=""))
    yield element("div", data_figure="answer")
    yield from _formulations(run)
    yield from _numbers(run, waiting)
    yield element("h3", "Problems solved: ", element("span", data_group_name=""))
    yield element("div", data_figure="ranking")


def _choices(run: Run) -> Iterator[Markup]:
    """Yield a button a group, with the solver to use, where there are several."""
    if len(run.parts) > 1:
        best = {ranking.group: ranking for ranking in run.rankings}
        buttons = (
            element(
                "button",
                element("strong", group_name_text(run, group)),
                f" {_winner(best.get(group))}",
                type="button",
                title=best[group].sentence if group in best else "",
                class_="choice",
                data_choose=str(place),
            )
            for place, (group, _) in enumerate(run.parts)
        )
        yield element("p", "The solver to use for each formulation; choose one:", class_="choices-title")
        yield element("div", *buttons, class_="choices", role="group", aria_label="Formulations", tabindex="0")


def _winner(ranking: Ranking | None) -> str:
    """Return the solver to use, with "only" before one that nothing was compared with."""
    if ranking is None or not ranking.winner:
        return ""
    return ranking.winner if len(ranking.rows) > 1 else f"(only {ranking.winner})"


def _formulations(run: Run) -> Iterator[Markup]:
    """Yield the answers of all groups, where there are several, each to be chosen."""
    if len(run.parts) < 2:
        return
    places = {group: place for place, (group, _) in enumerate(run.parts)}
    yield element("h3", "All formulations")
    lines = []
    for ranking in run.rankings:
        name = ranking.formulation
        chosen = {"type": "button", "class_": "link", "data_choose": str(places[ranking.group])}
        open_it = element("button", name, **chosen, title=f"show {name} in all figures")
        lines.append([open_it, ranking.verdict, ranking.problems, len(ranking.rows)])
    yield table("Answers by formulation", ["formulation", "answer", "problems", "solvers"], lines, right=(2, 3))


def _numbers(run: Run, waiting: int) -> Iterator[Markup]:
    """Yield how much was run and with which results; pairs that could not be run are counted apart."""
    rows = run.rows
    never = int(rows["status"].isin(REFUSED).sum())
    stationary = int((rows["status"] == str(Status.STATIONARY)).sum())
    facts = {
        "pairs solved": f"{int(rows_of.solved(rows).sum())} of {len(rows) - never}",
        **(
            {f"stationary, {'' if run.count_stationary else 'not '}counted as solved": stationary} if stationary else {}
        ),
        **({"could not be run, not counted": never - waiting} if never > waiting else {}),
        "problems": run.read["fingerprint"].nunique(),
        "solver configurations": rows["label"].nunique(),
        "formulations": rows["node"].nunique(),
        "false claims": len(run.false_claims),
    }
    yield element("h3", "The run")
    numbers = [element("div", element("dt", name), element("dd", value)) for name, value in facts.items()]
    yield element("dl", *numbers, class_="facts")
    if len(rows) > WHOLE:
        many = (
            f"{len(rows)} rows are too many to keep every fact of every pair on this page. Costs and verdicts of all "
            "of them are here, to seven digits, so that each figure is computed from all; messages, residuals and "
            f"commands are those of at most {KEPT} failures, and the matrix is one of families."
        )
        yield element("p", many, class_="note")
