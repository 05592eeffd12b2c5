"""Contact answers that are right, and each of them corrupted: whatever the corruption changes, the verdict sees."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import planted_contact
import pytest
from answers import missed_by
from inclusions import pairs_of

from cpbench import storage
from cpbench.formulations import FCPoint, FrictionContact
from cpbench.foundation import matrices
from cpbench.verification import judge

TOLERANCES = (1e-4, 1e-6, 1e-8)


def _corrupted(problem: Any, r: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Answers that somebody might give instead: of another size or sign, with other tangents, one contact changed,
    a self-stress that no contact can have."""
    d, nc = problem.dimension, problem.nc
    R = r.reshape(nc, d)
    for name, factor in (("doubled", 2.0), ("halved", 0.5), ("zero", 0.0), ("negative", -1.0), ("1 % more", 1.01)):
        yield name, factor * r
    yield "friction reversed", (R * np.array([1.0] + [-1.0] * (d - 1))).ravel()
    yield "friction turned", np.column_stack([R[:, :1], R[:, :0:-1]]).ravel()
    yield "no friction", (R * np.array([1.0] + [0.0] * (d - 1))).ravel()
    yield "contacts in reverse", R[::-1].ravel()
    loaded = np.flatnonzero(R[:, 0] > 1e-9 * R[:, 0].max(initial=0.0))
    loaded = loaded[np.argsort(R[loaded, 0])]
    for c in dict.fromkeys(loaded[[0, len(loaded) // 2, -1]].tolist() if loaded.size else []):
        for name, factor in (("doubled", 2.0), ("zero", 0.0), ("reversed", np.array([1.0] + [-1.0] * (d - 1)))):
            changed = R.copy()
            changed[c] *= factor
            yield f"contact {c} {name}", changed.ravel()
    W = matrices.dense(problem.W)
    if nc <= 130:
        values, vectors = np.linalg.eigh((W + W.T) / 2.0)
        if values.size and values[0] < 1e-10 * values[-1]:
            for size in (1.0, 1e3, 1e6):
                yield f"{size:g} of the null space", r + size * np.linalg.norm(r) * vectors[:, 0]


def _scene(seed: int) -> tuple[FrictionContact, FCPoint]:
    """ContactAnswer of rigid bodies in local form; W = HᵀM⁻¹H has a null space where there are enough of them."""
    rng = np.random.default_rng(seed)
    nc, d = int(rng.integers(2, 8)), 2 if seed % 4 == 0 else 3
    body, point = planted_contact.gfc(rng, 2, nc, 0, d)
    M, H = matrices.dense(body.M), matrices.dense(body.H)
    W = H.T @ np.linalg.solve(M, H)
    u = H.T @ point.v + body.w
    return FrictionContact(W=(W + W.T) / 2, q=u - (W + W.T) / 2 @ point.r, mu=body.mu, dimension=d), FCPoint(r=point.r)


@pytest.mark.parametrize("seed", range(20))
def test_no_corruption_of_a_planted_answer_passes(seed: int) -> None:
    problem, point = _scene(seed)
    passed, changed = [], 0
    for tolerance in TOLERANCES:
        assert judge(problem, point, tolerance).solved
        for name, r in _corrupted(problem, point.r):
            wrong = FCPoint(r=r)
            if missed_by(problem, wrong) >= 200.0 * tolerance:
                changed += 1
                verdict = judge(problem, wrong, tolerance)
                if verdict.solved:
                    passed.append(f"{name} at {tolerance:g}: error {verdict.error:.1e}")
    assert not passed, "\n".join(passed)
    assert changed >= 20


ZERO = (
    ("qp/CONT-200.mat", 1e-4),
    ("rolling_global/Chute", 1e-3),
    ("fc3d_local/Confeti-ex13-4contact-Fc3D-SBM.dat", 1e-3),
    ("fc3d_local/Capsules-i100-889.dat", 1e-3),
)


@pytest.mark.parametrize(("name", "tolerance"), ZERO)
def test_zero_does_not_pass_where_it_is_wrong(shared_data: Path, name: str, tolerance: float) -> None:
    found = sorted(shared_data.glob(f"{name}*"))
    assert found, name
    problem: Any = storage.load(found[0])
    verdict = judge(problem, problem.zero_point(), tolerance)
    assert not verdict.solved, f"error {verdict.error:.1e}"


def test_zero_passes_where_it_is_right() -> None:
    """Every contact opens by itself."""
    problem, _ = _scene(3)
    open_ = np.zeros((problem.nc, problem.dimension))
    open_[:, 0] = 1.0
    problem = FrictionContact(W=problem.W, q=open_.ravel(), mu=problem.mu, dimension=problem.dimension)
    assert pairs_of(problem, problem.zero_point()).defects().max() == 0.0
    for tolerance in TOLERANCES:
        assert judge(problem, problem.zero_point(), tolerance).solved
