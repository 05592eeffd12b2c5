"""Plugins that are wrong in one way each, outside every registry.

tests/conformance/test_broken.py holds that the named check, and not something else, catches each.
"""

from __future__ import annotations

import colorsys  # stands for a third-party package in NeedsItsPackageToBeRead
import dataclasses
import json
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from cpbench.conversions.linear import MLCPtoLCPSchur
from cpbench.errors import FormatError, NotApplicable
from cpbench.formulations import LCP, Kind, LCPPoint, MLCPPoint, Residuals
from cpbench.foundation import matrices
from cpbench.solvers.base import Claim, Solver, SolverOutput, SolverSpec, Trait
from cpbench.solvers.stopping import Stopping
from cpbench.storage import Format
from cpbench_solvers.lcp.lemke import Lemke
from cpbench_solvers.lcp.semismooth_newton import NewtonMin


class SignFlippedLift(MLCPtoLCPSchur):
    # u with the wrong sign

    def lift(self, point, trace):
        right = super().lift(point, trace)
        return MLCPPoint(u=-right.u, v=right.v)


class EditsItsInput(MLCPtoLCPSchur):
    # Scales A of the problem it was given

    def apply(self, problem):
        object.__setattr__(problem, "A", matrices.matrix(2.0 * problem.A))
        return super().apply(problem)


class IgnoresItsObstacle(MLCPtoLCPSchur):
    # Says that a singular block cannot be eliminated, and eliminates it

    def apply(self, problem):
        n = problem.a.size
        return super().apply(dataclasses.replace(problem, A=matrices.dense(problem.A) + np.eye(n)))


class PromisesTooMuch(MLCPtoLCPSchur):
    # Equivalent or one-way by its class, approximate for every problem

    def exactness(self, problem):
        return Kind.APPROXIMATE


class ForgetsItsTrace(MLCPtoLCPSchur):
    # Keeps for itself what `lift` needs

    def apply(self, problem):
        target, trace = super().apply(problem)
        object.__setattr__(self, "kept", trace)
        return target, {}

    def lift(self, point, trace):
        return super().lift(point, self.kept)


class RefusesOnTheWay(MLCPtoLCPSchur):
    # Tells no obstacle, and refuses nevertheless

    def obstacle(self, problem):
        return None

    def apply(self, problem):
        raise NotApplicable(self.label, "changed its mind")


class LooksAtTheStorage(MLCPtoLCPSchur):
    # Converts a sparse problem to another one than the same problem when dense

    def apply(self, problem):
        target, trace = super().apply(problem)
        return (dataclasses.replace(target, q=2.0 * target.q) if matrices.is_sparse(problem.A) else target), trace


class _LCPSolver(Solver):
    spec = SolverSpec(
        name="broken", node="lcp", summary="wrong", method="none", traits=frozenset({Trait.DETERMINISTIC})
    )


class ClaimsZeros(_LCPSolver):
    """Zeros, claimed solved."""

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.zeros(prepared.q.size)))


class ClaimsNaN(_LCPSolver):
    """NaN, claimed solved."""

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=np.full(prepared.q.size, np.nan)))


class WrongShape(_LCPSolver):
    """One number too many, honestly."""

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.FAILED, point=LCPPoint(z=np.zeros(prepared.q.size + 1)))


class SwallowsErrors(_LCPSolver):
    """An exception inside becomes an answer that was never computed."""

    def solve(self, prepared, budget, options, start=None, record=None):
        try:
            z = np.linalg.no_such_function(prepared.M)  # type: ignore[attr-defined]
        except Exception:
            z = np.zeros(prepared.q.size)
        return SolverOutput(claim=Claim.FAILED, point=LCPPoint(z=z))


class RollsDice(_LCPSolver):
    """Another answer every time, with the trait `deterministic`."""

    rng = np.random.default_rng(0)

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.FAILED, point=LCPPoint(z=self.rng.random(prepared.q.size)))


class IgnoresItsStart(_LCPSolver):
    """Says that it takes a warm start, and does not look at it."""

    spec = dataclasses.replace(_LCPSolver.spec, traits=frozenset({Trait.WARM_START}))

    def solve(self, prepared, budget, options, start=None, record=None):
        zeros = LCPPoint(z=np.zeros(prepared.q.size))
        return SolverOutput(claim=Claim.MAX_ITER, point=zeros, counters={"iterations": 7})


class CountsItsStartOnly(_LCPSolver):
    """Says that a start saves it all its iterations, and does the same with and without."""

    spec = dataclasses.replace(_LCPSolver.spec, traits=frozenset({Trait.WARM_START}))

    def solve(self, prepared, budget, options, start=None, record=None):
        output = Lemke().run(prepared, budget)
        pivots = output.counters["pivots"]
        return dataclasses.replace(output, counters={"iterations": pivots if start is None else 0})


class CountsNothing(_LCPSolver):
    """Does not look at its start, and counts no iterations by which that could be seen."""

    spec = dataclasses.replace(_LCPSolver.spec, traits=frozenset({Trait.WARM_START}))

    def solve(self, prepared, budget, options, start=None, record=None):
        return dataclasses.replace(Lemke().run(prepared, budget), counters={})


class EditsTheProblem(_LCPSolver):
    """Shifts q of the problem it solves."""

    def solve(self, prepared, budget, options, start=None, record=None):
        object.__setattr__(prepared, "q", prepared.q + 1.0)
        return SolverOutput(claim=Claim.FAILED)


class _Watched(_LCPSolver):
    spec = dataclasses.replace(_LCPSolver.spec, traits=frozenset({Trait.HISTORY, Trait.DETERMINISTIC}))


class RecordsItsOwnUnits(_Watched):
    """Hands out iterates in the units it computes in."""

    def solve(self, prepared, budget, options, start=None, record=None):
        output = Lemke().run(prepared, budget)
        if record is not None and output.point is not None:
            record(0, 1.0, lambda: LCPPoint(z=np.zeros(prepared.q.size)))
            record(1, 0.0, lambda: LCPPoint(z=2.0 * output.point.z))
        return output


class RecordsNothing(_Watched):
    """Says that it hands out its iterates, and has none."""

    def solve(self, prepared, budget, options, start=None, record=None):
        return Lemke().run(prepared, budget)


class TriesHarderWhenWatched(_Watched):
    """Counts on being watched."""

    def solve(self, prepared, budget, options, start=None, record=None):
        if record is None:
            return SolverOutput(claim=Claim.MAX_ITER, point=LCPPoint(z=np.zeros(prepared.q.size)))
        return Lemke().run(prepared, budget)


class NeedsItsPackageToBeRead(_LCPSolver):
    """Its package is imported with its module, so that its spec cannot be read without it."""

    spec = dataclasses.replace(_LCPSolver.spec, requires=("colorsys",))

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.FAILED, message=colorsys.__name__)


class ExcusesWhatItCan(ClaimsZeros):
    """Excuses a case whose solution is 0, which it claims rightly."""

    spec = dataclasses.replace(_LCPSolver.spec, known_failures=MappingProxyType({"case-zero-q": "said to fail"}))


class AsksForLess(_LCPSolver):
    """Asks its package for ten times the tolerance."""

    def stopping(self, tolerance, problem=None):
        return Stopping(test="max|F|", settings={"abstol": 10.0 * tolerance}, defaults={"abstol": 1.0})

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.FAILED)


class IgnoresTheUnit(_LCPSolver):
    """Ends by an absolute residual, a thousandth from the solution, and declares no factor."""

    def stopping(self, tolerance, problem=None):
        return Stopping(test="max|min(z, w)|", settings={"abstol": tolerance}, defaults={"abstol": 1e-3})

    def solve(self, prepared, budget, options, start=None, record=None):
        z = 1.001 * Lemke().run(prepared, budget).point.z
        residual = np.abs(np.minimum(z, prepared.M @ z + prepared.q)).max(initial=0.0)
        claim = Claim.SOLVED if residual <= 0.1 * budget.tolerance else Claim.FAILED
        return SolverOutput(claim=claim, point=LCPPoint(z=z))


@dataclass(frozen=True)
class _NeedsAStep:
    step: float


class TakesNoDefaults(_LCPSolver):
    """An option without a default: nobody can run it without knowing it."""

    spec = dataclasses.replace(_LCPSolver.spec, options=_NeedsAStep)

    def solve(self, prepared, budget, options, start=None, record=None):
        return SolverOutput(claim=Claim.FAILED)


class SpoilsItsOwnAnswer(_LCPSolver):
    """Uses its start; one that is its own answer makes it move away and claim the same."""

    spec = dataclasses.replace(_LCPSolver.spec, traits=frozenset({Trait.WARM_START}))
    own: list[np.ndarray] = []

    def solve(self, prepared, budget, options, start=None, record=None):
        output = NewtonMin().run(prepared, budget, start=start)
        if start is None and output.point is not None:
            self.own.append(output.point.z)
        elif any(np.array_equal(start.z, z) for z in self.own):
            return dataclasses.replace(output, point=LCPPoint(z=1.5 * start.z))
        return output


class _TextLCP(Format):
    """M and q as JSON."""

    summary = "wrong"
    suffixes = (".broken",)
    writes = frozenset({"lcp"})

    def recognises(self, path, head):
        return False

    def encode(self, problem, *, compress):
        return json.dumps([matrices.dense(problem.M).tolist(), problem.q.tolist()]).encode()


class LosesAField(_TextLCP):
    """q comes back as zeros."""

    name = "broken-loses-a-field"

    def load(self, path, member):
        M, q = json.loads(path.read_bytes())
        return LCP(M=np.array(M).reshape(len(q), len(q)), q=np.zeros(len(q)))


class ForgetsWhoMadeIt(_TextLCP):
    """Promises to keep everything, and keeps the numbers."""

    name = "broken-forgets-who-made-it"
    keeps_provenance = True

    def load(self, path, member):
        M, q = json.loads(path.read_bytes())
        return LCP(M=np.array(M).reshape(len(q), len(q)), q=q)


class WritesNothing(_TextLCP):
    """Refuses every problem of the node that it says it writes."""

    name = "broken-writes-nothing"

    def encode(self, problem, *, compress):
        raise FormatError(self.name, "", "not today")

    def load(self, path, member):
        raise FormatError(path, "", "not today")


class ReadsHalfAFile(_TextLCP):
    """Reads a diagonal as far as it goes; what is missing is missed by nobody."""

    name = "broken-reads-half-a-file"

    def encode(self, problem, *, compress):
        return "".join(f"{value}\n" for value in problem.q).encode()

    def load(self, path, member):
        q = [float(line) for line in path.read_text().split("\n")[:-1]]
        return LCP(M=np.eye(len(q)), q=q)


@dataclass(frozen=True, eq=False, kw_only=True)
class LooksAtTheFirst(LCP):
    """Residuals of the first unknown only."""

    def measure(self, point, tolerance):
        w = self.M @ point.z + self.q
        return Residuals({"natural": float(np.abs(np.minimum(point.z, w))[:1].sum())})


@dataclass(frozen=True, eq=False, kw_only=True)
class CanBeWritten(LCP):
    """Data that anybody may change afterwards."""

    def check(self):
        object.__setattr__(self, "q", self.q.copy())


@dataclass(frozen=True, eq=False, kw_only=True)
class HashesTheStorage(LCP):
    """Another fingerprint for the same numbers when they are stored sparse."""

    @property
    def fingerprint(self):
        return f"{type(self.M).__name__} {matrices.digest(self.M).hex()} {matrices.digest(self.q).hex()}"


@dataclass(frozen=True, eq=False, kw_only=True)
class IgnoresNaN(LCP):
    """Residuals that skip what is not a number."""

    def measure(self, point, tolerance):
        z = np.nan_to_num(point.z, posinf=0.0)
        return Residuals({"natural": float(np.nansum(np.abs(np.minimum(z, self.M @ z + self.q))))})


@dataclass(frozen=True, eq=False, kw_only=True)
class AlwaysRight(LCP):
    """Residuals that are 0 whatever the answer."""

    def measure(self, point, tolerance):
        return Residuals({"natural": 0.0})
