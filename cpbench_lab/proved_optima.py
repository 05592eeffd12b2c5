"""A table of what is proved of every problem in a folder: optimal values, solutions, or that there are none.

`table.csv` has a row a problem, and `certificates/` what proves each again without cpbench:

    problem, fingerprint, formulation, unknowns
    level          proved or enclosed (a solution), stationary (a program that is not convex), infeasible, unbounded,
                   open, unreadable
    low, high      doubles around the objective of a quadratic program at the exact solution, with the constant and the
                   sense of its file
    bare_low, bare_high  the same of ½zᵀQz + pᵀz alone, which `cpbench run` compares answers with
    convex, unique facts that make it the least value, and the solution the only one; empty where none was found
    distance       of the answer in the certificate from a solution, over the size of that, at most
    published, off a value of others, and its distance from [low, high] in units of its last digit
    seconds, text  of the search; what stops a proof, or else is known

Values that differ from published ones come first. A problem whose row is there is not looked at again, so that a long
search may be interrupted.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeAlias

import pandas as pd

from cpbench import storage
from cpbench.errors import CpbenchError, FormatError
from cpbench.formulations.base import Problem
from cpbench.foundation.text import counted
from cpbench.generators.collection import unknowns
from cpbench.report import row_files
from cpbench.storage.base import SENSE, offset, require_folder
from cpbench_lab.certificate_text import summary
from cpbench_lab.certifying import certify_first, require_flint, save_certificate

COLUMNS = (
    "problem", "fingerprint", "formulation", "unknowns", "level", "low", "high", "bare_low", "bare_high",
    "convex", "unique", "distance", "published", "off", "seconds", "text",
)  # fmt: skip
VALUES = ("low", "high", "bare_low", "bare_high", "distance")
SETTLED = ("proved", "enclosed", "stationary", "infeasible", "unbounded")
"""Levels of certificates that say something of the problem; `distant` and `refuted` ones are of an answer."""
Row: TypeAlias = dict[str, Any]


def certify_folder(
    folder: Path, output: Path, seconds: float, tolerance: float, published: Mapping[str, str]
) -> Iterator[str]:
    """Look for a certificate of each problem in a folder; yields a line for each, at last what is proved of all.

    output : a folder, with the table and the certificates. seconds : limit of each search [s]. tolerance : distance
    from a solution up to which an answer is that solution. published : optimal values (`published_values`).

    Raises CpbenchError without python-flint, FormatError where the folder has no problem or nothing can be written.
    """
    require_flint()
    addresses = storage.problem_files([folder])
    if not addresses:
        raise FormatError(folder, "", "no file in this folder is a problem in a known format")
    table, certificates = output / "table.csv", output / "certificates"
    require_folder(certificates)
    rows = _read(table)
    for address in addresses:
        name = str(Path(address).relative_to(folder))
        row = rows.get(name)
        if row is None:
            row = {"problem": name} | _looked_at(address, certificates, seconds, tolerance)
            value = "" if math.isnan(row["low"]) else f", value {row['low']:.12g}"
            yield f"{name}  {row['level']}{value}, {row['seconds']:.3g} s" + (
                f" ({row['text']})" if row["text"] else ""
            )
        rows[name] = row | _beside(row, published.get(_plain(name), row.get("published", "")))
        # what differs most from what is published comes first
        order = sorted(rows.values(), key=lambda row: (-row["off"] if row["off"] > 1 else 0.0, row["problem"]))
        row_files.write(pd.DataFrame(order, columns=list(COLUMNS)), table)
    levels = pd.Series([row["level"] for row in rows.values()]).value_counts()
    yield f"{counted(len(rows), 'problem')}: " + ", ".join(f"{count} {level}" for level, count in levels.items())
    for row in sorted((row for row in rows.values() if row["off"] > 1), key=lambda row: -row["off"]):
        yield f"  {row['problem']}: published {row['published']}, proved {row['low']:.12g}"


def published_values(path: Path) -> dict[str, str]:
    """Read optimal values of others: the columns `problem` and `value` of a .csv file; raises FormatError."""
    try:
        table = pd.read_csv(path, dtype=str, comment="#")
        return {_plain(name): value for name, value in zip(table["problem"], table["value"], strict=True)}
    except (OSError, ValueError, KeyError) as cause:
        raise FormatError(path, "", f"is no table with the columns problem and value ({cause})") from None


def _plain(name: str) -> str:
    """Return a problem's name without folder, suffix, case and signs, as sets spell it in several ways."""
    return re.sub(r"[^a-z0-9]", "", Path(name).stem.lower())


def _read(table: Path) -> dict[str, Row]:
    """Return the rows of a table that is there, by problem; raises FormatError where it has other columns."""
    if not table.is_file():
        return {}
    numbers = {*VALUES, "off", "seconds"}
    texts = [name for name in COLUMNS if name not in numbers]
    read = pd.read_csv(table, dtype=dict.fromkeys(texts, str), float_precision="round_trip").fillna(
        dict.fromkeys(texts, "")
    )
    if tuple(read.columns) != COLUMNS:
        raise FormatError(table, "", f"expected the columns {', '.join(COLUMNS)}")
    read["published"] = read["published"].str.removeprefix("'")  # which keeps spreadsheets from reading -1 as a formula
    return {row["problem"]: {str(name): value for name, value in row.items()} for row in read.to_dict("records")}


def _looked_at(address: str, certificates: Path, seconds: float, tolerance: float) -> Row:
    """Return what is proved of a problem, and keep its certificate."""
    none = dict.fromkeys(VALUES, math.nan) | {"convex": "", "unique": "", "seconds": 0.0}
    try:
        problem = storage.load(address)
    except FormatError as cause:
        unread = {"fingerprint": "", "formulation": "", "unknowns": 0}
        return none | unread | {"level": "unreadable", "text": cause.cause}
    row = {**none, "fingerprint": problem.fingerprint, "formulation": problem.node, "unknowns": unknowns(problem)}
    try:
        certificate = certify_first(problem, seconds, tolerance)[1]
    except CpbenchError as cause:
        return {**row, "level": "open", "text": str(cause)}
    row |= {"level": "open", "seconds": round(certificate.seconds, 2), "text": summary(certificate)}
    if certificate.level not in SETTLED:
        return row
    save_certificate(certificate, problem, certificates / f"{problem.fingerprint}.h5", force=True)
    bare = certificate.value_low, certificate.value_high
    values = dict(zip(VALUES, (*_of_file(problem, *bare), *bare, certificate.distance), strict=True))
    return row | values | {"level": certificate.level, "convex": certificate.convex, "unique": certificate.unique}


def _of_file(problem: Problem, low: float, high: float) -> tuple[float, float]:
    """Return doubles around the value with the constant and the sense of the problem's file."""
    constant = offset(problem.info)
    if math.isfinite(low) and math.isfinite(high):
        low, high = _sum(low, constant, -math.inf), _sum(high, constant, math.inf)
    return (-high, -low) if problem.info.properties.get(SENSE) == "max" else (low, high)


def _sum(value: float, constant: float, side: float) -> float:
    """Return value + constant, on this side of it where it is no double."""
    total = value + constant
    whole = Fraction(total) == Fraction(value) + Fraction(constant)
    return total if whole else math.nextafter(total, side)


def _beside(row: Row, published: str) -> Row:
    """Return a published value, and how far it is from the proved one in units of its last digit."""
    if not published or math.isnan(row["low"]):
        return {"published": published, "off": math.nan}
    mantissa, _, exponent = published.lower().partition("e")
    unit, value = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2])), float(published)
    return {"published": published, "off": round(max(row["low"] - value, value - row["high"], 0.0) / unit, 2)}
