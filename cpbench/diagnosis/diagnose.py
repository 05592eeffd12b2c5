"""Why a solver fails on a problem: causes are looked for in order, and what they claim is tried."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from cpbench import verification
from cpbench.diagnosis.attempts import SolverTrial, TrialOutcome, attempt
from cpbench.diagnosis.case import Cause, FailedTrial, Remedy
from cpbench.diagnosis.causes import DETECTORS
from cpbench.diagnosis.remedies import others

TRIES = 4
"""Remedies that are tried at most."""


@dataclass(frozen=True, eq=False)
class Tried:
    """A remedy with its outcome. `error` : on the problem that was asked. `works` : whether it meets the tolerance of
    the remedy."""

    remedy: Remedy
    attempt: TrialOutcome
    error: float
    works: bool

    def __str__(self) -> str:
        outcome = f"error {self.error:.1e}" if self.attempt.answer is not None else self.attempt.message
        return f"{self.remedy.text}: {'works' if self.works else self.attempt.status}, {outcome}"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Reasons for which a trial fails, and what was tried.

    Attributes
    ----------
    failed : what became of it. cause : the first cause, None where none was found, or where it does not fail.
    confirmed : the evidence is a proof, or the same solver solves the nearest problem without the cause; None where
    there is no such problem to try. tried : remedies, the last of them the one that works, where one does.
    also : other causes that were found.
    """

    failed: TrialOutcome
    cause: Cause | None
    confirmed: bool | None = None
    tried: tuple[Tried, ...] = ()
    also: tuple[Cause, ...] = ()

    @property
    def fails(self) -> bool:
        """Whether there is anything to explain."""
        return not self.failed.solved

    @property
    def remedy(self) -> Tried | None:
        """The remedy that works."""
        return next((one for one in self.tried if one.works), None)

    def lines(self) -> Iterator[str]:
        """Yield what was found, for a reader."""
        trial = self.failed.trial
        yield f"{trial.problem.name or trial.problem.node} by {trial.solver}: {self.failed.status}"
        if not self.fails:
            yield f"  nothing to explain: error {self.failed.error:.1e}, asked for {trial.tolerance:.1e}"
            return
        if self.failed.answer is not None:
            yield f"  error      {self.failed.error:.2e}, asked for {trial.tolerance:.1e}"
        if self.failed.message:
            yield f"  message    {' '.join(self.failed.message.split())}"
        if self.cause is None:
            yield "  cause      none was found"
        else:
            yield f"  cause      {self.cause.kind}: {self.cause.evidence}"
            if not self.cause.proved and self.cause.change and self.confirmed is not None:
                word = "solves" if self.confirmed else "fails as well on"
                yield f"  check      the same solver {word} it with {self.cause.change}"
        for cause in self.also:
            yield f"  also       {cause.kind}: {cause.evidence}"
        for one in self.tried:
            yield f"  tried      {one}"


def diagnose(trial: SolverTrial, attempt: Callable[[SolverTrial], TrialOutcome] = attempt) -> Diagnosis:
    """Solve, and where that fails look for the first cause and for a remedy that works.

    A cause that is proved comes first; then one without which the same solver succeeds, then one that could not be
    tested so, and last one without which it fails as well; each in the order of `causes.DETECTORS`.
    """
    failed = attempt(trial)
    if failed.solved:
        return Diagnosis(failed, None)
    case = FailedTrial(trial, failed, attempt)
    found: list[tuple[Cause, bool | None, Tried | None]] = []
    for detect in DETECTORS:
        cause = detect(case)
        if cause is None:
            continue
        again = _without(case, cause)
        confirmed = True if cause.proved else None if again is None else again.works
        found.append((cause, confirmed, again))
        if confirmed:
            break
    found.sort(key=lambda one: (True, None, False).index(one[1]))
    if not found:
        return Diagnosis(failed, None, tried=tuple(_tried(case, None, None)))
    cause, confirmed, again = found[0]
    return Diagnosis(
        failed,
        cause,
        confirmed,
        tuple(_tried(case, cause, again)),
        tuple(other for other, _, _ in found[1:]),
    )


def _without(case: FailedTrial, cause: Cause) -> Tried | None:
    """Try the problem without the cause; None where that is not known, or not needed."""
    if cause.proved or cause.without is None:
        return None
    remedy = next((one for one in cause.remedies if one.trial is cause.without), None)
    remedy = remedy or Remedy(text=cause.change, trial=cause.without)
    return _measured(case, remedy, case.attempt(remedy.trial))


def _tried(case: FailedTrial, cause: Cause | None, again: Tried | None) -> Iterator[Tried]:
    """Try remedies until one works; none where a proof says that there is no solution."""
    if cause is not None and cause.proved and cause.kind in verification.PROVEN:
        return
    own = cause.remedies if cause is not None else ()
    for k, remedy in enumerate([*own, *others(case)]):
        if k >= TRIES:
            return
        ready = again if again is not None and again.remedy is remedy else None
        outcome = ready or _measured(case, remedy, case.attempt(remedy.trial))
        yield outcome
        if outcome.works:
            return


def _measured(case: FailedTrial, remedy: Remedy, found: TrialOutcome) -> Tried:
    """Measure the answer of a remedy on the problem that was asked."""
    if remedy.back is None or found.answer is None:
        return Tried(remedy, found, found.error, found.solved)
    verdict = verification.judge(case.problem, remedy.back(found.answer), case.trial.tolerance)
    return Tried(remedy, found, verdict.error, verdict.solved)
