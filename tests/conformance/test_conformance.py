"""Every registered plugin through every check of its kind; a new plugin is found by itself.

By day native solvers get the checks that hold their answers to account, and of other people's one a module of adapters
solves a case; some of both get all. The rest is for the night.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Container
from pathlib import Path
from typing import Any

import pytest
from drawn_cases import draw
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cpbench.errors import Ended
from cpbench.formulations import formulations
from cpbench.foundation.matrices import is_sparse
from cpbench.graph import edges
from cpbench.solvers.base import Budget, Claim, solvers
from cpbench.storage import formats
from cpbench.testing import Case, cases, checks
from cpbench.testing.conduct import planted
from cpbench.verification import judge


def _product(kind: str, plugins, only: Container[str] | None = None) -> list:
    """Return every plugin with every check of its kind, or with some of them."""
    made = {name: check for name, check in checks(kind).items() if only is None or name in only}
    return [pytest.param(p, check, id=f"{of}-{name}") for of, p in plugins for name, check in made.items()]


FEW = {
    "check_lift_works_in_another_process", "check_sparse_as_dense", "check_the_input_stays", "check_the_same_twice",
    "check_annotations_are_kept", "check_files_are_not_overwritten", "check_cut_files_are_refused",
}  # fmt: skip
"""Checks of what conversions and formats do whatever the numbers are: few cases by day, all of them at night."""


def _some(check: Any, given: list[Case]) -> list[Case]:
    """Return the cases of a check by day: of those of FEW the first, the first sparse one, and two more."""
    if check.__name__ not in FEW or len(given) <= 4:
        return given
    sparse = next((case for case in given if any(map(is_sparse, case.problem.data().values()))), given[-1])
    return list(dict.fromkeys([given[0], sparse, given[len(given) // 2], given[-1]]))


@pytest.mark.parametrize(("node", "check"), _product("formulation", [(n.node, n) for n in formulations]))
def test_formulation(node, check) -> None:
    check(node, planted(node.node))


def _taken(edge, check: Any) -> list[Case]:
    """Return the cases of a conversion's check; of one of FEW those that the conversion takes."""
    few = check.__name__ in FEW
    return [case for case in cases(edge.source) if not few or edge.obstacle(case.problem) is None]


@pytest.mark.parametrize(("edge", "check"), _product("conversion", [(e.name, e) for e in edges()]))
def test_conversion(edge, check) -> None:
    check(edge, _some(check, _taken(edge, check)))


@pytest.mark.nightly
@pytest.mark.parametrize(("edge", "check"), _product("conversion", [(e.name, e) for e in edges()], FEW))
def test_conversion_in_every_case(edge, check) -> None:
    check(edge, _taken(edge, check))


OF_THE_SPEC = {
    "check_options_are_known_by_name",
    "check_the_spec_is_complete",
    "check_the_spec_is_read_without_the_package",
    "check_tolerances_are_no_looser",
}
"""What solves nothing, and needs no package."""
BY_DAY = {
    "native": {
        "check_options_are_known_by_name",
        "check_the_spec_is_complete",
        "check_some_case_is_solved",
        "check_claims_are_true",
        "check_one_iteration_claims_nothing_false",
        "check_answers_have_their_shape",
        "check_infeasibility_is_proved_or_not_claimed_solved",
        "check_warm_starts_are_taken",
    },
    "automatic": {
        "check_options_are_known_by_name",
        "check_the_spec_is_complete",
        "check_some_case_is_solved",
        "check_answers_have_their_shape",
    },
    "foreign": {
        "check_options_are_known_by_name",
        "check_the_spec_is_complete",
        "check_tolerances_are_no_looser",
    },
}
"""Checks of every solver. An automatic choice is among solvers that are checked themselves; the line of another
package's table is right if one of the table solves something."""
SAMPLED = {
    "pgs", "pgs-mlcp", "newton-relay", "mprgp-qp", "newton-soclcp", "newton-alart-curnier", "newton-fb-micp",
    "auto-lcp", "siconos-lcp-lemke", "clarabel", "scipy-root-hybr", "casadi-sqpmethod",
}  # fmt: skip
"""A native solver of each room, and one of each large family of others, that get all checks by day."""


def _solvers() -> list:
    found = []
    modules = {type(solver).__module__ for solver in solvers if solver.spec.name in SAMPLED}
    for solver in solvers:
        name, module = solver.spec.name, type(solver).__module__
        kind = "native" if module.startswith("cpbench_solvers.") else "foreign"
        day = BY_DAY["automatic" if kind == "native" and name.startswith("auto-") else kind]
        if name in SAMPLED:
            day = set(checks("solver"))
        elif kind == "foreign" and solver.spec.by_default and module not in modules:
            modules.add(module)
            day = day | {"check_some_case_is_solved"}
        for check, call in checks("solver").items():
            marks = () if check in day else pytest.mark.nightly
            found.append(pytest.param(solver, call, id=f"{name}-{check}", marks=marks))
    return found


@pytest.mark.parametrize(("solver", "check"), _solvers())
def test_solver(solver, check, request: pytest.FixtureRequest) -> None:
    available = None if check.__name__ in OF_THE_SPEC else solver.availability()
    if available is not None and not available.ok:
        if solver.spec.licence == "proprietary":
            pytest.skip(
                f"needs a licence: pip install 'cpbench[path,commercial]' and a licence, {available.state} here"
            )
        if os.environ.get("CPBENCH_REQUIRE") == "all":
            pytest.fail(f"{solver.spec.name} is {available.state}: {available.detail}")
        pytest.skip(f"needs a package: {available.detail}")
    reason = solver.spec.known_failures.get(check.__name__)
    if reason is not None:
        request.applymarker(pytest.mark.xfail(reason=reason, strict=True, raises=(AssertionError, Ended)))
    check(solver, cases(solver.spec.node))


def test_specs_are_read_where_no_package_is_installed() -> None:
    """All of them by a process that can import none of the packages that some solver needs, as by another."""
    code = "import sys; sys.modules |= dict.fromkeys(sys.argv[1:]); from cpbench.solvers.base import solvers"
    code += "; print(*(s.spec.name for s in solvers))"
    packages = sorted({package for solver in solvers for package in solver.spec.requires})
    without, known = (
        subprocess.run([sys.executable, "-c", code, *absent], capture_output=True, text=True, check=True).stdout.split()
        for absent in (packages, ())
    )
    assert len(packages) > 15
    assert {"daqp", "clarabel"} <= set(known)  # of a module, and of a table
    assert without == known


FORMATS = [(form.name, form) for form in formats if form.writes]


@pytest.mark.parametrize(("form", "check"), _product("format", FORMATS))
def test_format(form, check) -> None:
    for node in sorted(form.writes):
        check(form, _some(check, cases(node)))


@pytest.mark.nightly
@pytest.mark.parametrize(("form", "check"), _product("format", FORMATS, FEW))
def test_format_in_every_case(form, check) -> None:
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


NATIVE = [s for s in solvers if type(s).__module__.startswith("cpbench_solvers.")]


@pytest.mark.needs("cpbench_solvers")
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
