"""The sentences of a report: what to use, under which conditions it was run, and what it cannot tell."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pandas as pd

from cpbench.analysis import failures, participation, reliability
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import REFUSED
from cpbench.analysis.ranking import Ranking
from cpbench.analysis.ranking_order import LEVEL
from cpbench.analysis.run_table import quotation
from cpbench.report.run import Run
from cpbench.report.text import code, counted, cut, listed, number, plain, seconds
from cpbench.verification import Status

ENOUGH = 20
"""Problems of a formulation from which on a report says which solver to use."""


def answers(run: Run) -> Iterator[str]:
    """Yield a sentence for each formulation with enough problems and several solvers, then one about all others.

    Where the machine was busy, they are about what was solved, and not about times.
    """
    few: list[str] = []
    for ranking in run.rankings:
        if ranking.problems < ENOUGH:
            few.append(f"{plain(ranking.formulation)} ({ranking.problems_and_starts})")
        elif len(ranking.rows) < 2:
            few.append(f"{plain(ranking.formulation)} (1 solver)")
        else:
            title = f" {plain(ranking.bracketed_title)}" if ranking.bracketed_title else ""
            yield f"- **{plain(ranking.formulation)}**{title}: {_answer(run, ranking)}"
    if few:
        yield f"- Too few to say, with fewer than {ENOUGH} problems or one solver: {', '.join(few)}."


def _answer(run: Run, ranking: Ranking) -> str:
    advice = ranking.advice
    if not advice.winner:
        return plain(advice.text)
    if run.disturbance:
        return solved_most(ranking, listed, run.noise)
    gap = " " if advice.after.startswith(" ") else ""  # `plain` leaves blanks at the ends out
    return f"{plain(advice.before)} **{code(advice.winner)}**{gap}{plain(advice.after)}"


def solved_most(ranking: Ranking, names: Callable[[Sequence[str], int], str], noise: float) -> str:
    """Return which solvers solved most problems, where the times are not to be relied on; where these solved all, also
    which of them took least time by more than a machine explains whose speed changes `noise` times: solvers of a
    problem run one after the other, in random order, so that means stray less (Hoeffding, J. Am. Stat. Assoc. 58)."""
    most = max(row.solved for row in ranking.rows)
    first = [row for row in ranking.rows if row.solved == most]
    text = f"none of {ranking.cases} was solved"
    if most:
        text = f"most problems were solved by {names([row.solver for row in first], 4)}: {most} of {ranking.cases}"
    stray = noise ** min(1.0, math.sqrt(2.0 * math.log(2.0 / LEVEL) / ranking.cases))
    least = min(row.factor for row in first)
    near = [row.solver for row in first if row.factor <= stray * least]
    if most == ranking.cases and 0 < len(near) < len(first):
        text += f"; {names(near, 4)} took least time, in the mean by more than the machine's changes explain"
    ends = max(ranking.rows, key=lambda row: row.solved + row.stationary)
    if ends.solved + ends.stationary > most:
        text += f"; {names([ends.solver], 1)} solved {ends.solved}, and {ends.stationary} more to a stationary point"
    return f"{text}."


def headline(run: Run) -> Iterator[str]:
    """Yield how much was run and with which results, a sentence each; pairs that could not be run are counted apart."""
    rows = run.rows
    if not len(rows):
        yield "No pair was planned: no solver is reached from the problems that were read."
        return
    never = int(rows["status"].isin(REFUSED).sum())
    waiting = int((rows["status"] == str(Status.NOT_RUN)).sum())
    problems, labels = run.read["fingerprint"].nunique(), rows["label"].nunique()
    yield (
        f"**{int(rows_of.solved(rows).sum())} of {counted(len(rows) - never, 'pair')} solved** "
        f"({counted(problems, 'problem')}, {counted(labels, 'solver configuration')}); "
        f"{counted(len(run.false_claims), 'false claim')}."
    )
    if never > waiting:
        yield f"{counted(never - waiting, 'more pair')} could not be run, and are not counted."
    if run.stationary:
        yield f"{run.stationary.capitalize()}."


def conditions_line(run: Run) -> str:
    """Return date, machine, versions, tolerance, limit and load on one line, and whether the times may be relied on."""
    meta, machine = run.meta, run.meta.get("machine") or {}
    loads = run.rows["loadavg"].dropna()
    cores, memory = machine.get("threads") or machine.get("cores"), machine.get("ram_gib")
    parts = [
        str(meta.get("date") or ""),
        str(machine.get("cpu") or "machine not recorded"),
        counted(int(cores), "core") if cores else "",
        f"{memory:g} GiB" if isinstance(memory, int | float) else "",
        f"cpbench {meta['cpbench']}" if meta.get("cpbench") else "",
        f"tolerance {_values(run, 'tolerance', '{:g}')}",
        f"limit {_values(run, 'seconds', '{:g} s')}",
        f"load {loads.median():.1f}, at most {loads.max():.1f}" if len(loads) else "",
        quotation(meta),
    ]
    line = plain("; ".join(filter(None, parts))) + "."
    return f"{line} **{plain(run.disturbance)}**" if run.disturbance else line


def publishing(run: Run) -> Iterator[str]:
    """Yield what must not be published, or what was left out for it."""
    if run.left_out:
        what = "Tables, figures and `results.csv`" if run.has_csv else "Tables and figures"
        yield (
            f"**Left out**, since publishing figures of {counted(len(run.left_out), 'solver')} is restricted: "
            f"{listed(sorted(run.left_out), 12)}. {what} are of the others alone."
        )
    restricted = participation.restricted(run.rows, run.meta.get("solvers") or {})
    if not restricted:
        return
    yield (
        "**Not to be published as it is. Publishing these figures is restricted: "
        f"{listed(list(restricted), 12)}.** Leave them out with {code('cpbench report RESULTS --publishable')}, "
        "or ask the owner of the licence."
    )
    terms: dict[str, list[str]] = {}
    for name, reason in restricted.items():
        terms.setdefault(reason, []).append(name)
    yield "\n".join(f"- {listed(names, 12)}: {plain(reason)}" for reason, names in terms.items())


def limitations(run: Run) -> Iterator[str]:
    """Yield what this run cannot tell, or what a reader of its numbers has to know, a sentence each."""
    rows = run.rows
    unproved = reliability.unproved(rows)
    if len(unproved):
        yield (
            f"{counted(len(unproved), 'claim')} that there is no solution: neither proved, nor contradicted by a "
            f"verified answer ({listed(sorted(set(unproved['label'])), 4)})."
        )
    wrong = failures.flagged(rows, "direction")
    if len(wrong):
        yield (
            f"Accepted, but in a wrong direction ({len(wrong)}): these answers meet the tolerance, and yet some "
            f"contact slips in a direction that the law forbids: {listed(_most_first(wrong['label']), 4)}."
        )
    lost = reliability.losses(rows)
    if len(lost):
        first = ", ".join(f"{code(r.route)} {r.lost}" for r in lost.head(4).itertuples(index=False))
        yield (
            f"Lost on the way back ({lost['lost'].sum()}): the solver met its target, and the answer that the "
            f"conversion carried back does not meet the tolerance; no solver is charged: {first}."
        )
    inexact = reliability.inexact_routes(rows)
    if len(inexact):
        yield (
            f"Routes that promise less than an answer: {listed([str(label) for label in inexact['label']], 4)} "
            f"solved {inexact['solved'].sum()} and missed {inexact['missed'].sum()} problems; largest error "
            f"{number(float(inexact['largest'].max()))}."
        )
    refused = int(rows["status"].isin(REFUSED).sum())
    if refused:
        reasons = [reason for reason in run.refusals if reason.status != Status.NOT_RUN]
        most = max(reasons, key=lambda reason: reason.count, default=None)
        why = f" Most often ({most.count}): {plain(cut(most.message))}" if most is not None else ""
        yield f"{counted(refused, 'pair')} could not be run: no route, or a solver that is not here.{why}"
    left_out = run.meta.get("left_out") or []
    yield from map(plain, participation.lacking_lines(left_out))
    if participation.unreached_lines(left_out):
        yield f"{plain(participation.unreached_summary(left_out))}; the reasons are in `details.md`."
    yield from _times(run)


def _times(run: Run) -> Iterator[str]:
    """Yield whether the machine was fit for measuring."""
    jobs = run.rows["jobs"].dropna()
    shared = int((jobs > 1).sum())
    if shared:
        yield (
            f"{counted(shared, 'time was', 'times were')} taken while up to {jobs.max():.0f} solves ran side by side "
            "(column `jobs`): they share caches and memory, and are longer and less certain than times of one at a "
            "time."
        )
    took = [float(r["seconds"]) for r in run.meta.get("references") or [] if r["seconds"] == r["seconds"]]
    if len(took) > 1:
        yield (
            f"A solve that is always the same was repeated {len(took)} times during the run: it took "
            f"{seconds(min(took))} to {seconds(max(took))}, a drift of the machine by a factor "
            f"{max(took) / min(took):.2f}. Ratios of two times below that are within this machine's noise; means over "
            "many problems, whose solvers ran one after the other in random order, are steadier."
        )


def settings(run: Run) -> list[str]:
    """Return everything that is known of how the run was made, a line each."""
    meta, rows = run.meta, run.rows
    memory = sorted(rows["memory"].dropna().unique())
    facts: dict[str, Any] = {
        "tolerance": _values(run, "tolerance", "{:g}"),
        "limit": _values(run, "seconds", "{:g} s a solve"),
        "threads": _values(run, "threads", "{:g}"),
        "repeats": _values(run, "repeats_asked", "{:g} of short solves"),
        "start": ", ".join(sorted(set(rows["start"].unique()) - {""})),
        "run on": meta.get("date", ""),
        "random order": f"seed {meta['seed']}" if meta.get("seed") is not None else "",
        "results file": f"SHA-256 {meta['sha256']}" if meta.get("sha256") else "",
        **(meta.get("machine") or {}),
        "memory limit of a solve": ", ".join(f"{m / 2**30:.3g} GiB" if m else "none" for m in memory),
        "hosts": ", ".join(sorted(set(rows["host"].unique()) - {""})),
        **{f"{name} (package)": version for name, version in sorted((meta.get("versions") or {}).items())},
    }
    lines = [f"{plain(name)}: {plain(value)}" for name, value in facts.items() if str(value)]
    return [*lines, f"command: {code(run.local(str(meta.get('command', ''))))}"]


def _values(run: Run, column: str, form: str) -> str:
    """Return the values of a column over all rows; "none" stands for an infinite one."""
    values = sorted(run.rows[column].dropna().unique())
    return ", ".join(form.format(v) if math.isfinite(v) else "none" for v in values)


def _most_first(labels: pd.Series[str]) -> list[str]:
    counts = labels.value_counts()
    return [str(label) for label in sorted(counts.index, key=lambda label: (-int(counts[label]), str(label)))]
