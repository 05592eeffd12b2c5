"""Who is charged with an answer that is not right: the solver, the conversion, or nobody."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from judged_again import judged_again
from synthetic_results import meta, row
from written_reports import whole, write_html, write_report

from cpbench import storage
from cpbench.bench.judging import PROOF_SECONDS
from cpbench.bench.messages import Judge, Judged, RefereeCase
from cpbench.bench.planning import plan
from cpbench.bench.referee import Referee
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.conversions import make
from cpbench.formulations.base import Problem
from cpbench.formulations.linear import LCP
from cpbench.formulations.local_contact import FrictionContact
from cpbench.verification import Status, judge

TOLERANCE = 1e-6


def degenerate() -> FrictionContact:
    """Two contacts without friction, r_N = (1, 0), u = 0. With r₂ = u₂ = √ε the gap of its LCP is ε, and the second
    contact parts with √ε."""
    return FrictionContact(W=np.eye(4), q=[-1.0, 0.0, 0.0, 0.0], mu=np.zeros(2), dimension=2)


RIGHT, AWAY = np.array([1.0, 0.0]), np.array([0.0, 1.0])
"""Its answer as an LCP, and a direction in which both numbers of a pair grow."""
WRONG = np.array([2.0, 0.0])


def contact() -> FrictionContact:
    """A contact that slides at 30°, which no edge of eight facets has."""
    way = np.array([math.cos(math.radians(30)), math.sin(math.radians(30))])
    r, u = np.array([1.0, *(-0.5 * way)]), np.array([0.0, *way])
    return FrictionContact(W=np.eye(3), q=u - r, mu=[0.5], dimension=3)


def at_its_tolerance(problem: Problem, solution: np.ndarray, direction: np.ndarray, tolerance: float) -> np.ndarray:
    """An answer that just meets the tolerance: the largest step by which the error does not exceed it."""
    low, high = 0.0, 1e-14

    def error(step: float) -> float:
        return judge(problem, problem.point_from_vector(solution + step * direction), tolerance).error

    assert error(0.0) <= tolerance
    while error(high) <= tolerance:
        low, high = high, 2 * high
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if error(middle) <= tolerance else (low, middle)
    return solution + low * direction


class Bench:
    """A referee with one problem, asked as the runner asks it."""

    def __init__(self, folder: Path, problem: Problem, node: str, request: plan.Request, tolerance: float = TOLERANCE):
        path = folder / "p.h5"
        storage.save(problem, path)
        self.problem, self.referee = problem, Referee(folder)
        self.case = RefereeCase(str(path), None, problem.fingerprint, node, request, tolerance)
        self.prepared = self.referee.prepare(self.case)

    def judged(self, z: np.ndarray, claim: str = "solved", promise: str = "equivalent") -> Judged:
        return self.referee.judge(Judge(self.case, claim, True, promise, PROOF_SECONDS, {"z": z}))


@pytest.fixture
def program(tmp_path: Path) -> Bench:
    return Bench(tmp_path, degenerate(), "lcp", plan.exact())


def nearly(program: Bench, tolerance: float) -> np.ndarray:
    """An answer that just solves the program at a tolerance."""
    return at_its_tolerance(make("fc-lcp-frictionless").step(program.problem), RIGHT, AWAY, tolerance)


def test_what_an_exact_conversion_loses_is_lost_and_not_wrong(program: Bench) -> None:
    assert (program.prepared.route, program.prepared.kind) == ("fc-lcp-frictionless", "equivalent")
    asked = program.prepared.tolerance
    for claim in ("solved", "max_iter"):
        row = program.judged(nearly(program, asked), claim)
        assert row.status == Status.LOST
        assert 0.9 * asked < row.target_error <= asked
        assert row.error > 0.5 * math.sqrt(asked), "a gap of ε is a pair of √ε"


def test_a_solver_that_misses_its_own_target_is_charged(program: Bench) -> None:
    row = program.judged(WRONG)
    assert row.status == Status.WRONG
    assert row.target_error > 0.1
    assert program.judged(WRONG, "max_iter").status == Status.MAX_ITER
    near = nearly(program, 10 * program.prepared.tolerance)
    assert program.judged(near).status == Status.INACCURATE


@pytest.mark.needs("cpbench_solvers")
def test_facets_are_approximate_and_a_liar_on_facets_is_wrong(tmp_path: Path) -> None:
    from cpbench.solvers import Budget, solvers

    facets = Bench(tmp_path, contact(), "lcp", plan.facets("inner", 8)[0])
    assert facets.prepared.kind == "approximate"
    target = make("fc-lcp-inner", {"facets": 8}).step(contact())
    found = solvers.get("lemke").run(target, Budget(tolerance=TOLERANCE))
    row = facets.judged(found.point.z)
    assert row.status == Status.APPROXIMATE
    assert row.target_error <= TOLERANCE < row.error
    lie = facets.judged(np.zeros(found.point.z.size))
    assert lie.status == Status.WRONG
    assert lie.target_error > 100 * TOLERANCE


def test_a_solver_that_drops_a_term_has_no_problem_of_its_own(tmp_path: Path) -> None:
    own = Bench(tmp_path, LCP(M=np.eye(1), q=[-1.0]), "lcp", plan.exact())
    row = own.judged(np.array([3.0]), promise="relaxation")
    assert (row.status, row.target_error) == (Status.APPROXIMATE, None)
    assert own.judged(np.array([1.0]), promise="relaxation").status == Status.SOLVED


# ------------------------------------------------------------------------------------- what is kept, judged again


def results_of(bench: Bench, folder: Path, rows: Mapping[str, tuple[np.ndarray, str]], **more: Any) -> Path:
    """A results file with a row for each solver's answer, as a run writes it."""
    asked = plan.exact()
    path = folder / "r.sqlite"
    with Store(path, create=True) as store:
        for solver, (z, claim) in rows.items():
            pair = plan.Pair(
                address=bench.case.address,
                problem="p",
                fingerprint=bench.problem.fingerprint,
                node=bench.problem.node,
                family="",
                sizes=bench.problem.sizes(),
                request=asked,
                entry=plan.parse_entry(solver),
                target=bench.case.node,
                tolerance=TOLERANCE,
                limits=plan.Limits(),
            )
            reply = bench.judged(z, claim)
            told: dict[str, Any] = {"target_tolerance": bench.prepared.tolerance}
            told |= {name: getattr(bench.prepared, name) for name in ("route", "kind")}
            told |= {name: getattr(reply, name) for name in ("status", "error", "target_error")} | more
            told |= {"claim": claim, "flags": ",".join(reply.flags)}
            store.plan([pair])
            store.finish(pair.key, Outcome(**told, answer=reply.vectors["answer"]))
    return path


def test_kept_answers_are_judged_again_as_they_were(program: Bench, tmp_path: Path) -> None:
    lost = nearly(program, program.prepared.tolerance)
    rows = {"daqp": (lost, "solved"), "osqp": (WRONG, "solved"), "piqp": (RIGHT, "failed")}
    path = results_of(program, tmp_path, rows)
    with Store(path) as store:
        assert {r.label: r.status for r in store.rows()} == {"daqp": "lost", "osqp": "wrong", "piqp": "solved"}
    assert judged_again(path) == (True, ["3 answers judged again: no change"])
    _, looser = judged_again(path, tolerance=0.1)
    assert "daqp: lost -> solved" in looser[0]
    _, tighter = judged_again(path, tolerance=TOLERANCE / 2)
    assert "lost -> inaccurate" in tighter[0], "half the tolerance is missed on the solver's own problem, too"


def test_reports_name_the_conversions_that_lost_answers(tmp_path: Path) -> None:
    way = {"route": "mlcp-lcp-schur", "kind": "equivalent", "claim": "solved", "target_error": 5e-7}
    rows = pd.DataFrame(
        [
            {**row("p-1", "lemke", "lost", 1.0), **way, "error": 1e-3},
            {**row("p-2", "lemke", "lost", 1.0), **way, "error": 1e-4},
            {**row("p-1", "pgs@inner8", "approximate", 1.0), "claim": "solved", "error": 0.1, "target_error": 1e-9},
            {**row("p-2", "pgs@inner8", "solved", 1.0), "claim": "solved"},
        ]
    )
    written = whole(write_report(rows, meta(), tmp_path, "lost"))
    page = write_html(rows, meta(), tmp_path, "lost").read_text()
    assert "## Lost on the way back (2)" in written
    assert re.search(r"\| `mlcp-lcp-schur` *\| +2 \| +(2000|2e\+03) \|", written)
    assert "## False claims: claims that do not hold (0)" in written
    assert "No claim of a solver is known to be false." in written
    assert "Lost on the way back (2)" in page
