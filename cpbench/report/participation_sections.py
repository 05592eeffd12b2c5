"""The sections of a report about who took part: restricted figures, tuned solvers, solvers that could not run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from cpbench.analysis import participation
from cpbench.report.run import Run, tunings
from cpbench.report.text import code, counted, cut, listed, plain, seconds, table


def publishing(run: Run) -> Iterator[str]:
    """Yield what must not be published, or what was left out for it."""
    if run.left_out:
        what = "Tables, figures and `results.csv`" if run.has_csv else "Tables and figures"
        yield (
            f"**Left out**, since publishing figures of {counted(len(run.left_out), 'solver')} is restricted: "
            f"{listed(sorted(run.left_out), 12)}. {what} are of the others alone."
        )
    found = participation.restricted(run.rows, run.meta.get("solvers") or {})
    if not found:
        return
    yield (
        "**Not to be published as it is. Publishing these figures is restricted: "
        f"{listed(list(found), 12)}.** Leave them out with {code('cpbench report RESULTS --publishable')}, "
        "or ask whoever gives the licence."
    )
    terms: dict[str, list[str]] = {}
    for name, reason in found.items():
        terms.setdefault(reason, []).append(name)
    yield "\n".join(f"- {listed(names, 12)}: {plain(reason)}" for reason, names in terms.items())


def tuned(run: Run) -> Iterator[str]:
    """Yield what the tuning of solvers cost, and how many of these problems it has seen."""
    found = tunings(run)
    if not found:
        return
    yield f"## Tuned solvers ({len(found)})"
    yield (
        "The options of these were searched for on problems before this run; the time of the search is in no figure. "
        "*Seen*: problems of this report that the search used. On them a tuned solver is shown at its best."
    )
    here = {
        str(label): set(fingerprints) for label, fingerprints in run.rows.groupby("label")["fingerprint"] if len(label)
    }
    yield table(
        ["solver", "search", "seed", "configurations", "solves", "took", "on problems", "seen"],
        (_tuned(label, record, here.get(label, set())) for label, record in sorted(found.items())),
        right=range(2, 8),
    )


def _tuned(label: str, record: Mapping[str, Any], here: set[str]) -> list[str]:
    used = set(record.get("problems", ()))
    return [
        code(label),
        plain(record.get("method", "")),
        str(record.get("seed", "")),
        str(record.get("configurations", "")),
        str(record.get("solves", "")),
        seconds(float(record.get("spent", float("nan")))),
        str(len(used)),
        f"{len(used & here)} of {len(here)}",
    ]


def absent(run: Run) -> Iterator[str]:
    """Yield why solvers could not run here, each reason once."""
    found = participation.absences(run.rows)
    if not found:
        return
    yield "## Not available here"
    yield (
        "*missing*: what to install; *licence*: what it said; *broken*: the last line of the traceback, all of which "
        f"{code('cpbench doctor')} shows. A solver that could run on no problem has no line in the tables above."
    )
    yield table(
        ["state", "reason", "solvers", "pairs"],
        (
            [
                plain(one.state),
                plain(cut((one.detail.strip().splitlines() or ["not told"])[-1], 300)),
                listed(list(one.solvers), 12),
                str(sum(one.solvers.values())),
            ]
            for one in found
        ),
        right=[3],
    )
