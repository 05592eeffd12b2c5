"""Checks of a solver: it solves what was planted, or says honestly that it did not."""

from __future__ import annotations

import dataclasses
import inspect
import math
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np

from cpbench.errors import Ended, NotApplicable, ProblemError, UnknownName
from cpbench.formulations import Kind, Problem, formulations
from cpbench.foundation import matrices
from cpbench.proofs import certified_infeasible
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, Trait, parse_options
from cpbench.solvers.external.session import ProgramError
from cpbench.solvers.stopping import Stopping
from cpbench.testing import Case, only_for, refused
from cpbench.testing.cases import infeasible
from cpbench.testing.equivalents import in_unit
from cpbench.verification import judge

TOLERANCE = 1e-6
ASKED = (1e-2, 1e-4, 1e-6, 1e-8)
UNITS = (1e-6, 1.0, 1e6)
SECONDS = 120.0
"""For a case that takes far less: no claim may depend on how busy the machine is."""
PATIENCE = 4.0
"""Seconds for a case on which a solver is known to fail; one that hangs is given half as much again, and 5."""
KEPT = 512
"""Solves that are kept."""
SLACK = 1.001
"""A claim at the tolerance may be rounded; nothing beyond that."""


def _repeatable(call: Callable[..., Any]) -> Callable[..., Any]:
    """Keep what a solve of a deterministic solver returns, so that its checks do not repeat each other's solves:
    `check_the_same_twice` holds that it has the trait by right."""
    kept = lru_cache(maxsize=KEPT)(call)
    return lambda solver, *given: (kept if Trait.DETERMINISTIC in solver.spec.traits else call)(solver, *given)


@_repeatable
def _solved(solver: Solver, problem: Problem, budget: Budget, start: Any | None) -> SolverOutput:
    return solver.run(problem, budget, start=start)


def _run(solver: Solver, case: Case, start: Any | None = None, **budget: Any) -> SolverOutput:
    limits: dict[str, Any] = {"tolerance": TOLERANCE, "seconds": SECONDS, **budget}
    return _solved(solver, case.problem, Budget(**limits), start)


def _open(solver: Solver, cases: list[Case]) -> Iterator[Case]:
    """Yield cases that the solver takes and, by its own word (`known_failures`), does not fail on."""
    for case in cases:
        if f"case-{case.name}" not in solver.spec.known_failures and _takes(solver, case.problem):
            yield case


@_repeatable
def _takes(solver: Solver, problem: Problem) -> bool:
    """Return whether a solver takes a problem; a program may refuse one only when it has read it."""
    if solver.obstacle(problem) is not None:
        return False
    try:
        solver.hand_over(problem)
    except NotApplicable:
        return False
    return True


def _false(solver: Solver, case: Case, output: SolverOutput, tolerance: float) -> str | None:
    """Return what is false in a claim, if anything. A relaxation's claim is about its own problem.

    A claim is about what a budget's tolerance means to a solver: the residuals of the node (`Problem.residuals`). The
    verdict of a run is the judge's own, and stricter on problems in mixed units.
    """
    if output.claim is not Claim.SOLVED or solver.spec.kind is Kind.RELAXATION:
        return None
    if output.point is None:
        return f"{case.name}: claims solved and gives no answer"
    error = case.problem.residuals(output.point, tolerance).error if output.point.finite else math.inf
    return None if error <= SLACK * tolerance else f"{case.name}: claims solved, error {error:.1e} > {tolerance:.0e}"


def check_some_case_is_solved(solver: Solver, cases: list[Case]) -> None:
    """Check that a case is solved whose solution is not simply 0."""
    only_for(solver.spec.kind is not Kind.RELAXATION, "solvers of the whole law")
    for case in _open(solver, cases):
        if not judge(case.problem, case.problem.zero_point(), TOLERANCE).within:
            point = _run(solver, case).point
            if point is not None and judge(case.problem, point, TOLERANCE).within:
                return
    raise AssertionError("no planted case is solved")


def check_claims_are_true(solver: Solver, cases: list[Case]) -> None:
    for tolerance in (1e-4, TOLERANCE):
        for case in _open(solver, cases):
            why = _false(solver, case, _run(solver, case, tolerance=tolerance), tolerance)
            assert why is None, why


def check_one_iteration_claims_nothing_false(solver: Solver, cases: list[Case]) -> None:
    for case in _open(solver, cases):
        why = _false(solver, case, _run(solver, case, iterations=1), TOLERANCE)
        assert why is None, why


def check_answers_have_their_shape(solver: Solver, cases: list[Case]) -> None:
    for case in _open(solver, cases):
        output = _run(solver, case)
        if output.point is not None:
            sizes = {name: value.size for name, value in output.point.arrays().items()}
            assert sizes == case.problem.point_sizes, f"{case.name}: the answer has sizes {sizes}"
        assert isinstance(output.claim, Claim)
        assert all(isinstance(v, int) and v >= 0 for v in output.counters.values()), output.counters


def check_the_problem_stays(solver: Solver, cases: list[Case]) -> None:
    for case in _open(solver, cases):
        unchanged, _ = _second(solver, case.problem)
        assert unchanged, case.name


@_repeatable
def _second(solver: Solver, problem: Problem) -> tuple[bool, SolverOutput]:
    """Return a solve apart from that of `_run`: whether it leaves the problem as it was, and what it returns."""
    before = _content(problem)
    output = solver.run(problem, Budget(tolerance=TOLERANCE, seconds=SECONDS))
    return before == _content(problem), output


def _content(problem: Problem) -> dict[str, bytes]:
    """Return digests of matrices and vectors, and of maps read anew: the digest of a map is kept."""
    data = {k: matrices.digest(v) for k, v in problem.data().items()}
    return data | {k: dataclasses.replace(F).digest for k, F in problem.maps().items()}


def check_infeasibility_is_proved_or_not_claimed_solved(solver: Solver, cases: list[Case]) -> None:
    """Check that no problem without a solution is claimed solved, and that certificates hold."""
    for case in infeasible(solver.spec.node):
        if solver.obstacle(case.problem) is None:
            try:
                output = _run(solver, case)
            except Exception:  # no claim: the runner gives it its own row
                continue
            assert output.claim is not Claim.SOLVED, f"{case.name}: claims to solve what has no solution"
            if output.certificate is not None:
                assert certified_infeasible(case.problem, output.certificate), f"{case.name}: the certificate is false"


def check_the_same_twice(solver: Solver, cases: list[Case]) -> None:
    only_for(Trait.DETERMINISTIC in solver.spec.traits, "solvers with the trait deterministic")
    for case in _open(solver, cases):
        first = _run(solver, case)
        _, second = _second(solver, case.problem)
        assert first.claim is second.claim, case.name
        _same_point(first.point, second.point, case.name)


def check_warm_starts_are_taken(solver: Solver, cases: list[Case]) -> None:
    """Check that started from solutions, a solver with the trait makes true claims and counts no more iterations than
    from 0.

    Some case is solved by one iteration from its solution and not by one from 0: what a solver does tells that it
    looks at its start, for what it counts may be untrue. Started from its own right answer, it ends in one again.
    """
    only_for(Trait.WARM_START in solver.spec.traits, "solvers with the trait warm-start")
    gained = False
    for case in _open(solver, cases):
        warm, cold = _run(solver, case, case.point), _run(solver, case)
        why = _false(solver, case, warm, TOLERANCE)
        assert why is None, why
        counted = "iterations" in warm.counters and "iterations" in cold.counters
        assert counted, f"{case.name}: counts no iterations, so that the worth of a start cannot be measured"
        few, many = warm.counters["iterations"], cold.counters["iterations"]
        assert few <= many, f"{case.name}: {few} iterations from the solution, {many} from 0"
        assert warm.claim is Claim.SOLVED or cold.claim is not Claim.SOLVED, (
            f"{case.name}: solved from 0, from its solution it ends as {warm.claim}"
        )
        gained = gained or (
            _solves(case, _run(solver, case, case.point, iterations=1))
            and not _solves(case, _run(solver, case, iterations=1))
        )
        if cold.claim is Claim.SOLVED:
            again = _run(solver, case, cold.point)
            assert again.claim is Claim.SOLVED, f"{case.name}: from its own answer it ends as {again.claim}"
            why = _false(solver, case, again, TOLERANCE)
            assert why is None, f"from its own answer: {why}"
    assert gained, "one iteration from a solution does no more than one from 0: the start is not used"


def _solves(case: Case, output: SolverOutput) -> bool:
    return output.point is not None and judge(case.problem, output.point, TOLERANCE).within


def check_histories_end_in_the_answer(solver: Solver, cases: list[Case]) -> None:
    """Check that iterations rise from 0, every iterate is an answer to the node's problem, the last one is what was
    claimed."""
    only_for(Trait.HISTORY in solver.spec.traits, "solvers with the trait history")
    recorded = 0
    for case in _open(solver, cases):
        seen, output = _recorded(solver, case.problem)
        recorded += len(seen) > 1
        iterations = [k for k, _ in seen]
        assert iterations == sorted(set(iterations)), f"{case.name}: iterations {iterations} do not rise"
        assert iterations[:1] in ([], [0]), f"{case.name}: begins with iteration {iterations[0]}, not with the start"
        for k, point in seen:
            assert isinstance(point, case.problem.point_type), f"{case.name}, iteration {k}: {type(point).__name__}"
            sizes = {name: value.size for name, value in point.arrays().items()}
            assert sizes == case.problem.point_sizes, f"{case.name}, iteration {k}: sizes {sizes}"
        if seen and output.claim is Claim.SOLVED:
            _same_point(seen[-1][1], output.point, f"{case.name}: the last iterate and the answer")
    assert recorded, "nothing is recorded"


def check_watching_changes_nothing(solver: Solver, cases: list[Case]) -> None:
    """Check that answer and counters are the same without a recorder, and with one that takes none or all iterates."""
    only_for({Trait.HISTORY, Trait.DETERMINISTIC} <= solver.spec.traits, "deterministic solvers with the trait history")
    for case in _open(solver, cases):
        alone = _run(solver, case)
        for watched in (
            _watched(solver, case.problem, lambda k, e, point: None),
            _recorded(solver, case.problem)[1],
        ):
            assert (watched.claim, watched.counters) == (alone.claim, alone.counters), case.name
            _same_point(watched.point, alone.point, f"{case.name}: the answers watched and alone")


@_repeatable
def _recorded(solver: Solver, problem: Problem) -> tuple[list[tuple[int, Any]], SolverOutput]:
    """Return all iterates of a solve with their numbers, and what it returns."""
    seen: list[tuple[int, Any]] = []
    return seen, _watched(solver, problem, lambda k, _, point: seen.append((k, point())))


def _watched(solver: Solver, problem: Problem, record: Record) -> SolverOutput:
    return solver.run(problem, Budget(tolerance=TOLERANCE, seconds=SECONDS), record=record)


def _same_point(one: Any, other: Any, what: str) -> None:
    assert (one is None) == (other is None), what
    if one is not None:
        for a, b in zip(one.arrays().values(), other.arrays().values(), strict=True):
            np.testing.assert_array_equal(a, b, err_msg=what)


def check_options_are_known_by_name(solver: Solver, cases: list[Case]) -> None:
    """Check that the options are a frozen dataclass with a default for everything, and the only ones."""
    options: Any = solver.spec.options
    assert dataclasses.is_dataclass(options), f"{options.__name__} is no dataclass"
    assert options.__dataclass_params__.frozen, f"{options.__name__} is not frozen"  # pyright: ignore
    for option in dataclasses.fields(options):
        assert option.default is not dataclasses.MISSING, f"the option {option.name} has no default"
    assert parse_options(solver.spec, {}) == options()
    with refused(UnknownName, "option", "an unknown option"):
        parse_options(solver.spec, {"no_such_option": "1"})


def check_the_spec_is_complete(solver: Solver, cases: list[Case]) -> None:
    spec = solver.spec
    assert spec.node in formulations
    assert spec.summary
    assert spec.method
    assert spec.licence
    assert inspect.getdoc(type(solver)), "the class has no docstring"
    assert all(reason for reason in spec.known_failures.values())


def check_known_failures_still_fail(solver: Solver, cases: list[Case]) -> None:
    """Check that on a case that the spec excuses it claims what is not, answers with no numbers, or its process ends or
    hangs, at one of the tolerances; else the excuse must go."""
    excused = [case for case in cases if f"case-{case.name}" in solver.spec.known_failures]
    only_for(bool(excused), "solvers that excuse a case")
    for case in excused:
        fails = any(_fails(solver, case, tolerance) for tolerance in (1e-4, TOLERANCE))
        assert fails, f"{case.name} no longer fails: take case-{case.name} out of known_failures"


def _fails(solver: Solver, case: Case, tolerance: float) -> bool:
    try:
        output = _run(solver, case, tolerance=tolerance, seconds=PATIENCE)
    except (Ended, ProgramError):
        return True
    numbers = output.point is None or output.point.finite
    return not numbers or _false(solver, case, output, tolerance) is not None


def check_tolerances_are_no_looser(solver: Solver, cases: list[Case]) -> None:
    """Check that no value that a package is asked for is looser than its default or than the tolerance, that a smaller
    tolerance never loosens one, and that none depends on where a problem starts."""
    only_for(solver.stopping(TOLERANCE) is not None, "adapters, whose packages have tests of their own")
    for problem in (None, *(case.problem for case in cases)):
        criteria = [(tolerance, _stopping(solver, tolerance, problem)) for tolerance in ASKED]
        for tolerance, one in criteria:
            assert one.test, "what the package compares is not said"
            assert one.factor == 1.0 or one.differs, f"factor {one.factor:g}, and not said why"
            assert one.settings.keys() == one.defaults.keys(), f"{[*one.settings]}, defaults {[*one.defaults]}"
            for name, value in one.settings.items():
                most = min(tolerance, one.defaults[name])
                assert 0.0 <= value <= most, f"{name} = {value:g} for {tolerance:g}, at most {most:g}"
        for (_, before), (tolerance, after) in pairwise(criteria):
            for name, value in after.settings.items():
                assert value <= before.settings[name], f"{name} grows where the tolerance falls to {tolerance:g}"
        if problem is not None and hasattr(problem, "start"):
            elsewhere = dataclasses.replace(problem, start=problem.start + 1e3)
            assert _stopping(solver, TOLERANCE, elsewhere).settings == _stopping(solver, TOLERANCE, problem).settings


def check_claims_hold_in_other_units(solver: Solver, cases: list[Case], units: Sequence[float] = UNITS) -> None:
    """Check that an answer to any case that is claimed to be solved misses the tolerance, as the judge measures it, by
    no more than the adapter declares."""
    only_for(solver.stopping(TOLERANCE) is not None, "adapters, whose packages have tests of their own")
    only_for(solver.spec.kind is not Kind.RELAXATION, "solvers of the whole law")
    taken = list(in_units(solver, cases, units))
    only_for(bool(taken), "solvers that take a planted case in other units")
    for case in taken:
        try:
            output = solver.run(case.problem, Budget(tolerance=TOLERANCE, seconds=PATIENCE))
        except (Ended, ProgramError, ProblemError):  # a process that ends claims nothing, nor who refuses the numbers
            continue
        if output.claim is Claim.SOLVED:
            most = SLACK * TOLERANCE * _stopping(solver, TOLERANCE, case.problem).factor
            error = math.inf if output.point is None else judge(case.problem, output.point, TOLERANCE).error
            assert error <= most, f"{case.name}: claims solved, error {error:.1e}, at most {most:.1e} is declared"


def in_units(solver: Solver, cases: list[Case], units: Sequence[float]) -> Iterator[Case]:
    """Yield the cases that a solver does not excuse, and that 0 does not solve, in the units in which it takes them."""
    for case in cases:
        zero = judge(case.problem, case.problem.zero_point(), TOLERANCE).within
        if zero or f"case-{case.name}" in solver.spec.known_failures:
            continue
        scaled = (in_unit(case, unit) for unit in units)
        yield from (one for one in scaled if one is not None and solver.obstacle(one.problem) is None)


def _stopping(solver: Solver, tolerance: float, problem: Any) -> Stopping:
    result = solver.stopping(tolerance, problem)
    assert result is not None
    return result


def check_the_spec_is_read_without_the_package(solver: Solver, cases: list[Case]) -> None:
    """Load the solver's module, with its spec, where the packages that it needs cannot be imported."""
    only_for(bool(solver.spec.requires), "solvers that need a package")
    cls = type(solver)
    names = _specs_without(sys.modules[cls.__module__].__file__ or "", tuple(solver.spec.requires))
    assert solver.spec.name in names.splitlines(), f"{cls.__module__} without its packages: {names}"


@cache
def _specs_without(file: str, packages: tuple[str, ...]) -> str:
    """Return names of the solvers in a Python file, read in a fresh process without some packages; or what went
    wrong."""
    run = subprocess.run([sys.executable, "-c", _BLOCKED, file, *packages], capture_output=True, text=True, timeout=120)
    return run.stdout if run.returncode == 0 else (run.stderr.strip().splitlines() or ["no message"])[-1]


_BLOCKED = """
import importlib.util, sys
from cpbench.registry import Registry
add = Registry.add
def added(registry, name, *item):
    print(name)
    return add(registry, name, *item)
Registry.add = added
for package in sys.argv[2:]:
    sys.modules[package] = None  # importing it raises ModuleNotFoundError
found = importlib.util.spec_from_file_location("module_under_check", sys.argv[1])
module = importlib.util.module_from_spec(found)
sys.modules[found.name] = module
found.loader.exec_module(module)
"""
