"""Siconos' numerics: what its solvers share. One guest program in the Python that has python3-siconos serves each.

Which Python that is: the environment variable CPBENCH_SICONOS_PYTHON; else this one, if it has siconos; else the
system's. A solver of Siconos may end its process (assertions, exit(1), segmentation faults): that is its row. Its
info is passed on as a claim: 0 is solved; all else is max_iter where the iterations that it counted reached the
bound, and failed otherwise, for the codes mean something else in every solver.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

from cpbench.formulations.base import Kind
from cpbench.solvers.base import Availability, Budget, Record, SolverOutput, SolverSpec, Trait
from cpbench.solvers.external.served import HandedOver, ServedSolver
from cpbench.solvers.stopping import Stopping
from cpbench_adapters.siconos_tolerances import NAME, Bound, ErrorTest, limit, stopping

PYTHON = "CPBENCH_SICONOS_PYTHON"
INSTALL = f"apt install python3-siconos, or name a Python that has siconos in {PYTHON}"
GUEST = Path(__file__).parent / "guests" / "siconos_guest.py"
PATIENCE = 60.0
"""Seconds that Siconos may take to be imported."""
MOST_INDEX_SETS = 16
"""Exponent up to which enumeration is let loose: 2²⁰ factorizations took ten seconds at n = 20."""


@dataclass(frozen=True, kw_only=True)
class SiconosEntry:
    """A solver of Siconos as it stands in the table of its family.

    Attributes
    ----------
    name, summary, method, citation, by_default : of its spec. constant : its number's name in Siconos.
    default : its own tolerance.
    storage : of the matrices, dense, blocks or sparse; `given` is dense or blocks, as the problem is.
    bound : iterations if the budget has no bound. inner : of the subproblems: a constant, if not the default.
    dimension : rows of a contact, where a solver is for one. enumerates : whether it tries 2ⁿ index sets.
    warm : whether a start is used and shortens it (the local ADMM and MLCP_FB need more iterations from a solution).
    false : case -> our error, where it claims what is not. ends : case -> how its process ended, or its time.
    early : the same after one iteration, where it is right in the end. impossible : problems without a solution that it
    claims to have solved. failures : check -> reason, for the rest.
    """

    name: str
    constant: str
    default: float
    summary: str
    method: str
    citation: str
    by_default: bool = False
    storage: str = "dense"
    bound: Bound = Bound.SWEEPS
    inner: str = ""
    dimension: int = 0
    enumerates: bool = False
    warm: bool = False
    false: Mapping[str, float] = field(default_factory=dict)
    ends: Mapping[str, str] = field(default_factory=dict)
    early: Mapping[str, float] = field(default_factory=dict)
    impossible: tuple[str, ...] = ()
    failures: Mapping[str, str] = field(default_factory=dict)

    @property
    def traits(self) -> frozenset[Trait]:
        given = {Trait.SPARSE: self.storage != "dense", Trait.WARM_START: self.warm, Trait.DETERMINISTIC: True}
        return frozenset(trait for trait, has in given.items() if has)

    @property
    def known_failures(self) -> Mapping[str, str]:
        """In the words of a spec."""
        failures = {f"case-{case}": f"info 0, our error {error:.1e}" for case, error in self.false.items()}
        failures |= {f"case-{case}": how for case, how in self.ends.items()} | dict(self.failures)
        if self.early:
            errors = ", ".join(f"{error:.1e} ({case})" for case, error in self.early.items())
            failures["check_one_iteration_claims_nothing_false"] = f"info 0 after one iteration, our error {errors}"
        if self.impossible:
            failures["check_infeasibility_is_proved_or_not_claimed_solved"] = f"info 0: {', '.join(self.impossible)}"
        return failures


@dataclass(frozen=True)
class SiconosSettings:
    """Settings that the guest gets with every solve."""

    tolerance: float
    max_iter: int
    inner: str


class SiconosSolver(ServedSolver):
    """A solver of Siconos; subclasses have the node and say which of its problems Siconos can hold."""

    own_clock: ClassVar[bool] = True
    node: ClassVar[str]
    test: ClassVar[ErrorTest]

    def __init__(self, row: SiconosEntry) -> None:
        self.row = row
        spec = SolverSpec(
            name=row.name,
            node=self.node,
            summary=row.summary,
            method=row.method,
            citation=row.citation,
            install=INSTALL,
            kind=Kind.EQUIVALENT,
            traits=row.traits,
            by_default=row.by_default,
            known_failures=row.known_failures,
        )
        guest = (str(GUEST), row.constant, "--storage", row.storage)
        super().__init__(spec, (interpreter(), *guest), env={"PYTHONDONTWRITEBYTECODE": "1"})

    def obstacle(self, problem: Any) -> str | None:
        if not sum(problem.point_sizes.values()):
            return "has no unknowns: Siconos asserts that there are some and aborts"
        return None

    def solve(
        self, prepared: HandedOver, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        requested = self.stopping(budget.tolerance, prepared.problem).settings[NAME]
        settings = SiconosSettings(tolerance=requested, max_iter=limit(budget, self.row.bound), inner=self.row.inner)
        return super().solve(prepared, budget, settings, start, record)

    def stopping(self, tolerance: float, problem: Any = None) -> Stopping:
        return stopping(self.test, self.row.default, tolerance, problem)

    def version(self) -> str:
        return str(about(interpreter()).get("version", ""))

    def availability(self) -> Availability:
        about_python = about(interpreter())
        if "version" not in about_python:
            return Availability(about_python["state"], about_python["detail"])
        if self.row.constant not in about_python["constants"]:
            return Availability("missing", f"Siconos {about_python['version']} has no {self.row.constant}")
        return Availability("ok")


def index_sets(n: int) -> str | None:
    """Return the obstacle of enumeration."""
    return f"2^{n} index sets to try, at most 2^{MOST_INDEX_SETS} are" if n > MOST_INDEX_SETS else None


@cache
def interpreter() -> str:
    """Return the Python that runs Siconos."""
    own = sys.executable if importlib.util.find_spec("siconos") else "/usr/bin/python3"
    return os.environ.get(PYTHON) or own


@cache
def about(python: str) -> Mapping[str, Any]:
    """Return version and constants of the Siconos that a Python has, or state and detail; asked once for the whole
    family."""
    try:
        done = subprocess.run([python, str(GUEST)], capture_output=True, text=True, timeout=PATIENCE, check=False)
    except FileNotFoundError:
        return {"state": "missing", "detail": f"{python}: no such program; {INSTALL}"}
    except (OSError, subprocess.SubprocessError) as cause:
        return {"state": "broken", "detail": f"{python}: {cause}"}
    if done.returncode == 0:
        return json.loads(done.stdout.splitlines()[-1])
    message = done.stderr.strip()
    if message.endswith("No module named 'siconos'"):
        return {"state": "missing", "detail": f"{python} has no siconos; {INSTALL}"}
    return {"state": "broken", "detail": message or f"{python} ended with {done.returncode}"}
