"""Tables of results made up for tests of the analysis: nothing in them was measured."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.bench.planning.plan import Entry, Pair, exact
from cpbench.bench.results.rows import MEASURED, PLANNED, Row
from cpbench.bench.results.store import Store


def pair(number: int = 0, solver: str = "lemke", **given: Any) -> Pair:
    """A planned pair of a solver and the LCP of that number; what is given is taken as it is."""
    name = f"p{number}"
    base = {"address": f"{name}.h5", "problem": name, "fingerprint": f"{number:032x}", "node": "lcp", "family": ""}
    base |= {"sizes": {"n": 3}, "request": exact(), "entry": Entry(solver), "target": "lcp", "tolerance": 1e-6}
    return Pair(**(base | given))


def row(problem: str, label: str, status: str, solve: float = math.nan, **given: Any) -> dict[str, Any]:
    """One row as the results store gives it: its error fits its status, and a pair that was not run has no result."""
    solver, _, request = label.partition("@")
    answered = status in ("solved", "stationary", "inaccurate", "wrong", "max_iter", "failed")
    errors = {"solved": 1e-9, "stationary": 1e-9, "inaccurate": 3e-5, "wrong": 0.2, "not_run": math.nan}
    base: dict[str, Any] = {
        "key": f"{problem}/{label}",
        "problem": problem,
        "address": f"problems/{problem}.h5",
        "fingerprint": f"f-{problem}",
        "node": "lcp",
        "family": problem.rpartition("-")[0],
        "sizes": json.dumps({"n": 3}),
        "solver": solver.partition("[")[0],
        "label": label,
        "request": request or "exact",
        "options": "{}",
        "tolerance": 1e-6,
        "start": "cold",
        "threads": 1,
        "seconds": 10.0,
        "memory": 4 * 2**30,
        "repeats_asked": 3,
        "set": "",
        "measure": None,
        "started": "cold" if answered else None,
        "jobs": 1 if answered else math.nan,
        "status": status,
        "route": "direct" if answered else None,
        "kind": ("approximate" if request else "equivalent") if answered else None,
        "claim": {"solved": "solved", "wrong": "solved", "inaccurate": "solved"}.get(status) if answered else None,
        "error": errors.get(status, math.inf),
        "target_error": math.nan,  # the solver was given the problem itself
        "target_tolerance": math.nan,
        "certainty": None,
        "distance": math.nan,
        "certificate": None,
        "flags": "" if answered else None,
        "message": None,
        "parts": "{}",
        "counters": "{}",
        "load": 0.01,
        "convert": 0.0 if answered else math.nan,
        "setup": 0.0 if answered else math.nan,
        "solve": solve,
        "lift": 0.0 if answered else math.nan,
        "verify": 1e-4 if answered else math.nan,
        "cpu": solve,
        "repeats": 1.0 if answered else math.nan,
        "solve_min": solve,
        "solve_iqr": 0.0,
        "signal": None,
        "version": "1.0",
        "finished": None if status == "not_run" else "2026-01-01T00:00:00",
    }
    return {**base, **given}


def table(*rows: dict[str, Any]) -> pd.DataFrame:
    return pd.DataFrame(list(rows), columns=list(row("p", "s", "solved")))


def small() -> pd.DataFrame:
    """Three problems and labels, normalised: few enough to count by hand, every kind of claim among them."""
    return rows_of.normalised(
        table(
            row("a-1", "lemke", "solved", 1.0),
            row("a-1", "pgs", "solved", 4.0, kind="one-way"),
            row("a-2", "lemke", "wrong", 1e-6),
            row("a-2", "pgs", "solved", 9.0, claim="max_iter"),
            row("b-1", "lemke", "timeout", 10.0),
            row("b-1", "pgs", "inaccurate", 2.0),
            row("a-1", "pgs@inner8", "wrong", 0.5),
            row("a-2", "pgs@inner8", "unsupported", message="needs 3 rows a contact"),
            row("b-1", "pgs@inner8", "failed", 0.5, claim="failed"),
        )
    )


def meta(**given: Any) -> dict[str, Any]:
    base: dict[str, Any] = {
        "command": "cpbench run problems/",
        "cpbench": "0.1.0",
        "date": "2026-01-01 00:00",
        "seed": 0,
        "builtin": True,
        "machine": {"cpu": "a processor", "cores": 2, "ram_gib": 8.0, "os": "Linux", "python": "3.11"},
        "versions": {"cpbench": "0.1.0", "numpy": "2.0"},
        "solvers": {},
        "refused": [],
    }
    return {**base, **given}


def suite(problems: int = 45, labels: int = 20, seed: int = 1) -> pd.DataFrame:
    """A run that looks like one: solvers of different speed and reliability, every kind of failure."""
    rng = np.random.default_rng(seed)
    names = [
        *("lemke", "pgs", "psor", "newton_min", "bpp", "nsgs", "clarabel", "daqp", "piqp", "osqp", "proxqp", "highs"),
        *("scs", "quadprog", "ecos", "cvxopt", "qpalm", "path"),
        *("lemke@inner8", "pgs@inner8", "lemke@inner16", "bpp@outer8-mlcp"),
    ]
    chosen = [*names[: max(0, labels - 4)], *names[18 : 18 + min(4, labels)]][:labels]
    messages = {
        "wrong": "",
        "inaccurate": "the energy norm is {:.1e}",
        "timeout": "killed after 10 s",
        "crash": "killed by SIGSEGV",
        "error": "LinAlgError: Matrix is singular at pivot {:.0f}",
        "max_iter": "no convergence in {:.0f} iterations",
        "failed": "ray termination at pivot {:.0f}",
        "unsupported": "conversion: M is not symmetric (|M - M'| = {:.1e}): this route needs it",
        "memout": "over 4294967296 bytes",
    }
    rows: list[dict[str, Any]] = []
    hard = rng.uniform(0, 1, problems)
    size = np.exp(rng.normal(0, 1.2, problems))
    families = ["murty", "fathi", "obstacle", "journal-bearing", "chain"]
    for label in chosen:
        speed, strength = np.exp(rng.normal(0, 1.3)) * 2e-3, rng.uniform(0.45, 1.05)
        for i in range(problems):
            problem = f"{families[i % len(families)]}-{i:02d}"
            facets = "@" in label
            if label == "highs":
                status = "unavailable"
            elif hard[i] < strength and not (facets and rng.uniform() < 0.6):
                status = "solved"
            else:
                p = rng.dirichlet(np.ones(len(messages)))
                status = "wrong" if facets else str(rng.choice(list(messages), p=p))
            seconds = float(speed * size[i] * np.exp(rng.normal(0, 0.7)))
            message = messages.get(status, "").format(rng.uniform(1, 500))
            reached = status not in ("unsupported", "unavailable")
            rows.append(
                row(
                    problem,
                    label,
                    status,
                    seconds if status in ("solved", "wrong", "inaccurate", "max_iter", "failed") else math.nan,
                    family=problem.rpartition("-")[0],
                    message="missing: pip install highspy" if label == "highs" else message,
                    flags="direction" if status == "solved" and rng.uniform() < 0.01 else "",
                    signal=-11 if status == "crash" else None,
                    kind=("approximate" if facets else "equivalent") if reached else None,
                )
            )
    return table(*rows)


def line_styles_of(labels: Iterable[str]) -> dict[str, int]:
    """Looks by the order of the names, for figures that are made without a run."""
    return {label: k for k, label in enumerate(sorted(set(labels)))}


def results_file(
    path: Path, rows: pd.DataFrame, about: Mapping[str, Any] | None = None, references: tuple[float, ...] = ()
) -> Path:
    """A results file with these rows; `about` it (see `meta`), and what its reference solves took [s]."""
    whole = rows.reindex(columns=[*PLANNED, *MEASURED]).astype(object)
    with Store(path, create=True) as store:
        store.add(Row(*values) for values in whole.where(whole.notna(), None).itertuples(index=False))
        told = dict(about if about is not None else meta())
        told.pop("refused", None)
        store.set_meta(**told)
        for k, seconds in enumerate(references):
            store.add_reference(k, seconds)
    return path
