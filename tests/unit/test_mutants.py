"""Damaged files of every format: each is refused in one line or read, and none of cpbench's own with other numbers."""

from __future__ import annotations

import json
import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from damage import read_or_refused, rearranged, spoiled
from nl_files import binary
from synthetic_results import pair

import cpbench
from cpbench import storage
from cpbench.bench.planning import plan_file
from cpbench.bench.planning.plan import Limits
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.formulations import QP, FrictionContact
from cpbench.storage.arrays import read_array

OWN = ("own.h5", "contact.h5", "results.sqlite")
"""Files with a digest of what is in them."""
CUTS = (r"(?<=\n)", r"(\s)", r"(?s)(?=.)")
LETTERS = "0123456789.-+*/=()[]{}\"';:,eExXnN \n\t\x00\xff"
DRAW = np.random.default_rng(36)
HALF = DRAW.normal(size=(6, 6))
M, Q = HALF @ HALF.T + 4.0 * np.eye(6), DRAW.normal(size=6) * 3.0
MPS = """NAME          SMALL
ROWS
 N  COST
 G  LOW
 L  UP
COLUMNS
    X  COST  1.5  LOW  1.0
    X  UP  2.0
    Y  COST  -2.0  LOW  1.0
    Y  UP  -1.0
RHS
    RHS  LOW  1.25  UP  3.0
BOUNDS
 UP BND  X  4.0
QUADOBJ
    X  X  2.0
    Y  X  0.5
    Y  Y  3.0
ENDATA
"""
LP = (
    "min\n obj: 3 x - 2 y + [ 2 x^2 + x * y + 4 y^2 ] / 2\nst\n c: x + 2 y >= 1\n d: x - y <= 5\nbounds\n x free\nend\n"
)
GAMS = """Variables x, y, obj;
Positive Variables x;
Equations e, d;
e.. obj =E= sqr(x - 3) + 2*y*y + exp(y);
d.. x + 4*y =G= 1.5;
x.up = 8; y.lo = -2;
Model m / e, d /;
Solve m using NLP minimizing obj;
"""
PLAN = """output = "night.sqlite"
timeout = "1m"
seed = 4

[[set]]
name = "few"
problems = ["p.h5"]
solvers = ["lemke", "psor[omega=0.8:1.4:0.2]"]
where = "n > 3"
tolerance = [1e-4, 1e-8]
"""


def _lcp() -> cpbench.LCP:
    return cpbench.LCP(M=M, q=Q, name="six")


def _program() -> QP:
    return QP.build(M, Q, A=M[:2], b=Q[:2], lb=np.full(6, -5.0), ub=np.full(6, 7.0))


def _contact() -> FrictionContact:
    return FrictionContact(W=sp.csr_array(M), q=Q, mu=np.array([0.3, 0.7]), dimension=3)


def _results(path: Path) -> None:
    pairs = [pair(6, name, limits=Limits(10.0, 2**30, 1, 1), sizes={"n": 6}) for name in ("lemke", "bpp", "pgs")]
    with Store(path, create=True) as store:
        store.plan(pairs)
        store.set_meta(command="cpbench run six.h5", machine={"cpu": "z"})
        for k, planned in enumerate(pairs):
            store.finish(planned.key, Outcome(status="solved", error=1e-9, solve=0.1 * (k + 1), answer=b"six" * 9))
        store.settle()


def _texts(path: Path) -> None:
    np.savetxt(path, M)
    np.savetxt(path.with_name(path.name.replace("-M", "-q")), Q)


def _save(problem: Callable[[], Any], **options: Any) -> Callable[[Path], None]:
    return lambda path: cpbench.save(problem(), path, **options)


BODY = ("C0", "o2", "v0", "v1", "r", "4 0", "b", "3", "3", "J0 2", "0 0", "1 1.5")
SEEDS: dict[str, Callable[[Path], object]] = {
    "own.h5": _save(_lcp),
    "contact.h5": _save(_contact),
    "fclib.hdf5": _save(_contact, format="fclib"),
    "arrays.npz": lambda path: np.savez(path, M=M, q=Q),
    "packed.npz": lambda path: np.savez_compressed(path, M=M, q=Q),
    "array.npy": lambda path: np.save(path, M),
    "arrays.mat": lambda path: scipy.io.savemat(path, {"M": M, "q": Q}),
    "program.mps": lambda path: path.write_text(MPS),
    "program.lp": lambda path: path.write_text(LP),
    "program.nl": _save(_program),
    "binary.nl": lambda path: path.write_bytes(binary([*BODY], jacobian=2)),
    "model.gms": lambda path: path.write_text(GAMS),
    "model.mof.json": _save(_program),
    "siconos.dat": _save(_lcp),
    "case-M1.txt": _texts,
    "plan.toml": lambda path: path.write_text(PLAN),
    "results.sqlite": _results,
}
"""How a file of each format is made, by its name."""
TEXTS = ("program.mps", "program.lp", "program.nl", "binary.nl", "model.gms", "model.mof.json",
         "siconos.dat", "case-M1.txt", "plan.toml")  # fmt: skip
"""Files of which pieces of the text are moved as well."""
NEEDS = {"plan.toml": ("cpbench_solvers",)}


def _content(path: Path) -> Any:
    """What cpbench reads in a file."""
    if path.suffix == ".sqlite":
        with Store(path) as store:
            return json.dumps(
                [list(map(repr, store.rows())), store.meta()["command"], list(map(repr, store.answers()))]
            )
    if path.suffix == ".toml":
        plan = plan_file.read(path)
        return repr((plan.top, plan.sets))
    if path.suffix == ".npy":
        value = read_array(path)
        return (value.toarray() if sp.issparse(value) else value).tobytes()
    return storage.load(path).fingerprint


@pytest.mark.parametrize("count", [10, pytest.param(200, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.needs(*NEEDS.get(name, ()))) for name in SEEDS])
def test_damaged_files_are_refused_or_read(
    name: str, count: int, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("ERROR")
    path = tmp_path / name
    SEEDS[name](path)
    whole, before, draw = path.read_bytes(), _content(path), random.Random(f"36 {name}")
    counts: Counter[str] = Counter()
    for k in range(count):
        moved = name in TEXTS and k % 2
        text = rearranged(whole.decode("latin-1"), draw, CUTS, LETTERS) if moved else ""
        for left in tmp_path.glob(f"{name}-*"):  # SQLite's
            left.unlink()
        path.write_bytes(text.encode("latin-1") if moved else spoiled(whole, draw))
        found = read_or_refused(lambda: _content(path))
        counts["refused" if found is None else "same" if found == before else "other"] += 1
    assert sum(counts.values()) == count
    assert counts["refused"] > count // 10
    if name in OWN:
        assert not counts["other"], counts
