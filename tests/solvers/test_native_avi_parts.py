"""Claims on affine problems are the verdict's in every connected part; parts are solved by themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import planted
import planted_conic
import pytest
import scipy.sparse as sp

from cpbench.formulations import AVI, LCP, MLCP, AVIPoint, LCPPoint, MLCPPoint, Relay
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.avi.claims import error_of, verdict_error
from cpbench_solvers.lcp import claims as lcp_claims
from cpbench_solvers.mlcp import claims as mlcp_claims

KINDS = "positive definite", "singular semidefinite", "monotone"


def relay(rng: Any) -> Relay:
    n = int(rng.integers(2, 10))
    M = rng.standard_normal((n, n))
    return Relay(M=M @ M.T + M - M.T, q=rng.standard_normal(n), lb=-rng.random(n), ub=rng.random(n))


def avi(rng: Any, kind: str) -> tuple[AVI, AVIPoint]:
    return planted_conic.avi(rng, int(rng.integers(4, 10)), int(rng.integers(0, 6)), int(rng.integers(0, 3)), kind)


def side_by_side(problems: list[Any], rng: Any) -> Any:
    """One problem of all, unknowns and rows in units from 1e-6 to 1e6."""
    data: dict[str, Any] = {name: [] for name in (*"MqAbCd", "lb", "ub")}
    for P in problems:
        z, f = 10.0 ** rng.uniform(-6, 6, 2)
        data["M"].append(f / z * P.M)
        data["q"].append(f * P.q)
        for side in ("lb", "ub"):
            data[side].append(z * getattr(P, side))
        for matrix, side in ("Ab", "Cd") if isinstance(P, AVI) else ():
            data[matrix].append(getattr(P, matrix))
            data[side].append(z * getattr(P, side))
    joined = {name: np.concatenate(data[name]) for name in ("q", "b", "d", "lb", "ub") if data[name]}
    joined |= {name: sp.block_diag(list(map(sp.csr_array, data[name])), format="csr") for name in "MAC" if data[name]}
    return type(problems[0])(**joined)


@pytest.mark.parametrize("seed", range(4))
def test_errors_of_parts_are_those_of_the_verdict(seed: int) -> None:
    """Within 1 % where there are no rows. The scale of the multipliers beside the unknowns, which an equilibration
    leaves open, is known to a tenth."""
    rng = np.random.default_rng(seed)
    for k in range(12):
        P: Any
        P, answer = avi(rng, KINDS[k % 3])
        if k % 4 == 0:
            P = relay(rng)
            answer = solvers.get("lemke-relay").run(P, Budget(tolerance=1e-10)).point
        assert answer is not None
        for size in (1e-8, 1e-4, 1e-2):
            off = {name: a * (1.0 + size * rng.standard_normal(a.size)) for name, a in answer.arrays().items()}
            point = LCPPoint(**off) if isinstance(P, Relay) else AVIPoint(**off)
            expected, norms = judge(P, point, 1e-6).error, P.residuals(point, 1e-6).error
            found = error_of(P, point, np.inf)
            assert found >= norms
            allowed = 0.01 if isinstance(P, Relay) or P.only_box else 0.1
            assert found == norms or abs(found / expected - 1.0) < allowed
            assert found >= (1.0 - allowed) * expected


@pytest.mark.parametrize("name", ["auto-avi", "lemke-avi", "auto-relay", "lemke-relay", "newton-relay", "pgs-relay"])
def test_claims_hold_for_problems_side_by_side(name: str) -> None:
    """Two to twelve planted problems whose sizes are up to 1e12 apart; the automatic choices solve all."""
    rng = np.random.default_rng(7)
    for count in (2, 12):
        own = [relay(rng) if "relay" in name else avi(rng, KINDS[k % 3])[0] for k in range(count)]
        P = side_by_side(own, rng)
        for tolerance in (1e-4, 1e-8):
            output = solvers.get(name).run(P, Budget(tolerance=tolerance, seconds=60.0))
            if name.startswith("auto"):
                assert output.claim is Claim.SOLVED, output.message
            if output.claim is Claim.SOLVED:
                assert judge(P, output.point, tolerance).error <= tolerance


def test_a_part_without_a_solution_is_named() -> None:
    """z = -1 has no point beside z ≥ 0; the other part is z₂ = 1."""
    for n in (2, 200):  # as a whole, and by parts
        q, C = -np.ones(n), np.eye(1, n)
        q[0] = 0.0
        output = solvers.get("auto-avi").run(AVI(M=np.eye(n), q=q, C=C, d=-np.ones(1), lb=np.zeros(n)), Budget())
        assert output.claim is Claim.INFEASIBLE
        assert n == 2 or "part 1 (2 unknowns and rows)" in output.message


def test_rows_without_entries_join_nothing() -> None:
    """0 z ≥ -1 always holds. Parts: z₁ ≥ 1 with the price 1, and z₂ = 2."""
    A = np.array([[1.0, 0.0], [0.0, 0.0]])
    P = AVI(M=np.eye(2), q=np.array([1.0, -2.0]), A=A, b=np.array([1.0, -1.0]), lb=np.zeros(2))
    output = solvers.get("auto-avi").run(P, Budget(tolerance=1e-8))
    assert output.claim is Claim.SOLVED
    np.testing.assert_allclose(output.point.vector, [1.0, 2.0, 2.0, 0.0], atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_errors_of_parts_of_pairs_are_those_of_the_verdict(seed: int) -> None:
    """Of LCPs and MLCPs, within 1 %: of the latter equalities have a size of their own."""
    rng = np.random.default_rng(seed)
    for k in range(10):
        P: Any
        P, answer = planted.lcp(rng, 8) if k % 2 else planted.mlcp(rng, 4, 6)
        for size in (1e-8, 1e-5, 1e-2):
            off = type(answer)(
                **{n: a * (1.0 + size * rng.standard_normal(a.size)) for n, a in answer.arrays().items()}
            )
            assert verdict_error(P, off.vector) == pytest.approx(judge(P, off, 1e-6).error, rel=0.01)


def test_an_answer_that_hides_a_miss_behind_its_size_is_no_claim() -> None:
    """z₁ - z₂ ≥ 1 and z₂ - z₁ ≥ -½ have no solution; z₁ = z₂ + 1 = 10¹⁰ misses ½ in terms of 10¹⁰. Norms let it pass
    beside a part of 10⁸, which is no program."""
    M = np.array([[1.0, -1.0, 0.0, 0.0], [-1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 2.0], [0.0, 0.0, 0.0, 1.0]])
    P, z = LCP(M=M, q=np.array([-1.0, 0.5, -1e8, -1e8])), np.array([1e10 + 1.0, 1e10, 0.0, 1e8])
    assert lcp_claims.error_of(P, z) <= 1e-6
    assert lcp_claims.error_of(P, z, 1e-6) > 0.01
    assert lcp_claims.conclude(P, z, Budget(tolerance=1e-6), {}).claim is not Claim.SOLVED
    mixed = mlcp_claims.scale(mlcp_claims.mixed(P))
    x = mixed.start(MLCPPoint(np.zeros(0), z))
    assert mixed.error(x) <= 1e-6
    assert mlcp_claims.conclude(mixed, x, Budget(tolerance=1e-6), {}).claim is not Claim.SOLVED


@pytest.mark.parametrize("node", ["lcp", "mlcp"])
def test_problems_of_pairs_side_by_side_are_solved_by_parts(node: str) -> None:
    """Two and forty of them, whose right sides are up to 10¹² apart."""
    rng = np.random.default_rng(3)
    for count in (2, 40):
        own = [planted.lcp(rng, 7)[0] if node == "lcp" else planted.mlcp(rng, 3, 5)[0] for _ in range(count)]
        scale = 10.0 ** rng.uniform(-6, 6, count)
        matrices, sides = ("M", "q") if node == "lcp" else ("ABCD", "ab")
        data: dict[str, Any] = {
            n: sp.block_diag([sp.csr_array(getattr(P, n)) for P in own], format="csr") for n in matrices
        }
        data |= {n: np.concatenate([s * getattr(P, n) for P, s in zip(own, scale, strict=True)]) for n in sides}
        P = LCP(**data) if node == "lcp" else MLCP(**data)
        for tolerance in (1e-4, 1e-8):
            output = solvers.get(f"auto-{node}").run(P, Budget(tolerance=tolerance))
            assert output.claim is Claim.SOLVED, output.message
            assert judge(P, output.point, tolerance).error <= tolerance
