"""The measures by which the judge is judged: known numbers of answers that are known by hand."""

from __future__ import annotations

import complementary_bases
import numpy as np
import pair_misses
import planted
import pytest
import qp_references
from measure import Measured, measured
from qp_literature import Reference, literature, misses, off, unknown_sizes
from qp_rewritings import rewritten
from qp_wrong import wrong_answers, wrongness

from cpbench.formulations import LCP, QP
from cpbench.formulations.programs import QPPoint
from cpbench.verification import judge

# min ½(z₁² + z₂²) − 3z₁ with z₁ + z₂ ≤ 1, z ≥ 0 has the solution (1, 0) with λ = 2 and ν₂ = 2, f = −2.5
PROGRAM = QP.build(
    np.eye(2), np.array([-3.0, 0.0]), np.array([[-1.0, -1.0]]), np.array([-1.0]), lb=np.zeros(2), name="by hand"
)
SOLUTION = QPPoint(z=np.array([1.0, 0.0]), lam=np.array([2.0]), mu=np.zeros(0), nu=np.array([0.0, 2.0]))
REFERENCE = Reference(SOLUTION.z, -2.5, 6.0, "by hand")


def of(**parts: list[float]) -> QPPoint:
    return QPPoint(**{**SOLUTION.arrays(), **{name: np.array(value) for name, value in parts.items()}})


def test_a_solution_has_numbers_of_zero() -> None:
    numbers = literature(PROGRAM, SOLUTION)
    assert numbers.worst(by_row=True) == numbers.worst(by_row=False) == 0.0
    assert numbers.objective == -2.5
    assert off(PROGRAM, SOLUTION.z, REFERENCE) == 0.0
    assert misses(PROGRAM, SOLUTION.z, REFERENCE, np.ones(2)) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("changed", "name", "value"),
    [
        ({"z": [1.5, 0.0]}, "rows", 0.5 / 2.5),
        ({"z": [1.0, -0.5]}, "bounds", 0.5),
        ({"lam": [1.0]}, "gradient", 1.0 / 3.0),  # row 1: 1 − 3 + 1 of terms 5, row 2: 1 − 2 of terms 3
        ({"lam": [1.0]}, "gradient_norm", 1.0 / 5.0),
        ({"nu": [0.0, -2.0]}, "gradient", 1.0),  # the sign is wrong, so it counts as 0: row 2 is 2 of terms 2
        ({"lam": [4.0], "nu": [2.0, 4.0]}, "gap", 2.0 / 4.5),  # dual objective −½ − 4
        ({"lam": [4.0], "nu": [2.0, 4.0]}, "gap_terms", 2.0 / 6.0),
    ],
)
def test_numbers_of_the_literature(changed: dict[str, list[float]], name: str, value: float) -> None:
    assert getattr(literature(PROGRAM, of(**changed)), name) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(("unit", "gap"), [(1e-3, 0.2), (1e-5, 0.3125e-10)])
def test_programs_side_by_side_have_gaps_of_their_own(unit: float, gap: float) -> None:
    """½z², z ≥ b with b = (1, unit), z₂ = 1.25 b₂: the gap (z₂ − b₂)z₂ is 0.2 of its own program's terms z₂².

    Where its objective is 1e-10 of the other one, it is compared with the terms 1 of that.
    """
    problem = QP.build(np.eye(2), np.zeros(2), lb=np.array([1.0, unit]))
    z, none = np.array([1.0, 1.25 * unit]), np.zeros(0)
    numbers = literature(problem, QPPoint(z=z, lam=none, mu=none, nu=z))
    assert numbers.gap_terms == pytest.approx(gap)


def test_the_objective_is_off_by_its_terms() -> None:
    assert off(PROGRAM, np.array([0.0, 0.0]), REFERENCE) == pytest.approx(2.5 / 6.0)


def test_an_unknown_that_is_0_has_the_size_of_its_other_rows() -> None:
    # z₂ = 0: by one unit it would change z₁ + z₂ ≤ 1, of terms 2, by half of them; ‖z‖∞ is 1
    assert unknown_sizes(PROGRAM, REFERENCE).tolist() == [1.0, 1.0]
    small = QP.build(np.eye(2), np.array([-3.0, 0.0]), np.array([[-1.0, -1e3]]), np.array([-1.0]), lb=np.zeros(2))
    assert unknown_sizes(small, REFERENCE)[1] == pytest.approx(2e-3)
    assert misses(small, np.array([1.0, -1e-3]), REFERENCE, unknown_sizes(small, REFERENCE)) == (
        0.0,
        pytest.approx(0.5),
    )


def test_a_row_of_zeros_has_the_sizes_of_its_unknowns() -> None:
    # z₁ − z₂ = 0 with z = (0, 0, 1): its terms are 0, those of z₁ + z₂ + z₃ = 1 are 1
    C = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
    problem = QP.build(np.eye(3), np.zeros(3), C=C, d=np.array([0.0, 1.0]))
    reference = Reference(np.array([0.0, 0.0, 1.0]), 0.5, 1.0, "by hand")
    sizes = unknown_sizes(problem, reference)
    assert sizes.tolist() == [1.0, 1.0, 1.0]  # at most ‖z‖∞
    assert misses(problem, np.array([1e-9, 0.0, 1.0]), reference, sizes)[1] == pytest.approx(1e-9 / 2)
    assert misses(problem, np.array([0.0, 0.0, 1.0 + 1e-3]), reference, sizes)[0] == pytest.approx(1e-3 / 2.001)


def test_a_judge_that_accepts_or_rejects_everything_is_found_out() -> None:
    numbers = literature(PROGRAM, SOLUTION)

    def falsely_solved(**values: float) -> bool:
        return Measured(
            "", "", 1e-6, True, 0.0, **{"off": 0.0, "rows": 0.0, "zeros": 0.0, **values}, numbers=numbers
        ).falsely_solved

    for name, most in (("off", 1e-5), ("rows", 1e-5), ("zeros", 1e-3)):
        assert falsely_solved(**{name: 1.1 * most})
        assert not falsely_solved(**{name: 0.9 * most})
    row = next(measured("", PROGRAM, "", SOLUTION, REFERENCE, np.ones(2), (1e-6,)))
    assert row.right(by_row=True)
    assert row.right(by_row=False)


def test_a_reference_needs_two_methods() -> None:
    numbers = literature(PROGRAM, SOLUTION)
    alone = [("clarabel k=9", SOLUTION, numbers), ("clarabel 1e-09", SOLUTION, numbers)]
    assert qp_references.agreed(PROGRAM, alone) is None
    found = qp_references.agreed(PROGRAM, [*alone, ("piqp 1e-09", SOLUTION, numbers)])
    assert found is not None
    assert (found.objective, found.terms) == (-2.5, 6.0)


def test_wrong_answers_are_wrong_and_a_judge_of_small_problems_sees_them(rng: np.random.Generator) -> None:
    made = list(wrong_answers(rng, PROGRAM, SOLUTION, REFERENCE, 1e-3, 4))
    assert {label.split("_")[0] for label, _ in made} >= {"z", "lam", "nu"}
    sizes = unknown_sizes(PROGRAM, REFERENCE)
    assert all(wrongness(PROGRAM, point, REFERENCE, sizes) >= 1e-3 for _, point in made)
    assert not any(judge(PROGRAM, point, 1e-6).solved for _, point in made)
    assert wrongness(PROGRAM, SOLUTION, REFERENCE, sizes) == 0.0


def test_a_rewriting_keeps_the_objective_and_a_solution(rng: np.random.Generator) -> None:
    problem, point = planted.qp(rng, 6, 4, 2)
    value = problem.objective(point.z)
    for how, other, there in rewritten(rng, problem, point):
        assert literature(other, there).worst(by_row=False) < 1e-12, how
        assert other.objective(there.z) == pytest.approx(value), how
        assert judge(other, there, 1e-9).solved, how


def test_bases_of_an_lcp() -> None:
    # M = [[2, 1], [1, 2]], q = (−5, −6): solution (4/3, 7/3), both basic
    mixed = complementary_bases.Mixed.of(LCP(M=np.array([[2.0, 1.0], [1.0, 2.0]]), q=np.array([-5.0, -6.0])))
    solution = mixed.point(np.array([True, True]))
    assert solution is not None
    assert solution == pytest.approx([4 / 3, 7 / 3])
    assert mixed.negative(solution) == 0.0
    neighbour = mixed.point(np.array([True, False]))  # z = (5/2, 0), w₂ = −7/2 of the largest terms 17/2
    assert neighbour is not None
    assert neighbour == pytest.approx([2.5, 0.0])
    assert mixed.negative(neighbour) == pytest.approx(3.5 / 10.0)


def test_pairs_of_a_right_and_of_a_wrong_answer(rng: np.random.Generator) -> None:
    problem, point = planted.fc(rng, 4, 3)
    misses = pair_misses.by_largest(problem, point)
    assert misses(point) < 1e-13
    wrong = [x for _, x in pair_misses.changed(rng, problem, point, 4)]
    assert max(misses(x) for x in wrong) > 1e-2
