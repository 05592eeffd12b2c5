"""Contract of the solvers: a static spec, an obstacle, and a solve that returns a claim, never a verdict."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import math
import sys
import time
import traceback
import typing
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum, StrEnum
from functools import cache
from typing import Any, ClassVar, TypeAlias

from cpbench import __version__
from cpbench.errors import NotApplicable, UnknownName
from cpbench.formulations.base import Kind, Point, Problem, formulations
from cpbench.formulations.stack import Stack
from cpbench.foundation.extensions import ADAPTERS, NATIVE
from cpbench.foundation.matrices import Vector
from cpbench.registry import Registry
from cpbench.solvers.stopping import Stopping


class Trait(StrEnum):
    """Ability of a solver, read without running it."""

    SPARSE = "sparse"
    WARM_START = "warm-start"
    HISTORY = "history"
    """Hands its iterates to `Record`, the last of them being its answer where it claims to have solved."""
    DETERMINISTIC = "deterministic"
    LAUNCHES = "launches"
    """Starts a program for every solve, whose launch is in its time: tables and figures say so."""


class Claim(StrEnum):
    """A solver's own account of its answer. It is recorded and compared with the verdict, never believed."""

    SOLVED = "solved"
    INACCURATE = "inaccurate"
    """Solved, to less than what was asked."""
    INFEASIBLE = "infeasible"
    UNBOUNDED = "unbounded"
    MAX_ITER = "max_iter"
    FAILED = "failed"
    """Gave up: ray termination without proof, a breakdown, a stall."""


@dataclass(frozen=True)
class NoOptions:
    """The options of a solver that has none."""


@dataclass(frozen=True, kw_only=True)
class SolverSpec:
    """Everything about a solver that can be read without importing its package.

    A name is the method, then what distinguishes it from its relatives, then the node where the method would not tell
    it: ``pgs``, ``pgs-mlcp``, ``newton-fb-micp``, ``interior-point-fc``.

    - One method has one name on all nodes. The node of the literature goes without: ``lemke`` is for lcp.
    - The node is written as it is registered, at the end: ``auto-fc``, not ``auto-contact``.
    - Newton's methods on an equation are ``newton-EQUATION``: ``newton-fb``, ``newton-alart-curnier``. Methods that
      the literature calls by a name keep it: ``josephy-newton``, ``proximal-newton``, ``tresca-fixed-point``.
    - A backend comes first, then its own name of the method: ``siconos-fc3d-nsgs``, ``gams-path-micp``.

    Names that were otherwise before are in `solvers.renamed`.

    Attributes
    ----------
    name : registry name. node : the formulation it solves. summary : one line. method : kind of algorithm.
    requires : import names of the packages it needs, `install` : how to get them.
    kind : EQUIVALENT, or RELAXATION where the solver drops a term of the law.
    options : frozen dataclass of typed options with defaults; an Enum or a Literal limits the values of one.
    by_default : whether a run that names no solver takes it; of a large family only the best known members do.
    quick : whether the quick suite takes it: it comes with cpbench or its extra `backends`, and solves small problems
        at once.
    known_failures : conformance check -> reason, strict (an unexpected pass fails).
    """

    name: str
    node: str
    summary: str
    method: str
    citation: str = ""
    requires: tuple[str, ...] = ()
    install: str = ""
    licence: str = "Apache-2.0"
    publishing: str = ""
    kind: Kind = Kind.EQUIVALENT
    traits: frozenset[Trait] = frozenset()
    options: type = NoOptions
    by_default: bool = True
    quick: bool = False
    known_failures: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Budget:
    """Limits of a solve.

    Attributes
    ----------
    tolerance : ours: on the judged error of the node's `residuals`. `Solver.stopping` says what an adapter makes of it.
    seconds : wall-clock limit (enforced from outside; a solver that has its own limit gets it).
    iterations : the most iterations, None for the solver's own bound. seed : for solvers that draw.
    """

    tolerance: float = 1e-6
    seconds: float = math.inf
    iterations: int | None = None
    seed: int = 0

    def deadline(self) -> float:
        """Return when the seconds are over, if they begin now: a time of `time.perf_counter`."""
        return time.perf_counter() + self.seconds

    def left(self, deadline: float, spent: int = 0) -> Budget:
        """Return what remains: the seconds until `deadline`, and the iterations less those that are spent."""
        iterations = None if self.iterations is None else max(self.iterations - spent, 0)
        return dataclasses.replace(self, seconds=max(deadline - time.perf_counter(), 0.0), iterations=iterations)


@dataclass(frozen=True, kw_only=True)
class SolverOutput:
    """Result of a solve: a claim, an answer if there is one, counters (iterations, pivots, factorizations,
    matrix_vector_products, projections, ...), a message, a certificate of infeasibility (to rounding) if there is one,
    and the seconds that the solver says it took (`reported`: kept beside our own time, never in its place)."""

    claim: Claim
    point: Any | None = None
    counters: Mapping[str, int] = field(default_factory=dict)
    message: str = ""
    certificate: Vector | None = None
    reported: float | None = None


def solved(point: Point, counters: Mapping[str, int], message: str = "") -> SolverOutput:
    """Return the output of a solver that claims to have solved."""
    return SolverOutput(claim=Claim.SOLVED, point=point, counters=counters, message=message)


Record: TypeAlias = Callable[[int, float, Callable[[], Any]], None]
"""Called by a solver with (iteration, its residual, what makes its iterate an answer to the node's problem).

The iterations rise from call to call, 0 is the start; the residual is NaN where it was not measured. The third
argument is called at once or not at all, so that an iterate that is not kept costs nothing. The receiver keeps the
time, less what it takes itself. An answer must not depend on whether somebody records.
"""


@dataclass(frozen=True)
class StackCall:
    """One compiled call for many small problems of one size. Its answers are right or not: the caller measures them.

    Attributes
    ----------
    solve : (stack, tolerance, threads) -> (k, size) of every part of a point by name. unknowns : of the largest problem
    for which one call is faster. shares : of the tolerance, that the call is asked for at first and again.
    """

    solve: Callable[[Stack, float, int], dict[str, Any]]
    unknowns: int = 64
    shares: tuple[float, ...] = (1.0,)


@dataclass(frozen=True)
class Availability:
    """State of a solver on this machine: ok, missing (what to install), broken (the traceback) or licence."""

    state: str
    detail: str = ""

    @property
    def ok(self) -> bool:
        return self.state == "ok"


class Solver(ABC):
    """One algorithm or one backend. Instances carry no state."""

    spec: ClassVar[SolverSpec]
    stack_call: ClassVar[StackCall | None] = None
    """How the solver begins many small problems of one size, None where it takes them one by one."""
    own_clock: ClassVar[bool] = False
    """Whether `reported` is taken by code of cpbench around the call of the method, in the process that makes it."""

    @property
    def origin(self) -> str:
        """`native` for a method of cpbench, `adapter` for what it hands to other packages, else `plugin`."""
        return ORIGINS.get(type(self).__module__.partition(".")[0], "plugin")

    @property
    def round_trip(self) -> float | None:
        """Seconds that an empty request takes to the process that solves and back; None where that is this one."""
        return None

    def obstacle(self, problem: Any) -> str | None:
        """Return why this problem is not for this solver (cheap to tell), else None."""
        return None

    def hand_over(self, problem: Any) -> Any:
        """Bring the problem to where it is solved; what this returns is what `setup` gets. Never timed: another
        process has to read what a solver in this one finds in its memory. Raises Unavailable, Ended, NotApplicable."""
        return problem

    def setup(self, problem: Any, budget: Budget, options: Any) -> Any:
        """Do what is done once a problem (change of storage, a model): timed as `setup`, passed to `solve`."""
        return problem

    @abstractmethod
    def solve(
        self, prepared: Any, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        """Solve what `setup` returned. May raise: the message becomes the row of an `error`; NotApplicable,
        Unavailable and Ended (a separate process died) have rows of their own."""

    def collect(self, output: SolverOutput) -> SolverOutput:
        """Bring the answer back from where it was found. Never timed, as `hand_over`."""
        return output

    def run(
        self,
        problem: Problem,
        budget: Budget | None = None,
        options: Any = None,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        """Run all steps in one go, in this process; for scripts and tests.

        Parameters
        ----------
        budget, options : None: the default ones. start : a point of the node, None: where the solver begins by itself.

        Raises whatever the steps raise: Unavailable, Ended, NotApplicable, or an error of the solver.
        """
        budget = budget or Budget()
        options = self.spec.options() if options is None else options
        prepared = self.setup(self.hand_over(problem), budget, options)
        return self.collect(self.solve(prepared, budget, options, start, record))

    def stopping(self, tolerance: float, problem: Any = None) -> Stopping | None:
        """Return the test by which a package ends that is asked for this tolerance; None for a solver that ends by an
        error of its own node, as those of cpbench do, or by the tolerance as it is, as programs of users do.

        problem : of the solver's node, whose data may enter; None for one with data of size one.
        """
        return None

    def warmup(self) -> None:
        """Load whatever the first solve would: called once a process, never timed."""

    def version(self) -> str:
        """Return the version of the guest package, of cpbench for its own solvers, '' for others that need no
        package."""
        if self.spec.requires:
            return package_version(self.spec.requires[0])
        return __version__ if self.origin != "plugin" else ""

    def availability(self) -> Availability:
        """Return whether the solver can run on this machine, and what to do where it cannot; imports its packages."""
        return probe(self.spec.requires, self.spec.install)


def missing(spec: SolverSpec) -> str:
    """Return how to install a solver whose packages are not there, '' where they are; nothing is imported.

    >>> missing(SolverSpec(name="s", node="lcp", summary="", method="", requires=("numpy", "no_such_package")))
    'pip install no_such_package'
    """
    absent = (name for name in spec.requires if importlib.util.find_spec(name) is None)
    return next((spec.install or f"pip install {name}" for name in absent), "")


@cache
def probe(requires: tuple[str, ...], install: str) -> Availability:
    """Import the packages and say what happened; `missing` and `broken` are two things."""
    for name in requires:
        if importlib.util.find_spec(name) is None:
            return Availability("missing", install or f"pip install {name}")
    for name in requires:
        try:
            importlib.import_module(name)
        except Exception:
            return Availability("broken", traceback.format_exc(limit=3))
    return Availability("ok")


def package_version(import_name: str) -> str:
    """Return the version of the distribution that provides `import_name`, else what the imported module says, else
    ''."""
    from importlib.metadata import PackageNotFoundError, distribution

    with suppress(PackageNotFoundError):  # most are called as what they provide, and the walk takes long
        same = distribution(import_name)
        if any(file.parts[0].partition(".")[0] == import_name for file in same.files or ()):
            return same.version
    for name in _distributions().get(import_name, [import_name]):
        with suppress(PackageNotFoundError):
            return distribution(name).version
    return str(getattr(sys.modules.get(import_name), "__version__", ""))


@cache
def _distributions() -> Mapping[str, list[str]]:
    """Return distributions by import name: a walk through all that is installed, which takes half a second."""
    from importlib.metadata import packages_distributions

    return packages_distributions()


def choices(options: type, name: str) -> tuple[Any, ...]:
    """Return all values that an option may have, the members of an Enum or the values of a Literal; () where any value
    of its type is allowed."""
    option = next(f for f in dataclasses.fields(options) if f.name == name)
    if isinstance(option.default, Enum):
        return tuple(type(option.default))
    if "Literal" not in str(option.type):  # other annotations may name what is not imported at run time
        return ()
    hint = typing.get_type_hints(options)[name]
    return typing.get_args(hint) if typing.get_origin(hint) is typing.Literal else ()


def written(value: Any) -> str:
    """Return a value of an option as it is typed on the command line."""
    if isinstance(value, Enum):
        return str(value.value)
    return str(value).lower() if isinstance(value, bool) else str(value)


def parse_options(spec: SolverSpec, text: Mapping[str, str]) -> Any:
    """Return the dataclass of options with values read from strings, as ``{"omega": "1.2"}``.

    Raises UnknownName, with the option named, where there is none or its value is not of its type or its choices.
    """
    fields = {f.name: f for f in dataclasses.fields(spec.options)}
    values: dict[str, Any] = {}
    for key, raw in text.items():
        if key not in fields:
            raise UnknownName(f"option of {spec.name}", key, fields)
        values[key] = _typed(spec.name, key, raw, fields[key].default)
        allowed = choices(spec.options, key)
        if allowed and values[key] not in allowed:
            raise UnknownName(f"value of {spec.name}[{key}]", raw, [written(choice) for choice in allowed])
    return spec.options(**values)


def _typed(solver: str, key: str, raw: str, default: Any) -> Any:
    try:
        if isinstance(default, bool):
            return {"true": True, "false": False, "1": True, "0": False}[raw.lower()]
        return type(default)(raw)
    except (KeyError, ValueError, TypeError):
        raise UnknownName(f"value of {solver}[{key}] ({type(default).__name__})", raw, [str(default)]) from None


ORIGINS = {NATIVE: "native", ADAPTERS: "adapter"}
"""Packages of solvers that come with cpbench."""
solvers: Registry[Solver] = Registry("solver")


def register(cls: type[Solver]) -> type[Solver]:
    """Put one instance of a solver class into the registry, and return the class: a decorator.

    Raises DuplicateName where the name is taken.
    """
    solvers.add(cls.spec.name, cls())
    return cls


def warm_up(solver: Solver) -> None:
    """Warm a solver up before its first solve, once a process: what its package loads is not the time of a solve."""
    if solver.spec.name not in _warm:
        solver.warmup()
        _warm.add(solver.spec.name)


_warm: set[str] = set()
"""Solvers that have warmed up in this process."""


def solve(problem: Problem, solver: str, budget: Budget | None = None, **options: Any) -> SolverOutput:
    """Solve a problem by a registered solver of its own node, in this process, without limits or verdict.

    `options` : fields of the solver's dataclass of options. Raises NotApplicable when the solver is for another node or
    refuses the problem, UnknownName.
    """
    chosen = solvers.get(solver)
    if chosen.spec.node != problem.node:
        raise NotApplicable(solver, f"solves {chosen.spec.node}, not {problem.node}; bring the problem there first")
    why = chosen.obstacle(problem)
    if why is not None:
        raise NotApplicable(solver, why)
    return chosen.run(problem, budget, chosen.spec.options(**options))


def automatic_solver(node: str) -> str | None:
    """Return the name of the automatic choice of a formulation, None where it has none; modules of other solvers are
    not imported."""
    name = f"auto-{node}"
    return name if solvers.knows(name) else None


def automatic_solvers() -> dict[str, str]:
    """Return the automatic choice of each formulation that has one, by formulation."""
    automatic = ((node, automatic_solver(node)) for node in formulations.names())
    return {node: name for node, name in automatic if name is not None}
