"""Two tables of results compared: what got worse, what better, what is the same, and what remains undecided.

Gates in order, for every pair: status, verified error, counters, time; the first that rules decides. Counters of a
program are the same on every machine; wall time counts where both sides ran on one machine, one at a time, and beyond
the noise. Counters and a significant change of time that point in opposite directions leave a pair inconclusive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import contradictions, participation
from cpbench.analysis.comparison import gates, noise, pairs, suites, times
from cpbench.analysis.comparison.gates import PairVerdict
from cpbench.analysis.comparison.noise import Noise
from cpbench.analysis.comparison.pairs import Matched
from cpbench.analysis.comparison.suites import Suite
from cpbench.analysis.contradictions import Contradiction
from cpbench.analysis.participation import REFUSED
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.table import counting_stationary
from cpbench.errors import CpbenchError
from cpbench.verification import CONTRADICTION, VERIFIED, Status


@dataclass(frozen=True)
class ComparisonSide:
    """One side: its name, a table (`analysis.table`), and the facts of its file beside the rows.

    A table without times is compared by status, error and counters. `references` are the repeated
    reference solves, `machines` what each host is.
    """

    name: str
    table: pd.DataFrame
    meta: Mapping[str, Any] = field(default_factory=dict)
    machines: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def references(self) -> list[Mapping[str, Any]]:
        return list(self.meta.get("references") or [])


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of a comparison. `margin` : relative change of times; `counter_margin` : of counters. `alpha` :
    level of tests. `same_machine` : the two files are of one machine, whatever it is called in them.
    `count_stationary` : stationary answers are among the solved.
    """

    margin: float = 0.05
    counter_margin: float = 0.05
    alpha: float = 0.05
    same_machine: bool = False
    seed: int = 0
    count_stationary: bool = False


@dataclass(frozen=True, repr=False)
class Comparison:
    """The outcome.

    Attributes
    ----------
    verdict : the worst of all: regressed, else inconclusive, else improved, else same. Pairs that are inconclusive by
        their time alone do not count, their label does. Where no pair was started it is inconclusive.
    pairs : one row a pair: `pairs.Matched.pairs`, `times.COLUMNS`, and the ruling: verdict, gate, kind, why.
    suites : by label. idle : pairs that started on neither side. notes : what else a reader has to know.
    """

    base: ComparisonSide
    new: ComparisonSide
    settings: Thresholds
    verdict: PairVerdict
    pairs: pd.DataFrame
    suites: tuple[Suite, ...]
    noise: Noise
    only_base: pd.DataFrame
    only_new: pd.DataFrame
    changed: tuple[str, ...]
    idle: int
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        counts = self.pairs["verdict"].value_counts()
        pairs = ", ".join(f"{count} {verdict}" for verdict, count in counts.items()) or "no pair"
        return f"Comparison of {self.new.name} with {self.base.name}: {self.verdict} ({pairs})"

    def with_verdict(self, verdict: PairVerdict) -> pd.DataFrame:
        """Return the pairs of a verdict, those decided by status, error or counters before those decided by time."""
        chosen = self.pairs[self.pairs["verdict"] == verdict]
        order = chosen["gate"].map({"status": 0, "error": 1, "counters": 2, "time": 3})
        return chosen.assign(order=order).sort_values(["order", "kind", "problem", "label_new"]).drop(columns="order")

    def became(self, status: str) -> pd.DataFrame:
        """Return the pairs that have this status on the new side, and not on the base."""
        now = (self.pairs["status_new"] == status) & (self.pairs["status_base"] != status)
        return self.pairs[now]

    @property
    def contradictions(self) -> list[Contradiction]:
        """Contradictions of the new side of which the base has none of the kind on that problem; or has one, and a pair
        on that problem has another status now."""
        pairs = self.pairs
        changed = set(pairs.loc[pairs["status_base"] != pairs["status_new"], "fingerprint"])
        before = {(one.kind, one.fingerprint) for one in _contradictions(self.base) if one.fingerprint not in changed}
        return [one for one in _contradictions(self.new) if (one.kind, one.fingerprint) not in before]

    def failures(self, outcomes: Sequence[str]) -> dict[str, int]:
        """Return how often each outcome is there, without those that are not.

        An outcome is `regression` or `inconclusive`, of the whole, `contradiction` (a new one), or a status that a pair
        has now and had not before.
        """
        counts: dict[str, int] = {}
        for name in outcomes:
            if name in ("regression", "inconclusive"):
                counts[name] = int(self.verdict == ("regressed" if name == "regression" else name))
            elif name == CONTRADICTION:
                counts[f"new {name}"] = len(self.contradictions)
            else:
                counts[f"new {name}"] = len(self.became(name))
        return {name: count for name, count in counts.items() if count}


def _contradictions(side: ComparisonSide) -> list[Contradiction]:
    """Return the contradictions that the file of a side keeps and in which its labels have a part."""
    labels = set(side.table["label"])
    return [one for one in contradictions.kept(side.meta) if labels.intersection(one.labels)]


def compare(
    base: ComparisonSide, new: ComparisonSide, settings: Thresholds = Thresholds(), equal: pd.DataFrame | None = None
) -> Comparison:
    """Compare two results files. `equal` : pairs of the same code (`equal_pairs`), which tell the noise.

    Raises CpbenchError where no pair is common.

    >>> rows = pd.DataFrame({"problem": ["p", "q"], "label": "s", "solver": "s", "status": ["solved", "wrong"]})
    >>> old, new = rows, rows.assign(status=["timeout", "wrong"])
    >>> found = compare(ComparisonSide("old", old), ComparisonSide("new", new))
    >>> str(found.verdict), found.pairs["why"].tolist()
    ('regressed', ['solved → timeout', ''])
    """
    return _compare(_prepared(base, settings), _prepared(new, settings), settings, (), equal)


def compare_labels(
    run: ComparisonSide,
    base: str,
    new: str,
    settings: Thresholds = Thresholds(),
    equal: tuple[str, str] | None = None,
) -> Comparison:
    """Compare two solvers, or two labels, of one run: two builds that were interleaved. `equal` : two labels of equal
    code. Raises CpbenchError, UnknownName."""
    run = _prepared(run, settings)
    sides, loose = _sides(run, base, new)
    return _compare(*sides, settings, loose, _equal_pairs(run, equal) if equal else None)


def equal_pairs(run: ComparisonSide, labels: tuple[str, str]) -> pd.DataFrame:
    """Return the pairs of two labels of equal code in a run; raises CpbenchError, UnknownName."""
    return _equal_pairs(_prepared(run), labels)


def _equal_pairs(run: ComparisonSide, labels: tuple[str, str]) -> pd.DataFrame:
    (one, other), loose = _sides(run, *labels)
    result = pairs.match(one.table, other.table, loose).pairs
    if not len(result):
        raise CpbenchError(f"{run.name}: {' and '.join(labels)} have no pair in common: run both on the same problems")
    return result


def _prepared(side: ComparisonSide, settings: Thresholds = Thresholds()) -> ComparisonSide:
    table = counting_stationary(side.table) if settings.count_stationary else side.table
    return replace(side, table=pairs.prepared(table))


def _sides(
    run: ComparisonSide, first: str, second: str
) -> tuple[tuple[ComparisonSide, ComparisonSide], tuple[str, ...]]:
    one, other, loose = pairs.labelled(run.table, first, second)
    return (replace(run, name=first, table=one), replace(run, name=second, table=other)), loose


def _compare(
    base: ComparisonSide, new: ComparisonSide, settings: Thresholds, loose: Sequence[str], equal: pd.DataFrame | None
) -> Comparison:
    matched = pairs.match(base.table, new.table, loose)
    if not len(matched.pairs):
        raise CpbenchError(_nothing_common(base, new))
    started = ~(matched.pairs["status_base"].isin(REFUSED) & matched.pairs["status_new"].isin(REFUSED))
    chosen = matched.pairs[started].reset_index(drop=True)
    interleaved = bool(loose)  # two labels of one run
    one_machine = _one_machine(chosen, base, new, settings, interleaved)
    noise = _noise(base, new, settings, interleaved, equal)
    judged = _judged(chosen, one_machine, noise, settings)
    by_label = suites.by_label(judged, noise, settings.alpha, settings.seed)
    return Comparison(
        base=base,
        new=new,
        settings=settings,
        verdict=_worst(judged, by_label),
        pairs=judged,
        suites=by_label,
        noise=noise,
        only_base=matched.only_base,
        only_new=matched.only_new,
        changed=matched.changed,
        idle=int((~started).sum()),
        notes=(
            *on_publishing([base.table, new.table], [base.meta, new.meta]),
            *on_pairs(judged, matched, int((~started).sum())),
            *on_stationary(judged, settings.count_stationary),
            *on_times(judged, noise, interleaved, bool(one_machine.any())),
        ),
    )


def _one_machine(
    chosen: pd.DataFrame, base: ComparisonSide, new: ComparisonSide, settings: Thresholds, interleaved: bool
) -> pd.Series[bool]:
    if settings.same_machine:
        return pd.Series(True, index=chosen.index)
    if interleaved:
        return chosen["host_base"] == chosen["host_new"]
    return noise.one_machine(chosen, [base.machines, new.machines])


def _noise(
    base: ComparisonSide, new: ComparisonSide, settings: Thresholds, interleaved: bool, equal: pd.DataFrame | None
) -> Noise:
    drift, spread = noise.drift([new.references] if interleaved else [base.references, new.references])
    if base.meta.get("reference") != new.meta.get("reference"):
        drift = math.nan  # another solve, which tells nothing of the machine
    margins = Noise(settings.margin, drift, spread)
    if equal is None:
        return margins
    steady = gates.unsteady(equal, settings.counter_margin)
    seen = times.by_time(equal, equal["host_base"] == equal["host_new"], margins)
    timed = equal.assign(ratio=seen["ratio"])[seen["comparable"]]
    if not len(timed):
        return replace(margins, unsteady=steady)
    mean = suites.mean_ratio(timed["ratio"], timed["family"], timed["fingerprint"], settings.seed)[0]
    far = float(np.exp(np.abs(np.log(timed["ratio"])).max()))
    return replace(margins, equal=max(mean, 1 / mean), stray=max(far, margins.stray), unsteady=steady)


def _judged(chosen: pd.DataFrame, one_machine: pd.Series[bool], noise: Noise, settings: Thresholds) -> pd.DataFrame:
    """Return pairs with what their times say, and their ruling."""
    ruling = gates.rulings(chosen)
    gates.by_status(chosen, ruling, noise.strays)
    gates.by_error(chosen, ruling)
    counted = gates.by_counters(chosen, settings.counter_margin, noise.unsteady)
    timed = times.by_time(chosen, one_machine, noise)
    moved = counted["verdict"].map({str(PairVerdict.REGRESSED): 1, str(PairVerdict.IMPROVED): -1}).fillna(0).astype(int)
    against = (moved * timed["significant"]) < 0
    why = counted["why"].astype(str) + ", but " + timed["time_why"].astype(str)  # of no pairs they are not texts yet
    gates.rule(ruling, "counters", PairVerdict.INCONCLUSIVE, against, "counters against time", why)
    for verdict in (PairVerdict.REGRESSED, PairVerdict.INCONCLUSIVE, PairVerdict.IMPROVED):
        gates.rule(ruling, "counters", verdict, counted["verdict"] == verdict, "counters", counted["why"])
    for verdict in (PairVerdict.REGRESSED, PairVerdict.IMPROVED, PairVerdict.SAME, PairVerdict.INCONCLUSIVE):
        gates.rule(ruling, "time", verdict, timed["time_verdict"] == verdict, "time", timed["time_why"])
    gates.rule(ruling, "counters", PairVerdict.SAME, counted["verdict"] == PairVerdict.SAME, "", "")
    gates.rule(ruling, "status", PairVerdict.SAME, pd.Series(True, index=chosen.index), "", "")
    solved = {f"solved_{side}": chosen[f"status_{side}"].isin(VERIFIED) for side in ("base", "new")}
    return pd.concat([chosen.assign(**solved), timed, ruling], axis=1)


def _worst(judged: pd.DataFrame, by_label: Sequence[Suite]) -> PairVerdict:
    """Return the verdict on the whole: `Comparison.verdict`."""
    if not len(judged):
        return PairVerdict.INCONCLUSIVE
    by_time = judged["gate"] == "time"
    decided = set(judged.loc[~(by_time & (judged["verdict"] == PairVerdict.INCONCLUSIVE)), "verdict"].unique())
    decided |= {str(suite.time) for suite in by_label if suite.time is not None}
    order = (PairVerdict.REGRESSED, PairVerdict.INCONCLUSIVE, PairVerdict.IMPROVED)
    return next((verdict for verdict in order if verdict in decided), PairVerdict.SAME)


def _nothing_common(base: ComparisonSide, new: ComparisonSide) -> str:
    def names(side: ComparisonSide, column: str) -> set[str]:
        return set(side.table[column].dropna().astype(str))

    problems = len(names(base, "fingerprint") & names(new, "fingerprint"))
    solvers = len(names(base, "solver") & names(new, "solver"))
    cause = (
        "they share no problem"
        if not problems
        else f"they share {problems} problems and no solver; two solvers of one run: --a X --b Y"
        if not solvers
        else f"they share {problems} problems and {solvers} solvers, but no options, tolerance, start or threads"
    )
    return (
        f"{base.name} ({len(base.table)} rows) and {new.name} ({len(new.table)} rows) have no pair in common: {cause}; "
        "run both with the same problems and settings"
    )


# ---------------------------------------------------------------------------------------------------------------- notes


def on_publishing(tables: Sequence[pd.DataFrame], metas: Sequence[Mapping[str, Any]]) -> list[str]:
    """Note the solvers whose figures may not be published, which a summary of a CI job does."""
    terms: dict[str, str] = {}
    for table, meta in zip(tables, metas, strict=True):
        terms |= participation.restricted(table, meta.get("solvers") or {})
    return [f"publishing figures of {name} is restricted: {term}" for name, term in sorted(terms.items())]


def on_pairs(judged: pd.DataFrame, matched: Matched, idle: int) -> list[str]:
    """Note what was not compared, and why; `idle` pairs were started on neither side."""
    notes: list[str] = []
    if len(matched.only_base) or len(matched.only_new):
        notes.append(
            f"{len(matched.only_base)} rows are in the base only, {len(matched.only_new)} in the new results only"
        )
    if len(matched.twice):
        notes.append(f"{len(matched.twice)} rows could not be told apart, and were not compared")
    if matched.changed:
        notes.append(
            f"{len(matched.changed)} problems are others under their old names, and were not compared: "
            + ", ".join(matched.changed[:5])
            + (", …" if len(matched.changed) > 5 else "")
        )
    if idle:
        notes.append(f"{idle} pairs were started on neither side")
    if not (judged["solved_base"] & judged["solved_new"]).any():
        notes.append("no pair was solved on both sides: there is nothing to be said of times")
    for column, what in (("seconds", "time"), ("memory", "memory")):
        other = gates.differ(judged, column)
        if other.any():
            notes.append(
                f"{int(other.sum())} pairs were run under another {what} limit: running into it is no change of status"
            )
    return notes


def on_stationary(judged: pd.DataFrame, counted: bool) -> list[str]:
    """Note answers that are stationary only: how many on each side, or that they are `counted` as solved."""
    if counted:
        return ["stationary answers are counted as solved (--count-stationary)"]
    base, new = (int((judged[f"status_{side}"] == str(Status.STATIONARY)).sum()) for side in ("base", "new"))
    return (
        [f"stationary, and not among the solved: {base} in the base, {new} in the new results"] if base or new else []
    )


def on_times(judged: pd.DataFrame, noise: Noise, interleaved: bool, here: bool) -> list[str]:
    """Note how far times can be trusted; `interleaved`: both sides are one run, `here`: some pair is of one machine."""
    timed = judged["ratio"].notna()
    if not timed.any():
        return []
    notes: list[str] = []
    if not here:
        notes.append("times are of two machines: they are told, and decide nothing (--same-machine if it is one)")
        return notes
    beside = int(((judged["jobs_base"] > 1) | (judged["jobs_new"] > 1)).sum())
    if beside:
        notes.append(f"{beside} pairs were timed with other solves beside them (-j): their times decide nothing")
    below = int(judged["below"].sum())
    if below:
        notes.append(f"{below} pairs take less than {FLOOR:g} s on both sides: below the floor, times of calls")
    if not interleaved and math.isnan(noise.drift):
        notes.append("no equal reference solves: nobody knows how much the machine drifted between the two runs")
    elif not interleaved and noise.drift > 1 + noise.margin:
        notes.append(
            f"by its reference solves the machine may differ by a factor {noise.drift:.3g} between the two runs: times "
            "within that are the machine's"
        )
    if math.isfinite(noise.equal):
        notes.append(
            f"equal builds differ by {noise.equal - 1:.1%} in this job: one process beside another is taken to differ "
            f"by {math.expm1(noise.bias):.1%} by itself"
        )
    else:
        notes.append(
            f"no builds of equal code in this job (--noise): one process beside another is assumed to differ by "
            f"{math.expm1(noise.bias):.1%} by itself; where it differs by more, changes are seen that are none"
        )
    if noise.unsteady:
        listed = ", ".join(sorted(f"{name} of {solver}" for solver, name in noise.unsteady)[:4])
        notes.append(f"counters that differ between equal builds were left out: {listed}")
    return notes
