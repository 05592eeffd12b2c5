"""Failures made small: what is left out and what stays, and the command from a failing solver to its report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from command_line import cpbench as command
from command_line import with_plugins
from generated import instances

import cpbench
from cpbench.formulations import LCP, Problem, formulations
from cpbench.generators import generators
from cpbench_lab.reduction import numbers
from cpbench_lab.reduction.parts import condensed, kinds, without
from cpbench_lab.reduction.predicate import parse_predicate
from cpbench_lab.reduction.reduce import minimized

PLUGIN = """
import os
import numpy as np
from cpbench.formulations import LCPPoint
from cpbench.solvers import Claim, Solver, SolverOutput, SolverSpec, register


def solver(name, spoils):
    def solve(self, prepared, budget, options, start=None, record=None):
        z = np.linalg.solve(prepared.M, -prepared.q)
        if ((prepared.M > 0.5) & ~np.eye(len(z), dtype=bool)).any():
            z = spoils(z)
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=z))

    spec = SolverSpec(name=name, node="lcp", summary="fails where M has a positive entry", method="fault")
    register(type(name.title().replace("-", ""), (Solver,), {"spec": spec, "solve": solve}))


solver("half-liar", lambda z: 2 * z)
solver("half-crash", lambda z: os.abort())
"""
"""Solvers that fail exactly where M has an entry > 0.5 beside its diagonal: two unknowns are needed for that."""


def hidden(n: int = 8) -> LCP:
    """Diagonally dominant with one positive entry beside the diagonal; z = e solves it."""
    rng = np.random.default_rng(0)
    M = np.diag(np.full(n, 9.1)) - np.round(rng.uniform(0, 1, (n, n)), 4) * (1 - np.eye(n))
    M[5, 2] = 0.7321
    return LCP(M=M, q=-M @ np.ones(n), name="hidden")


def test_the_shortest_list_is_found_and_environment_few_times() -> None:
    asked: list[int] = []

    def holds(some: Sequence[int]) -> bool:
        asked.append(len(some))
        return {3, 77, 200} <= set(some)

    assert minimized(range(256), holds) == [3, 77, 200]
    assert len(asked) < 130
    assert minimized(range(5), lambda some: True) == []


# ------------------------------------------------------------------------------------------- parts


COLLECTIONS = [c.name for c in generators if formulations.get(c.node).terms and c.builtin]


@pytest.mark.parametrize("collection", COLLECTIONS)
def test_what_is_left_has_the_rest_of_a_solution(collection: str) -> None:
    """A planted solution, restricted to what stays, is measured on what stays, for every kind of part by itself."""
    rng = np.random.default_rng(1)
    known = [i for i in instances(collection) if i.solution is not None and sum(i.problem.sizes().values()) < 200]
    for instance in known[:3]:
        problem, x = instance.problem, instance.solution
        before = cpbench.verify(problem, x).error
        for kind, parts in kinds(problem).items():
            gone = [part for part in parts if rng.random() < 0.4][: len(parts) - 1]
            rest = without(problem, gone, x)
            kept = {symbol: np.ones(size, dtype=bool) for symbol, size in problem.sizes().items()}
            for part in gone:
                for symbol, where in part.places.items():
                    kept[symbol][where] = False
            point = {name: v[_mask(problem, name, v, kept)] for name, v in x.arrays().items()}
            error = cpbench.verify(rest, rest.point_type(**point)).error
            assert error <= 1e-9 + 100 * before, (instance.name, kind)


def _mask(problem: Problem, name: str, v: np.ndarray, kept: dict[str, np.ndarray]) -> np.ndarray:
    """Which numbers of a part of the answer belong to what stays."""
    symbols = {"z": "n", "u": "n", "v": "m" if problem.node == "mlcp" else "n", "x": "n", "r": "m", "y": "m", "nu": "n"}
    symbols |= {"lam": "m" if problem.node in ("qp", "avi") else "p", "mu": "k"}
    return kept.get(symbols[name], np.ones(v.size, dtype=bool))


def test_rows_that_hold_with_equality_are_eliminated() -> None:
    """z = (1, 2, 0) solves the LCP with w = (0, 0, 3); (2, 0) solves the Schur complement without the first unknown."""
    M = np.array([[4.0, 1.0, -1.0], [1.0, 3.0, 1.0], [-1.0, 1.0, 2.0]])
    z, w = np.array([1.0, 2.0, 0.0]), np.array([0.0, 0.0, 3.0])
    problem = LCP(M=M, q=w - M @ z)
    rest = condensed(problem, kinds(problem)["unknown of n"][:1])
    assert cpbench.verify(rest, z[1:], tolerance=1e-12).solved
    np.testing.assert_allclose(rest.M, [[2.75, 1.25], [1.25, 1.75]], rtol=1e-14)


def test_unknowns_of_a_map_are_left_out() -> None:
    """F(z) of what stays is F of the whole with the others at their values."""
    instance = instances("ncp-classics")[0]
    problem, z = instance.problem, np.array([1.0, 0.5, 0.25, 2.0])
    part = kinds(problem)["unknown of n"][1]
    rest = without(problem, [part], problem.point_type(z=z))
    kept = [0, 2, 3]
    np.testing.assert_allclose(rest.F(z[kept]), problem.F(z)[kept], rtol=1e-15)


# ------------------------------------------------------------------------------------------- numbers


def test_entries_change_with_their_mirror_images() -> None:
    M = sp.csr_array(np.array([[2.0, 0.3333], [0.3333, 2.0]]))
    problem = LCP(M=M, q=[-1.0, 7.25])
    found = {entry.field: entry for entry in numbers.entries(problem) if len(entry.places) == 2}
    assert list(found) == ["M"]
    changed = numbers.changed(problem, {found["M"]: -1.0})
    assert changed.M.toarray().tolist() == [[2.0, -1.0], [-1.0, 2.0]]
    assert numbers.digits(problem) == 4
    assert numbers.digits(changed) == 3


def test_a_semidefinite_matrix_is_rounded_by_its_factor() -> None:
    """Rank 1, so that rounded entries would be indefinite: a factor of a digit gives two at most, and the rank."""
    a = np.array([0.7071, 1.1832, 0.4242])
    problem = LCP(M=np.outer(a, a), q=[-1.0, 0.0, 1.0])
    changed = numbers._of_factor(problem, "M", 1)
    assert np.linalg.matrix_rank(changed.M) == 1
    assert numbers.digits(changed) <= 2


def test_a_degenerate_problem_is_rounded_with_its_solution() -> None:
    """z = (2.7498…, 0) and w = 0: rounded data alone would make w₂ positive or negative, here it stays 0."""
    M = np.array([[1.6328125, 0.1375], [0.1375, 1.0]])
    problem, z = LCP(M=M, q=-M @ np.array([2.74985, 0.0])), np.array([2.74985, 0.0])
    changed = numbers.replanted(problem, problem.point_type(z=z), 1)
    assert changed.M.tolist() == [[2.0, 0.1], [0.1, 1.0]]
    assert changed.q.tolist() == [-6.0, -0.3]


def test_what_is_no_failure_is_refused() -> None:
    assert str(parse_predicate("slower:100:lemke")) == "slower:100:lemke"
    assert parse_predicate("max_iter").needs_other
    assert not parse_predicate("wrong").needs_other
    for text in ("solved", "slower:1", "slower:fast", "wrong:lemke"):
        with pytest.raises(cpbench.CpbenchError, match="is none of"):
            parse_predicate(text)


# ------------------------------------------------------------------------------------------- the command


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("reduce")
    (place / "plugin.py").write_text(PLUGIN)
    cpbench.save(hidden(), place / "hidden.h5")
    return place


@pytest.fixture(scope="module")
def lies(folder: Path) -> Path:
    """The folder of a liar's reduced failure."""
    done = with_plugins(
        folder, "--plugin", "plugin.py", "reduce", "hidden.h5", "-s", "half-liar", "--while", "wrong", "-o", "lies"
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder / "lies"


def test_a_lie_is_reduced_to_the_entry_it_hangs_on(lies: Path) -> None:
    """Two unknowns, one entry > 0.5 between them, and only ones elsewhere: nothing less makes the solver lie."""
    problem = cpbench.load(lies / "problem.h5")
    M = cpbench.foundation.matrices.dense(problem.M)
    assert problem.q.size == 2
    assert sorted(M[~np.eye(2, dtype=bool)].tolist()) == [0.0, 1.0]
    assert numbers.digits(problem) == 1
    assert set(np.abs([*np.diag(M), *problem.q])) <= {0.0, 1.0}


def test_a_crash_is_reduced(folder: Path) -> None:
    arguments = ("--plugin", "plugin.py", "reduce", "hidden.h5", "-s", "half-crash", "--while", "crash")
    done = with_plugins(folder, *arguments, "-o", "crash", "-q")
    assert done.returncode == 0, done.stderr
    assert cpbench.load(folder / "crash/problem.h5").q.size == 2
    assert "says crash" in (folder / "crash/report.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("hidden.h5", "-s", "lemke", "--while", "wrong", "-o", "x"), "wrong: lemke does not do that here"),
        (("hidden.h5", "-s", "lemke", "-o", "x"), "--while wrong"),
        (("hidden.h5", "-s", "lemke", "--while", "wrong", "-o", "."), "is not empty"),
        (("hidden.h5", "-s", "lemka", "--while", "wrong", "-o", "x"), "lemka"),
    ],
)
def test_what_cannot_be_reduced_is_refused_in_one_line(folder: Path, arguments: tuple[str, ...], words: str) -> None:
    done = command(folder, "reduce", *arguments)
    assert done.returncode == 2
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1
