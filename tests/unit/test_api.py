"""The Python interface: what `import cpbench` offers, as a script or a notebook uses it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from planted_nonlinear import graph as formula
from sliding import SLIDING
from threadpoolctl import threadpool_info, threadpool_limits

import cpbench
from cpbench import formulations
from cpbench.errors import NoRoute, PointError, ProblemError, Unavailable, UnknownName
from cpbench.solvers.base import Budget, Claim, Solver, SolverOutput, SolverSpec, solvers
from cpbench.verification import Status

LCP = formulations.LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-5.0, -6.0], name="two")
EXACT = np.array([4.0, 7.0]) / 3.0
"""M z + q = 0 at z = (4/3, 7/3) > 0: 8/3 + 7/3 = 5 and 4/3 + 14/3 = 6."""


@pytest.mark.parametrize("name", cpbench.__all__)
def test_every_name_resolves(name: str) -> None:
    assert getattr(cpbench, name) is not None


def test_every_formulation_and_its_point_is_exported() -> None:
    for cls in formulations.formulations:
        assert getattr(cpbench, cls.__name__) is cls
        assert getattr(cpbench, cls.point_type.__name__) is cls.point_type


def test_a_formulation_and_its_generator_are_all_that_a_new_node_takes(tmp_path: Path) -> None:
    """It is exported and has cases for the checks, though no file of cpbench has its name."""
    plugin = tmp_path / "sliding.py"
    plugin.write_text(SLIDING)
    code = (
        "import cpbench; from cpbench.testing.cases import cases\n"
        "print(cpbench.Sliding.node, 'Sliding' in cpbench.__all__, [c.name for c in cases('sliding')])"
    )
    environment = {**os.environ, "CPBENCH_PLUGINS": str(plugin)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.stdout == "sliding True ['one']\n", done.stderr


def test_an_import_brings_nothing_with_it() -> None:
    code = "import sys, cpbench; print([m for m in ('numpy', 'scipy', 'h5py', 'click') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


@pytest.mark.needs("cpbench_solvers")
def test_one_solve_imports_few_solvers() -> None:
    """Discovery of all of them takes longer than most problems."""
    code = (
        "import sys, cpbench; s = cpbench.solve(cpbench.LCP(M=[[2.0]], q=[-1.0]), 'lemke'); "
        "print(bool(s), sum('cpbench_adapters.' in m for m in sys.modules), 'pandas' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "True 0 False", done.stderr


@pytest.mark.needs("cpbench_solvers")
def test_an_answer_is_measured_on_the_problem_that_was_asked() -> None:
    solution = cpbench.solve(LCP, "lemke", tolerance=1e-9)
    assert solution
    assert solution.status is Status.SOLVED
    assert solution.claim == Claim.SOLVED
    np.testing.assert_allclose(solution.x, EXACT, rtol=1e-12)
    assert solution.error <= 1e-9
    assert solution.route == "direct"
    assert 0 < solution.time < 10


@pytest.mark.needs("cpbench_solvers")
def test_a_solver_of_another_formulation_is_reached_and_its_answer_carried_back() -> None:
    solution = cpbench.solve(LCP, "dual-active-set")
    assert solution.route == "lcp-qp"
    assert solution.problem is LCP
    assert "convert" in solution.seconds
    np.testing.assert_allclose(solution.x, EXACT, rtol=1e-9)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("node", ["equation", "nfc"])
def test_a_formulation_without_an_automatic_choice_gets_a_solver_of_its_own(node: str) -> None:
    from cpbench.bench.planning.plan import nearest_automatic

    chosen = [solvers.get(name).spec.node for name in nearest_automatic(node)]
    assert node in chosen


class Liar(Solver):
    """Claims anything; `LIES` says what."""

    spec = SolverSpec(name="liar-in-a-script", node="lcp", summary="", method="")
    answer: SolverOutput | Exception = SolverOutput(claim=Claim.SOLVED)

    def solve(self, prepared: object, budget: Budget, options: object, start: object = None, record: object = None):
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


class NeedsGuest(Liar):
    """Cannot run here."""

    spec = SolverSpec(name="needs-a-guest", node="lcp", summary="", method="", requires=("no_such_package",))


@pytest.fixture(autouse=True)
def liar() -> Iterator[Liar]:
    one = Liar()
    for solver in (one, NeedsGuest()):
        solvers.add(solver.spec.name, solver)
    yield one
    for name in ("liar-in-a-script", "needs-a-guest"):
        del solvers._items[name]  # pyright: ignore[reportPrivateUsage]


@pytest.mark.parametrize(
    ("answer", "status"),
    [
        (SolverOutput(claim=Claim.SOLVED, point=formulations.LCPPoint(z=[1.0, 1.0])), Status.WRONG),
        (SolverOutput(claim=Claim.SOLVED, point=formulations.LCPPoint(z=[1.0])), Status.ERROR),
        (SolverOutput(claim=Claim.FAILED, point=formulations.LCPPoint(z=EXACT)), Status.SOLVED),
        (SolverOutput(claim=Claim.INFEASIBLE), Status.FAILED),
        (ZeroDivisionError("of its own"), Status.ERROR),
    ],
)
def test_a_claim_is_kept_beside_the_verdict_and_decides_nothing(liar: Liar, answer: object, status: Status) -> None:
    liar.answer = answer  # pyright: ignore[reportAttributeAccessIssue]
    solution = cpbench.solve(LCP, "liar-in-a-script")
    assert solution.status is status
    assert bool(solution) is (status is Status.SOLVED)
    if isinstance(answer, Exception):
        assert re.fullmatch(r"ZeroDivisionError: of its own \(test_api.py, line \d+\)", solution.message)
        assert solution.x is None
    elif isinstance(answer, SolverOutput):
        assert solution.claim == answer.claim


@pytest.mark.needs("cpbench_solvers")
def test_an_answer_after_the_limit_is_late() -> None:
    solution = cpbench.solve(LCP, "lemke", seconds=1e-9)
    assert solution.status is Status.TIMEOUT
    assert not solution
    assert "limit of 1e-09 s" in solution.message


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("solver", "cause"),
    [("lemka", UnknownName), ("nsgs", NoRoute), ("psor[omega=x]", UnknownName), ("needs-a-guest", Unavailable)],
)
def test_what_cannot_be_done_is_one_line(solver: str, cause: type[Exception]) -> None:
    with pytest.raises(cause) as refusal:
        cpbench.solve(LCP, solver)
    assert "\n" not in str(refusal.value)


def test_no_problem_and_no_limits_are_refused() -> None:
    with pytest.raises(ProblemError, match="is a str, expected a Problem"):
        cpbench.solve("file.h5")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ProblemError, match="is a Modelled, expected a Problem; its attribute problem is one"):
        cpbench.solve(cpbench.from_game(np.eye(2), np.eye(2)))
    with pytest.raises(ProblemError, match=r"q: must be a vector, has shape \(2, 1\): numpy.ravel makes one"):
        cpbench.LCP(M=np.eye(2), q=[[1.0], [2.0]])
    with pytest.raises(ProblemError, match="tolerance: must be positive"):
        cpbench.solve(LCP, "lemke", tolerance=0.0)


class CountsThreads(Solver):
    """Notes how many threads the numerical libraries have while it solves."""

    spec = SolverSpec(name="counts-threads", node="lcp", summary="", method="")
    seen: ClassVar[list[int]] = []

    def solve(self, prepared, budget, options, start=None, record=None) -> SolverOutput:
        type(self).seen += [pool["num_threads"] for pool in threadpool_info()]
        return SolverOutput(claim=Claim.FAILED)


def test_blas_has_the_threads_that_are_asked_for_and_its_own_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(solvers._items, "counts-threads", CountsThreads())
    with threadpool_limits(2):
        before = [pool["num_threads"] for pool in threadpool_info()]
        cpbench.solve(LCP, "counts-threads")
        cpbench.solve(LCP, "counts-threads", threads=2)
        assert [pool["num_threads"] for pool in threadpool_info()] == before
    assert max(before) == 2  # some have one, whatever is asked of them
    assert CountsThreads.seen == [1] * len(before) + before


def test_answers_from_anywhere_are_measured() -> None:
    assert cpbench.verify(LCP, EXACT).solved
    assert not cpbench.verify(LCP, EXACT + 1e-3).solved
    assert cpbench.verify(LCP, EXACT + 1e-3, tolerance=1e-2).solved
    with pytest.raises(PointError, match="has 1 numbers, expected 2"):
        cpbench.verify(LCP, [1.0])


@pytest.mark.needs("cpbench_solvers")
def test_a_notebook_shows_law_and_verdict() -> None:
    assert "0 ≤ z ⟂" in str(LCP._repr_html_())
    shown = cpbench.solve(LCP, "lemke")._repr_html_()
    assert "two: solved" in shown
    assert "measured" in shown


@pytest.mark.needs("cpbench_solvers")
def test_a_run_of_problems_from_memory_and_files(tmp_path: Path) -> None:
    file = tmp_path / "p.h5"
    cpbench.save(formulations.LCP(M=[[1.0]], q=[-1.0], name="one"), file)
    results = cpbench.run([LCP, file], ["lemke", "psor"], repeats=1, out=tmp_path / "r.sqlite")
    frame = results.frame
    assert sorted(zip(frame["problem"], frame["solver"], frame["status"], strict=True)) == [
        (problem, solver, "solved") for problem in ("one", "two") for solver in ("lemke", "psor")
    ]
    assert "lcp: " in repr(results)
    assert "<table>" in results._repr_html_()
    assert results.compare(results).verdict in ("same", "inconclusive")  # two problems are few
    again = cpbench.Results(tmp_path / "r.sqlite")
    assert len(again) == 4
    assert (tmp_path / "r.problems.h5").exists()


@pytest.mark.nightly
def test_the_report_and_the_figures_of_a_run(tmp_path: Path) -> None:
    results = cpbench.run(LCP, ["lemke", "psor"], repeats=1)
    assert results.profile().axes
    page = results.report(tmp_path / "report")
    assert page.name == "report.html"
    assert page.stat().st_size > 10_000


@pytest.mark.needs("cpbench_solvers")
def test_a_run_says_what_it_cannot_do(tmp_path: Path) -> None:
    for arguments, told in (
        ({"solvers": "lemka"}, "unknown solver 'lemka'"),
        ({"solvers": "lemke", "timeot": 1}, "unknown key of a plan 'timeot'"),
        ({"solvers": "nsgs"}, "no route leads"),
    ):
        with pytest.raises(cpbench.CpbenchError, match=told):
            cpbench.run(LCP, out=tmp_path / "r.sqlite", **arguments)
    assert not (tmp_path / "r.sqlite").exists()


@pytest.mark.nightly
def test_a_script_needs_no_guard(tmp_path: Path) -> None:
    """Its processes do not import it: without `if __name__ == "__main__"` it would begin the run again."""
    script = tmp_path / "mine.py"
    script.write_text(
        "print('begun', flush=True)\nimport cpbench\n"
        "lcp = cpbench.LCP(M=[[2.0]], q=[-1.0], name='p')\n"
        "print(cpbench.run(lcp, 'lemke', repeats=1).frame['status'].tolist())\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout == "begun\n['solved']\n", done.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["mine.py"]


def test_solvers_of_a_problem_are_a_list_that_reads_as_a_table() -> None:
    listed = cpbench.list_solvers(LCP)
    assert listed.names == [spec.name for spec in cpbench.list_solvers("lcp")]
    assert repr(listed).count("\n") == len(listed) - 1
    assert listed._repr_html_().count("<tr>") == len(listed) + 1


@pytest.mark.needs("cpbench_solvers")
def test_where_no_solver_of_cpbench_takes_a_program_the_message_begins_with_those_that_do() -> None:
    """The least product of two unknowns of which a product is bounded below: no map is affine."""
    bounded = formula(2, lambda x: x[0] * x[1] ** 2 - 1.0)
    product = formulations.NLP(f=formula(2, lambda x: x[0] * x[1]), g=bounded, lb=[0.5, 0.5])
    with pytest.raises(NoRoute, match=r"no automatic choice takes this problem \(nlp\): name a solver") as refusal:
        cpbench.solve(product)
    assert "scipy-slsqp" in str(refusal.value).partition(" (tried: ")[0]
