"""Training cases of a recommendation: problems with their features, and the result of each label on them.

An outcome is a time [s], ∞ for a label that was started and did not solve the problem (a claim that is false is a
failure, however fast), NaN for one that was not started: no route, refused, not installed. Times are compared within
one *case* only: a problem at one tolerance, with one number of threads, by one measure, on one machine.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.resources import files
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.origins import family_of, origins
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.sizes import sizes_read
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Kind
from cpbench.verification import Status

NEVER_STARTED = (str(Status.UNSUPPORTED), str(Status.UNAVAILABLE))
SHIPPED = "recommendation_table.json"
TEXT_VERSION = 1
DIGITS = 3
"""Significant digits of a number in the text: times differ by more from run to run."""
_READ = (
    "fingerprint", "tolerance", "threads", "measure", "start", "host", "label", "request", "kind", "status", "started",
    "problem", "node", "family", "sizes", *rows_of.CHARGED,
)  # fmt: skip
_INEXACT = [str(kind) for kind in Kind if not kind.exact]


@dataclass(frozen=True)
class TrainingCase:
    """A problem under one setting: its features and outcomes by label [s]."""

    problem: str
    node: str
    family: str
    fingerprint: str
    features: Mapping[str, Any]
    outcomes: Mapping[str, float]


@dataclass(frozen=True)
class TrainingCases:
    """Cases that some label solved, in order; `unsolved` counts those without, which rank no label.

    `unfinished` counts the problems that were left out because some of their pairs were not run yet; `requests` says
    how labels were reached, where not by an exact route that was found for them.
    """

    cases: tuple[TrainingCase, ...]
    unsolved: int = 0
    unfinished: int = 0
    requests: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Every label that was started on some case, sorted."""
        return tuple(sorted({label for case in self.cases for label in case.outcomes}))

    @cached_property
    def ratios(self) -> rows_of.Floats:
        """Time over the virtual best, cases × labels; ∞ where it failed, NaN where it was not started."""
        place = {label: j for j, label in enumerate(self.labels)}
        times = np.full((len(self.cases), len(place)), math.nan)
        for i, case in enumerate(self.cases):
            for label, seconds in case.outcomes.items():
                times[i, place[label]] = max(seconds, FLOOR)
        return times / np.fmin.reduce(times, axis=1, initial=math.inf)[:, None]

    @cached_property
    def nodes(self) -> rows_of.Texts:
        return np.array([case.node for case in self.cases], dtype=object)

    @cached_property
    def origins(self) -> rows_of.Texts:
        """Origin of each case: the cases of one origin are left out together."""
        families, prints = ([getattr(case, name) for case in self.cases] for name in ("family", "fingerprint"))
        return np.array(origins(families, prints), dtype=object)


def collect_cases(
    table: pd.DataFrame,
    features: Mapping[str, Mapping[str, Any]],
    *,
    warm: bool = False,
    inexact: bool = False,
) -> TrainingCases:
    """Collect the cases of a normalised table of results whose rows were all run.

    Parameters
    ----------
    features : of the problems, by fingerprint; one that is not there has its node and sizes.
    warm : rows that began from a point instead of those that began cold; one that fell back to a cold start is none.
    inexact : labels, too, that some route led to which promises less than an answer.

    >>> rows = {"problem": "p", "fingerprint": "f", "node": "lcp", "label": ["a", "b", "c"], "start": "cold",
    ...         "status": ["solved", "wrong", "unsupported"], "solve": [0.5, 0.1, None], "sizes": '{"n": 3}'}
    >>> found = collect_cases(rows_of.normalised(pd.DataFrame(rows)), {})
    >>> found.cases[0].outcomes, dict(found.cases[0].features)
    ({'a': 0.5, 'b': inf}, {'node': 'lcp', 'n': 3.0})
    """
    chosen = table.loc[(table["origin"] == "") & ((table["start"] != "cold") == warm), list(_READ)]
    if not inexact:
        weak = set(chosen.loc[chosen["kind"].isin(_INEXACT), "label"])
        chosen = chosen[~chosen["label"].isin(weak)]
    setting = ["fingerprint", "tolerance", "threads", "measure", "start"]
    waiting = chosen["status"] == str(Status.NOT_RUN)
    of_setting = chosen.groupby(setting, dropna=False, sort=False).ngroup()
    left = of_setting.isin(of_setting[waiting].unique())
    unfinished = chosen.loc[left, "fingerprint"].nunique()
    began = ~chosen["status"].isin(NEVER_STARTED) & ~left
    if warm:
        began &= ~chosen["started"].str.startswith("cold")
    timed = rows_of.with_time(chosen[began]).drop_duplicates([*setting, "host", "label"])
    cases = list(_cases(timed, [*setting, "host"], features))
    solved = tuple(case for case in cases if any(map(math.isfinite, case.outcomes.values())))
    by_label = chosen.drop_duplicates("label")
    requests = {
        str(k): str(r) for k, r in zip(by_label["label"], by_label["request"], strict=True) if r not in ("", "exact")
    }
    return TrainingCases(solved, len(cases) - len(solved), unfinished, requests)


def _cases(
    timed: pd.DataFrame, setting: Sequence[str], features: Mapping[str, Mapping[str, Any]]
) -> Iterator[TrainingCase]:
    """Yield the cases of rows that were run, in order of appearance; features are taken from a problem's first row."""
    number = timed.groupby(list(setting), dropna=False, sort=False).ngroup().to_numpy()
    rows = timed.iloc[np.argsort(number, kind="stable")]
    counts = np.bincount(number)
    ends = np.cumsum(counts)
    begins = ends - counts
    first = rows.iloc[begins]
    place, sizes = sizes_read(first)
    columns = [first[name].tolist() for name in ("problem", "node", "family", "fingerprint")]
    labels, seconds = rows["label"].tolist(), rows["time"].tolist()
    for problem, node, family, fingerprint, size, begin, end in zip(
        *columns, place, begins.tolist(), ends.tolist(), strict=True
    ):
        facts = features.get(fingerprint) or {"node": node, **sizes[size]}
        outcomes = dict(zip(labels[begin:end], seconds[begin:end], strict=True))
        yield TrainingCase(problem, node, family_of(family, problem), fingerprint, facts, outcomes)


# ------------------------------------------------------------------------------------------------ text


def to_text(found: TrainingCases, without: Iterable[str] = (), about: str = "") -> str:
    """Write the cases as JSON of three lines a case, sorted, with numbers of DIGITS digits: a table to ship.

    Labels in `without` are left out; a failure is null. Cases that nobody else solved are left out with them.
    """
    hidden = set(without)
    blocks: list[str] = []
    for case in sorted(found.cases, key=lambda case: (case.node, case.family, case.problem, case.fingerprint)):
        seconds = {k: v for k, v in sorted(case.outcomes.items()) if k not in hidden}
        if not any(map(math.isfinite, seconds.values())):
            continue
        identity = {"node": case.node, "family": case.family, "problem": case.problem, "fingerprint": case.fingerprint}
        facts = {k: _rounded(v) for k, v in sorted(case.features.items()) if not isinstance(v, str)}
        times = {k: _rounded(v) if math.isfinite(v) else None for k, v in seconds.items()}
        lines = (json.dumps(identity)[:-1], f'"features": {json.dumps(facts)}', f'"seconds": {json.dumps(times)}}}')
        blocks.append(",\n ".join(lines))
    head = {"version": TEXT_VERSION, "about": about, "unsolved": found.unsolved}
    return json.dumps(head)[:-1] + ', "cases": [\n' + ",\n".join(blocks) + "\n]}\n"


def from_text(text: str, name: str) -> TrainingCases:
    """Read the cases that `to_text` wrote; `name` tells in the error where the text is from.

    Raises CpbenchError when it is none, or of another version.
    """
    try:
        data = json.loads(text)
        if data["version"] != TEXT_VERSION:
            raise CpbenchError(
                f"{name}: is a table of version {data['version']}, this cpbench reads {TEXT_VERSION}; make it again "
                "with: cpbench recommend --make TABLE --results FILE"
            )
        cases = [_case(item) for item in data["cases"]]
        solved = tuple(case for case in cases if any(map(math.isfinite, case.outcomes.values())))
        return TrainingCases(solved, int(data["unsolved"]) + len(cases) - len(solved))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as cause:
        raise CpbenchError(
            f"{name}: is no table of recommendations ({type(cause).__name__}: {cause}); make one with: cpbench "
            "recommend --make TABLE --results FILE"
        ) from None


def shipped_cases() -> TrainingCases:
    """Return what the built-in problems came to where this version was made."""
    return from_text(files("cpbench.analysis").joinpath(SHIPPED).read_text(encoding="utf-8"), SHIPPED)


def _case(item: Mapping[str, Any]) -> TrainingCase:
    problem, node, family, fingerprint = (str(item[name]) for name in ("problem", "node", "family", "fingerprint"))
    facts = {str(k): float(v) for k, v in item["features"].items()}
    times = {str(k): math.inf if v is None else float(v) for k, v in item["seconds"].items()}
    return TrainingCase(problem, node, family, fingerprint, {"node": node, **facts}, times)


def _rounded(value: float) -> float:
    """Round to DIGITS significant digits, whole numbers not at all."""
    rounded = value if float(value).is_integer() else float(f"{value:.{DIGITS}g}")
    return int(rounded) if float(rounded).is_integer() and abs(rounded) < 2**53 else rounded
