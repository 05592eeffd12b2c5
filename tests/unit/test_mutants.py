"""Damaged files of every format: each is refused in one line or read, and none of cpbench's own with other numbers."""

from __future__ import annotations

import json
import random
import signal
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cpbench
from cpbench.bench.planning.plan import Entry, Limits, Pair, Request
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.sealed import sealed
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError

OWN = ("h5", "sqlite")
"""Suffixes of formats with a checksum."""
HANGS = 20
"""Seconds after which a reader of a file of some kilobytes hangs."""
INSERTED = (b"\0" * 31, b"8" * 350, b"-3", b"nan", b"1e888", b"\xfe" * 12, b"{{" * 40, b"\x1b[32m")


def _mutant(whole: bytes, draw: random.Random) -> bytes:
    """Flip a bit, overwrite, cut short, copy, insert, or leave out."""
    spoiled, place = bytearray(whole), draw.randrange(len(whole))
    kind = draw.randrange(6)
    if kind == 0:
        spoiled[place] ^= 1 << draw.randrange(8)
    elif kind == 1:
        for _ in range(10):
            spoiled[draw.randrange(len(whole))] = draw.randrange(256)
    elif kind == 2:
        del spoiled[place:]
    elif kind == 3:
        source, size = draw.randrange(len(whole)), draw.randrange(1, 160)
        spoiled[place : place + size] = spoiled[source : source + size]
    elif kind == 4:
        spoiled[place:place] = draw.choice(INSERTED)
    else:
        del spoiled[place : place + draw.randrange(1, 1500)]
    return bytes(spoiled)


def _problem() -> cpbench.Problem:
    draw = np.random.default_rng(36)
    half = draw.normal(size=(6, 6))
    return cpbench.LCP(M=half @ half.T + 4.0 * np.eye(6), q=draw.normal(size=6) * 3.0, name="six")


def _seed(folder: Path, suffix: str) -> Path:
    path = folder / f"seed.{suffix}"
    if suffix == "npz":
        np.savez(path, M=_problem().data()["M"], q=_problem().data()["q"])
    elif suffix == "sqlite":
        limits, request = Limits(10.0, 2**30, 1, 1), Request("exact")
        pairs = [
            Pair(
                address="six.h5", problem="six", fingerprint="6" * 64, node="lcp", family="", sizes={"n": 6},
                request=request, entry=Entry(name), target="lcp", tolerance=1e-6, limits=limits,
            )
            for name in ("lemke", "bpp", "pgs")
        ]  # fmt: skip
        with Store(path, create=True) as store:
            store.plan(pairs)
            store.set_meta(command="cpbench run six.h5", machine={"cpu": "z"})
            for k, pair in enumerate(pairs):
                store.finish(pair.key, Outcome(status="solved", error=1e-9, solve=0.1 * (k + 1), answer=b"six" * 9))
            store.end()
            store.settle()
    else:
        cpbench.save(_problem(), path)
    return path


def _content(path: Path) -> Any:
    if path.suffix == ".sqlite":
        with sealed(path) as store:
            return json.dumps(
                [list(map(repr, store.rows())), store.meta()["command"], list(map(repr, store.answers()))]
            )
    return cpbench.load(path).fingerprint


def _read(path: Path, content: Callable[[Path], Any]) -> Any:
    """Return the content; None where the file is refused in one line, the refusal where it has more."""
    signal.alarm(HANGS)
    try:
        return content(path)
    except CpbenchError as refusal:
        return str(refusal) if "\n" in str(refusal) else None
    finally:
        signal.alarm(0)


@pytest.mark.skipif(not hasattr(signal, "alarm"), reason="does not apply: no alarm on this system")
@pytest.mark.parametrize("count", [12, pytest.param(200, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("suffix", ["h5", "npz", "sqlite", "mof.json", "dat"])
def test_damaged_files_are_refused_or_read(suffix: str, count: int, tmp_path: Path) -> None:
    try:
        seed = _seed(tmp_path, suffix)
    except CpbenchError as refusal:
        pytest.skip(f"does not apply: {refusal}")
    whole, before, draw = seed.read_bytes(), _read(seed, _content), random.Random(f"36 {suffix}")
    counts: Counter[str] = Counter()
    for k in range(count):
        path = tmp_path / f"{k}.{suffix}"
        path.write_bytes(_mutant(whole, draw))
        found = _read(path, _content)
        assert "\n" not in str(found)
        counts["refused" if found is None else "same" if found == before else "other"] += 1
        for left in tmp_path.glob(f"{k}.*"):
            left.unlink()
    assert sum(counts.values()) == count
    assert counts["refused"] > count // 4
    if suffix in OWN:
        assert not counts["other"], counts
