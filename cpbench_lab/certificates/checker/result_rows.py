"""Read the certificates of the rows of a results file (SQLite), and compare each with its row and its answer.

The row says level, distance and a sentence, `answers` has what the solver returned (a compressed .npy), `certificates`
the certificate without its problem, and `proved_problems` the data of each problem once.
"""

from __future__ import annotations

import io
import math
import sqlite3
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from certificate_file import parts, require

Parts = tuple[dict[str, Any], dict[str, Any], Any, dict[str, Any]]
QUERY = (
    "SELECT rows.problem, label, fingerprint, certainty, distance, certificate,"
    " CAST(answer AS BLOB), CAST(proof AS BLOB), CAST(data AS BLOB) FROM rows"
    " LEFT JOIN answers USING (key)"
    " LEFT JOIN (SELECT key, proof FROM certificates WHERE kind = 'answer') USING (key)"
    " LEFT JOIN proved_problems USING (fingerprint)"
    " WHERE certainty IN ('proved', 'enclosed', 'stationary', 'distant', 'refuted') OR proof IS NOT NULL"
    " OR certificate LIKE '%solution%' ORDER BY rows.rowid"
)


def is_results_file(path: str) -> bool:
    """Return whether a file is one of SQLite."""
    with Path(path).open("rb") as file:
        return file.read(16) == b"SQLite format 3\0"


def rows(path: str) -> Iterator[tuple[str, Callable[[], Parts]]]:
    """Yield the name of every row that says more than that its answer was measured, and what reads its certificate."""
    with closing(sqlite3.connect(f"{Path(path).resolve().as_uri()}?mode=ro", uri=True)) as db:
        for problem, label, *values in db.execute(QUERY):
            yield f"{path}: {problem}  {label}", lambda values=values: certificate(*values)


def certificate(
    fingerprint: str,
    level: str,
    distance: float | None,
    words: str | None,
    answer: bytes | None,
    proof: bytes | None,
    data: bytes | None,
) -> Parts:
    """Return the certificate of a row; raises ValueError where it is not what the row says, or of another answer."""
    if proof is None or data is None or answer is None:
        raise ValueError(f"no {'proof' if proof is None else 'problem' if data is None else 'answer'} is kept")
    with h5py.File(io.BytesIO(proof), "r") as own_file, h5py.File(io.BytesIO(data), "r") as data_file:
        own, problem, vector, evidence = parts(own_file["certificate"], data_file["data"])
    require(own["fingerprint"] == fingerprint, "the certificate is of another problem")
    require(own["level"] == level, f"the row says {level}, its certificate {own['level']}")
    known = float(own["distance"]) if math.isfinite(own["distance"]) else None
    require(known == distance, "the row has another distance than its certificate")
    given = np.load(io.BytesIO(zlib.decompress(answer)), allow_pickle=False)
    require(np.array_equal(given, vector, equal_nan=True), "the certificate is of another answer")
    require(said(own, evidence) == list(_facts(words or "")), "the row says something else than its certificate")
    return own, problem, vector, evidence


def said(own: dict[str, Any], evidence: dict[str, Any]) -> list[str]:
    """Return what a row says of a certificate, in its words."""
    count, with_its = float(own["solutions"]), own["node"] in ("qp", "avi") and "direction" not in evidence
    found = [f"unique: {own['unique']}"] if own["unique"] else []
    if math.isinf(count):
        found.append("a continuum of solutions")
    elif not math.isnan(count) and not own["unique"]:
        none = "there is no solution: all complementary bases were looked at"
        found.append(f"{count:.0f} solutions, all listed" if count else none)
    if own["excluded"]:
        its = " with its multipliers" if with_its else ""
        found.append(f"no solution is within {own['excluded']:.2g} of the answer's size{its}")
    return found


def _facts(words: str) -> Iterator[str]:
    """Yield what is said of solutions; not what stops a proof, which nothing rests on."""
    for part in words.split("; "):
        starts = ("unique", "there is no solution", "no solution is within", "a continuum")
        if part.startswith(starts) or part.endswith(", all listed"):
            yield part
