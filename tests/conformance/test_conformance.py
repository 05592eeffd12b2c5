"""Every registered plugin through every check of its kind; a new plugin is found by itself.

Other people's solvers that no run takes by default (most members of the large families) get a few checks by day and
all of them at night.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cpbench.errors import Ended
from cpbench.formulations import formulations
from cpbench.graph import edges
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench.storage import formats
from cpbench.testing import cases, checks
from cpbench.testing.cases import draw
from cpbench.verification import judge


def _product(kind: str, plugins) -> list:
    return [pytest.param(p, c, id=f"{name}-{check}") for name, p in plugins for check, c in checks(kind).items()]


@pytest.mark.parametrize(("node", "check"), _product("formulation", [(n.node, n) for n in formulations]))
def test_formulation(node, check) -> None:
    check(node, cases(node.node))


@pytest.mark.parametrize(("edge", "check"), _product("conversion", [(e.name, e) for e in edges()]))
def test_conversion(edge, check) -> None:
    check(edge, cases(edge.source))


BY_DAY = {
    "check_options_are_known_by_name",
    "check_some_case_is_solved",
    "check_the_spec_is_complete",
    "check_the_spec_is_read_without_the_package",
}
"""What tells of a member of a family that its line in the family's table is right: one solve, and the spec."""


def _solvers() -> list:
    found = []
    for solver in solvers:
        every = solver.spec.by_default or type(solver).__module__.startswith("cpbench.solvers.native.")
        for name, check in checks("solver").items():
            marks = () if every or name in BY_DAY else pytest.mark.nightly
            found.append(pytest.param(solver, check, id=f"{solver.spec.name}-{name}", marks=marks))
    return found


@pytest.mark.parametrize(("solver", "check"), _solvers())
def test_solver(solver, check, request: pytest.FixtureRequest) -> None:
    available = solver.availability()
    if not available.ok:
        if solver.spec.licence == "proprietary":
            state = "not installed" if available.state == "missing" else f"without use here ({available.state})"
            pytest.skip(f"does not apply: proprietary package {state}")
        if os.environ.get("CPBENCH_REQUIRE") == "all":
            pytest.fail(f"{solver.spec.name} is {available.state}: {available.detail}")
        pytest.skip(f"needs the package: {available.detail}")
    reason = solver.spec.known_failures.get(check.__name__)
    if reason is not None:
        request.applymarker(pytest.mark.xfail(reason=reason, strict=True, raises=(AssertionError, Ended)))
    check(solver, cases(solver.spec.node))


@pytest.mark.parametrize(("form", "check"), _product("format", [(f.name, f) for f in formats if f.writes]))
def test_format(form, check) -> None:
    for node in sorted(form.writes):
        check(form, cases(node))


@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(node=st.sampled_from(sorted(formulations.names())), seed=st.integers(0, 2**31), size=st.integers(1, 7))
def test_any_shape_is_measured_right(node: str, seed: int, size: int) -> None:
    case = draw(node, seed, size)
    for check in checks("formulation").values():
        check(formulations.get(node), [case])


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(edge=st.sampled_from(edges()), seed=st.integers(0, 2**31), size=st.integers(0, 7))
def test_any_shape_is_converted_right(edge, seed: int, size: int) -> None:
    case = draw(edge.source, seed, size)
    for name, check in checks("conversion").items():
        if name != "check_some_case_takes_it":
            check(edge, [case])


NATIVE = [s for s in solvers if type(s).__module__.startswith("cpbench.solvers.native.")]


@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(solver=st.sampled_from(NATIVE), seed=st.integers(0, 2**31), size=st.integers(0, 9))
def test_native_solvers_never_claim_what_is_not(solver, seed: int, size: int) -> None:
    case = draw(solver.spec.node, seed, size)
    if solver.obstacle(case.problem) is None:
        output = solver.run(case.problem, Budget(tolerance=1e-8, seconds=5.0))
        if output.claim is Claim.SOLVED:
            assert judge(case.problem, output.point, 1e-8).solved


def test_no_check_knows_a_plugin_by_name() -> None:
    import cpbench.testing

    names = [s.spec.name for s in solvers] + [e.name for e in edges()] + list(formats.names())
    for path in Path(cpbench.testing.__file__).parent.glob("checks_*.py"):
        text = path.read_text()
        found = [n for n in names if re.search(rf"[\"']{re.escape(n)}[\"']", text)]
        assert not found, f"{path.name} names {found}"
