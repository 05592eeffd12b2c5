"""The sections of a report about participation: restricted figures, solvers that could not run."""

from __future__ import annotations

from collections.abc import Iterator

from cpbench.analysis import participation
from cpbench.report.run import Run
from cpbench.report.text import code, counted, cut, listed, plain, table


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


def absent(run: Run) -> Iterator[str]:
    """Yield why solvers could not run here, each reason once."""
    absences = participation.absences(run.rows)
    if not absences:
        return
    yield "## Not available here"
    yield (
        "*missing*: what to install; *licence*: its message; *broken*: the last line of the traceback, all of which "
        f"{code('cpbench doctor')} shows. A solver that could run on no problem has no line in the tables above."
    )
    yield table(
        ["state", "reason", "solvers", "pairs"],
        (
            [
                plain(one.state),
                plain(cut((one.detail.strip().splitlines() or ["no reason was given"])[-1], 300)),
                listed(list(one.solvers), 12),
                str(sum(one.solvers.values())),
            ]
            for one in absences
        ),
        right=[3],
    )
