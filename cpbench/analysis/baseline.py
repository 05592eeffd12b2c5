"""A run as sorted text for version control: what should stay the same from run to run, and nothing else.

One line a measured pair, identified by `KEY`; no times, no machine, no date, so that a difference of two such texts is
a difference of outcomes. What depends on rounding is written coarsely:

- the error as a power of ten at or above it; within the tolerance only that it is (``<=1e-06``), because how far
  below an iteration ends is chance: the same code on another BLAS kernel moves it by decades.
- counters of verified answers only: how long a failure took does not matter.

Pairs whose solver was not there, or that were not run, have no line: that is about the machine.
"""

from __future__ import annotations

import csv
import io
import json
import re
from urllib.parse import quote, unquote

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.baseline_lines import COLUMNS, KEY, PLACE, UNMEASURED, check
from cpbench.errors import FormatError, StoreError
from cpbench.solvers.renamed import current_label
from cpbench.verification import Status

VERSION = 1
HEADER = (
    f"# cpbench baseline {VERSION}: cpbench baseline RESULTS -o FILE writes it, --update brings it up to date; "
    "error: power of ten at or above it; known: why a failure is known, by hand, kept"
)
SHORT = 12
"""Digits of a fingerprint that are written; a name, where there is no digest, is written whole."""
EXACT = "exact"
"""The request that a label does not mention."""
FOLLOWED = "previous"
"""The start by which a problem's place in its sequence belongs to the pair."""
GIVEN_UP = (str(Status.FAILED), str(Status.ERROR))
"""Statuses whose error may be anything: such a solver has not answered."""
_READ = (
    "node", "request", "start", "sequence", "claim", "status", "step", "tolerance", "threads", "measure", "error",
    "counters",
)  # fmt: skip


def outcomes(table: pd.DataFrame) -> pd.DataFrame:
    """Return the outcomes of a table of results: text in every column of `COLUMNS`, unmeasured pairs included.

    Raises StoreError when two rows tell of one pair.

    >>> rows = pd.DataFrame({"problem": ["p"], "fingerprint": ["0123456789abcdef"], "label": ["pgs@inner8"],
    ...     "request": ["inner8"], "tolerance": [1e-6], "threads": [1], "status": ["solved"], "error": [3e-9],
    ...     "counters": ['{"iterations": 7}']})
    >>> outcomes(rows).loc[0, ["fingerprint", "solver", "route", "error", "counters"]].tolist()
    ['0123456789ab', 'pgs', 'inner8', '<=1e-06', 'iterations=7']
    """
    rows = rows_of.normalised(table, _READ)
    request = rows["request"].where(rows["request"] != "", EXACT)
    followed = (rows["start"] == FOLLOWED) & (rows["sequence"] != "")
    answered = (rows["claim"] != "") & ~rows["status"].isin(GIVEN_UP)
    tolerances = {t: repr(float(t)) for t in rows["tolerance"].dropna().unique()}
    threads = rows["threads"].fillna(1).astype(int)
    place = pd.Series("", index=rows.index, dtype=object)
    steps = rows.loc[followed, ["sequence", "step"]]
    numbers = steps["step"].fillna(0).astype(int).astype(str)
    place[followed] = (steps["sequence"].astype(str) + "#" + numbers).astype(object)
    plain = pd.DataFrame(
        {
            "node": rows["node"],
            "problem": rows["problem"],
            "fingerprint": rows["fingerprint"].map({f: _short(f) for f in rows["fingerprint"].unique()}),
            "solver": _without_request(rows["label"], request),
            "route": request,
            "tolerance": rows["tolerance"].map(tolerances).fillna(""),
            "start": rows["start"],
            "threads": threads.map({n: str(n) for n in threads.unique()}),
            "measure": rows["measure"],
            "sequence": place,
            "status": rows["status"],
            "error": decades(rows["error"], rows["tolerance"]).where(answered | rows_of.met(rows), ""),
            "counters": _written(rows["counters"]).where(rows_of.met(rows), ""),
        }
    )
    return _ordered(plain.assign(known="").astype(object), "the results")


def text(lines: pd.DataFrame) -> str:
    """Format the measured lines as they are kept, sorted: the same bytes for the same lines in any order."""
    kept = _ordered(lines[~lines["status"].isin(UNMEASURED)], "the baseline")
    written = io.StringIO()
    written.write(f"{HEADER}\n")
    kept.to_csv(written, columns=list(COLUMNS), index=False, lineterminator="\n")
    return written.getvalue()


def parse(content: str, place: str) -> pd.DataFrame:
    """Parse the lines of a kept text; `place` is the name of its file in messages.

    Raises FormatError with the line number: what is written by hand may be anything.
    """
    head, _, body = content.removeprefix("\ufeff").partition("\n")
    heading = re.match(r"# cpbench baseline (\d+)\b", head)
    if heading is None:
        raise FormatError(place, "line 1", "is not a baseline; cpbench results baseline RESULTS -o FILE writes one")
    if int(heading[1]) != VERSION:
        raise FormatError(place, "line 1", f"is a baseline of version {heading[1]}, this program reads {VERSION}")
    reader = csv.reader(io.StringIO(body), strict=True)
    found: list[list[str]] = []
    numbers: list[int] = []
    while True:
        number = reader.line_num + 2
        try:
            cells = next(reader, None)
        except csv.Error as cause:
            raise FormatError(place, f"line {number}", f"is not a line of a table ({cause})") from None
        if cells is None:
            break
        if number == 2:
            if tuple(cells) != COLUMNS:
                raise FormatError(place, "line 2", f"is {','.join(cells)[:80]!r}, expected {','.join(COLUMNS)}")
        elif cells:
            check(cells, place, number)
            found.append(cells)
            numbers.append(number)
    if not body:
        raise FormatError(place, "line 2", f"is not there, expected {','.join(COLUMNS)}")
    lines = pd.DataFrame(found, columns=list(COLUMNS), dtype=object)
    lines["solver"] = lines["solver"].map(current_label).astype(object)
    twice = lines.duplicated(list(KEY)).to_numpy()
    if twice.any():
        second = int(np.flatnonzero(twice)[0])
        first = int(np.flatnonzero((lines[list(KEY)] == lines.loc[second, list(KEY)]).all(axis=1))[0])
        cause = f"tells of the same pair as line {numbers[first]}; remove one of them"
        raise FormatError(place, f"line {numbers[second]}", cause)
    return _ordered(lines, place)


def as_table(lines: pd.DataFrame, like: pd.DataFrame | None = None) -> pd.DataFrame:
    """Return the lines in the columns of `table.normalised`: status, error (the upper end of its decade), counters;
    no times.

    `like` : the results it will be compared with: whole fingerprints, and the options of a label, are taken from them.

    >>> run = pd.DataFrame({"problem": ["p"], "fingerprint": ["0123456789abcdef"], "solver": ["pgs"],
    ...     "label": ["pgs[w=1]"], "options": ['{"w": 1}'], "tolerance": [1e-6], "status": ["wrong"],
    ...     "claim": ["solved"], "error": [0.2]})
    >>> as_table(parse(text(outcomes(run)), "b.csv"), run)[["fingerprint", "label", "options", "error"]].values.tolist()
    [['0123456789abcdef', 'pgs[w=1]', '{"w": 1}', 1.0]]
    """
    other = rows_of.normalised(pd.DataFrame(columns=list(rows_of.TEXT)) if like is None else like)
    whole = {_short(fingerprint): fingerprint for fingerprint in other["fingerprint"].unique()}
    known = {row[0]: row[1:] for row in other[["label", "solver", "options"]].drop_duplicates().itertuples(index=False)}
    label = labels(lines)
    named = [known.get(name, (name.partition("[")[0].partition("@")[0], "{}")) for name in label.astype(str)]
    places = [place.rpartition("#") for place in lines["sequence"].astype(str)]
    tolerance = pd.to_numeric(lines["tolerance"].where(lines["tolerance"] != "", "nan")).astype(float)
    frame = pd.DataFrame(
        {
            "key": ["\n".join(key) for key in lines[list(KEY)].itertuples(index=False, name=None)],
            "problem": lines["problem"],
            "node": lines["node"],
            "fingerprint": [whole.get(short, short) for short in lines["fingerprint"].astype(str)],
            "solver": [solver for solver, _ in named],
            "options": [options for _, options in named],
            "label": label,
            "request": lines["route"],
            "tolerance": tolerance,
            "start": lines["start"],
            "threads": lines["threads"],
            "measure": lines["measure"],
            "sequence": [name for name, _, _ in places],
            "step": [step or "0" for *_, step in places],
            "status": lines["status"],
            "error": bounds(lines["error"]),
            "counters": [json.dumps(counters(written)) for written in lines["counters"]],
        }
    )
    return rows_of.normalised(frame)


def labels(lines: pd.DataFrame) -> pd.Series[str]:
    """Return the label of the solver of each line: with its options, and its route."""
    return lines["solver"].where(lines["route"] == EXACT, lines["solver"] + "@" + lines["route"])


def counters(written: str) -> dict[str, int]:
    """Parse counters as they are written, by name.

    >>> counters("inner%20steps=3 iterations=7")
    {'inner steps': 3, 'iterations': 7}
    """
    pairs = (item.rpartition("=") for item in written.split())
    return {unquote(name): int(count) for name, _, count in pairs}


def decades(error: pd.Series[float], tolerance: pd.Series[float]) -> pd.Series[str]:
    """Write each error as a power of ten at or above it, or as within the tolerance.

    >>> decades(pd.Series([2e-13, 3e-4, np.inf]), pd.Series([1e-6] * 3)).tolist()
    ['<=1e-06', '1e-03', 'inf']
    """
    finite = np.isfinite(error) & (error > 0)
    # a power of ten is its own decade, whatever its logarithm is rounded to
    above = np.ceil(np.log10(error.where(finite, 1.0).to_numpy(dtype=float)) - 1e-12)
    exponent = pd.Series(above.astype(int), index=error.index)
    plain = exponent.map({k: f"1e{k:+03d}" for k in exponent.unique()}).astype(object)
    plain = plain.where(np.isfinite(error), "inf")
    within = error <= tolerance
    bound = tolerance.map({t: f"<={t:.6g}" if "e" in f"{t:.6g}" else f"<={t:.0e}" for t in tolerance.unique()})
    return plain.mask(within, bound).astype(object)


def bounds(written: pd.Series[str]) -> pd.Series[float]:
    """Return the upper end of each written error, ∞ where there is none."""
    numbers = {text: float(text.removeprefix("<=") or "inf") for text in written.unique()}
    return written.map(numbers).astype(float)


# ------------------------------------------------------------------------------------------------ pieces


def _short(fingerprint: str) -> str:
    return fingerprint[:SHORT] if re.fullmatch(r"[0-9a-f]{16,}", fingerprint) else fingerprint


def _without_request(names: pd.Series[str], request: pd.Series[str]) -> pd.Series[str]:
    both = pd.DataFrame({"name": names, "asked": request})
    pairs = both.drop_duplicates()
    plain = [name.removesuffix(f"@{requested}") for name, requested in pairs.itertuples(index=False, name=None)]
    return both.merge(pairs.assign(plain=plain), how="left").set_axis(names.index)["plain"].astype(object)


def _written(column: pd.Series[str]) -> pd.Series[str]:
    """Write counters as words, a name never being two of them."""

    def words(written: str) -> str:
        counts: dict[str, int] = json.loads(written) if written else {}
        return " ".join(f"{quote(name, safe='')}={count}" for name, count in sorted(counts.items()))

    return column.map({written: words(written) for written in column.unique()}).astype(object)


def _ordered(lines: pd.DataFrame, place: str) -> pd.DataFrame:
    """Sort lines by problem, then solver; the key breaks ties, so that the order is total."""
    twice = lines.duplicated(list(KEY))
    if twice.any():
        row = lines[twice].iloc[0]
        raise StoreError(
            f"{place}: {row['problem']}, {row['solver']}: two rows of one pair; merge runs with cpbench results merge"
        )
    return lines.sort_values([*PLACE, *KEY], kind="stable", ignore_index=True)
