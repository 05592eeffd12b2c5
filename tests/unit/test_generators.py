"""The built-in problems: what their sheets say of them is measured, and the files are what the formulas give."""

from __future__ import annotations

import tomllib
from pathlib import Path

import generated
import numpy as np
import pytest
from tiers import by_night

from cpbench import storage, verification
from cpbench.formulations import formulations
from cpbench.generators import generators
from cpbench.generators.base import SMALL
from cpbench.generators.collection import builtin_folder, catalogue, write_collections
from cpbench.solvers import Budget, solvers
from cpbench.testing.checks_problem import KNOWN, check_what_is_known_holds

SMALL_ONES = [entry for entry in catalogue() if entry.tier == SMALL]
FAMILIES = sorted({entry.family for entry in SMALL_ONES})
QUIET = ((), ("absolute",), ("stationary",), ("convexity declared",), ("unresolvable",))
"""Flags that a right answer may have."""


@pytest.mark.parametrize("name", [*FAMILIES, *by_night(["contact-planted-large", "contact-stacks"])])
def test_what_is_known_holds(name: str) -> None:
    check_what_is_known_holds(generators.get(name), [])
    listed = {entry.name: entry.known for entry in catalogue() if entry.family == name}
    for one in generated.instances(name):
        assert listed[one.name] == one.known
        if one.solution is not None:
            assert verification.judge(one.problem, one.solution, KNOWN[one.known]).flags in QUIET


def test_there_are_at_least_forty_of_every_class_some() -> None:
    assert len(SMALL_ONES) >= 40
    assert {entry.node for entry in SMALL_ONES} >= set(formulations.names())
    assert set(FAMILIES) == {one.name for one in generators if one.builtin}


@pytest.mark.nightly
def test_the_shipped_files_are_what_the_formulas_give_bit_for_bit(tmp_path: Path) -> None:
    fresh = {path.relative_to(tmp_path): path.read_bytes() for path in write_collections(tmp_path)}
    shipped = builtin_folder()
    assert fresh == {p.relative_to(shipped): p.read_bytes() for p in shipped.glob("*/*") if p.is_file()}


@pytest.mark.nightly
def test_sheets_and_files_agree() -> None:
    for sheet in builtin_folder().glob("*/*.toml"):
        said = tomllib.loads(sheet.read_text())
        for row in said["problem"]:
            problem = storage.load(f"{sheet.with_suffix('.h5')}::{row['name']}")
            assert problem.fingerprint == row["fingerprint"]
            assert problem.info.licence == said["licence"]
            found = storage.solution(f"{sheet.with_suffix('.h5')}::{row['name']}")
            assert (found is not None) == (row["known"] in KNOWN)


@pytest.mark.needs("cpbench_solvers")
def test_the_radial_obstacle_is_met_where_theory_says() -> None:
    """Majava and Tai 2004: u touches ψ inside r* = 0.6980 (the root of r²(1 − log(r/2)) = 1), and is free outside."""
    from cpbench_problems.generators.obstacles import RADIUS, radial_obstacle

    assert RADIUS**2 * (1 - np.log(RADIUS / 2)) == pytest.approx(1.0, abs=1e-14)
    n = 25
    problem = radial_obstacle(n).problem
    z = solvers.get("lemke").run(problem, Budget(tolerance=1e-9)).point.z.reshape(n, n)
    axis = -2.0 + 4.0 / (n + 1) * np.arange(1, n + 1)
    r = np.hypot(*np.meshgrid(axis, axis))
    mesh = 4.0 / (n + 1)
    assert (z[r < RADIUS - mesh] < 1e-9).all()
    assert (z[(r > RADIUS + mesh) & (r < 2.0)] > 0).all()
    outside = (r > 1.0) & (r < 2.0)
    exact = -(RADIUS**2) * np.log(r[outside] / 2) / np.sqrt(1 - RADIUS**2)
    u = z[outside] - 1.0  # ψ = −1 outside the unit disk
    assert np.abs(u - exact).max() < 2 * mesh**2
