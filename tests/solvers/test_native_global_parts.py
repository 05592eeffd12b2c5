"""Global contact problems of several connected parts, each of its own size: claims hold, and parts end by
themselves."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import planted_contact
import pytest
import scipy.sparse as sp

from cpbench.formulations import GFCPoint
from cpbench.formulations.global_contact import GlobalFrictionContact
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.contact.dynamics_error import DynamicsError
from cpbench_solvers.contact.global_parts import moving_parts, restricted


def side_by_side(problems: list[Any], rng: Any) -> Any:
    """One problem of all, velocities and impulses of each in units from 1e-6 to 1e6; a dense or a sparse one."""
    data: dict[str, Any] = {name: [] for name in "MHGfwb"}
    for P in problems:
        v, f = 10.0 ** rng.uniform(-6, 6, 2)
        for name, size in zip("MHGfwb", (f / v, 1.0, 1.0, f, v, v), strict=True):
            data[name].append(size * getattr(P, name))
    whole = {name: np.concatenate(data[name]) for name in "fwb"}
    whole |= {name: sp.block_diag(list(map(sp.csr_array, data[name])), format="csr") for name in "MHG"}
    law = {"mu": np.concatenate([P.mu for P in problems]), "dimension": problems[0].dimension}
    if hasattr(problems[0], "mu_r"):
        law["mu_r"] = np.concatenate([P.mu_r for P in problems])
    return type(problems[0])(**whole, **law)


def planted(node: str, rng: Any, joints: int = 2) -> Any:
    if node == "gfc":
        return planted_contact.gfc(rng, int(rng.integers(1, 5)), 4, joints, 3)[0]
    return planted_contact.grfc(rng, int(rng.integers(1, 5)), 4, joints, 5)[0]


@pytest.mark.parametrize(
    ("name", "joints"), [("auto-gfc", 2), ("admm-gfc", 2), ("nsgs-gfc", 0), ("auto-gfc", 0), ("admm-grfc", 2)]
)
def test_claims_hold_for_problems_side_by_side(name: str, joints: int) -> None:
    """Two and twelve of them, with planted solutions; all are solved, to what is asked of each."""
    rng = np.random.default_rng(3)
    for count in (2, 12):
        problem = side_by_side([planted(name[-4:].strip("-"), rng, joints) for _ in range(count)], rng)
        for tolerance in (1e-4, 1e-7):
            output = solvers.get(name).run(problem, Budget(tolerance=tolerance, seconds=60.0))
            assert output.claim is Claim.SOLVED, output.message
            assert judge(problem, output.point, tolerance).error <= tolerance


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("node", ["gfc", "grfc"])
def test_parts_are_the_problems_that_were_put_together(node: str, sparse: bool) -> None:
    """In another order; a body that nothing touches and zeros that are stored are no part of another."""
    rng = np.random.default_rng(1)
    own = [planted(node, rng) for _ in range(4)]
    whole = side_by_side(own, rng)
    n, extra = whole.f.size, np.ones(1)
    full = sp.block_diag([whole.M, np.eye(1)], format="coo")
    row, column = np.append(full.row, 0), np.append(full.col, n)
    M: Any = sp.csr_array((np.append(full.data, 0.0), (row, column)), shape=full.shape)
    H: Any
    G: Any
    H, G = (sp.csr_array(sp.vstack([A, np.zeros((1, A.shape[1]))])) for A in (whole.H, whole.G))
    if not sparse:
        M, H, G = M.toarray(), H.toarray(), G.toarray()
    whole = dataclasses.replace(whole, M=M, H=H, G=G, f=np.append(whole.f, extra))
    found = moving_parts(whole)
    assert found is not None
    sizes = sorted((x.contacts.size, x.velocities.size, x.joints.size) for x in found.parts)
    assert sizes == sorted([(P.nc, P.f.size, P.b.size) for P in own] + [(0, 1, 0)])
    for part in found.parts[:-1]:
        problem = restricted(whole, part)
        assert problem.point_sizes == {"v": part.velocities.size, "r": problem.w.size, "lam": part.joints.size}
        assert moving_parts(problem) is None


def test_a_body_that_falls_through_its_support_is_wrong_by_all_of_its_velocity() -> None:
    """A body at 1e9 times the velocity of its support: r = 0 lets it fall into that."""
    problem = GlobalFrictionContact(
        M=np.eye(3),
        H=np.eye(3),
        f=np.array([-1e9, 0.0, 0.0]),
        w=np.array([1.0, 0.0, 0.0]),
        mu=np.array([0.5]),
        dimension=3,
    )
    fallen = GFCPoint(v=problem.f, r=np.zeros(3))
    assert DynamicsError(problem, 1e-8)(fallen) == pytest.approx(1.0)
    output = solvers.get("nsgs-gfc").run(problem, Budget(tolerance=1e-8))
    assert output.claim is Claim.SOLVED, output.message
