"""What was found out about a failure, and its text for a reader."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from cpbench.foundation.text import counted
from cpbench.solvers.base import Claim
from cpbench.verification import Status
from cpbench_lab.diagnosis.attempts import TrialOutcome
from cpbench_lab.diagnosis.case import Cause, Remedy

SLOWER = 10.0
"""How many times the time of the automatic choice is slow. One solve each is timed, which alone may differ by a factor
of five between two solves of the same pair."""
NOTICEABLE = 0.1
"""Time below which a solve is never slow [s]: a reader does not notice it, and starting up may be most of it."""


@dataclass(frozen=True)
class Complaint:
    """A complaint. `kind` : `error`, `claim` or `time`. `text` : what it is, with its numbers. `seconds` : the longest
    time of a solve of which one would not complain [s]."""

    kind: str
    text: str = ""
    seconds: float = math.inf

    def met(self, outcome: TrialOutcome, solved: bool) -> bool:
        """Return whether an outcome leaves no complaint; `solved` : whether its answer meets the tolerance."""
        if self.kind == "error":
            return solved
        return solved and outcome.raw.claim == Claim.SOLVED and outcome.raw.seconds < self.seconds


def complaint_of(outcome: TrialOutcome, fastest: float) -> Complaint | None:
    """Return what may be the complaint about an outcome; None where there is nothing to complain of.

    `fastest` : seconds in which the automatic choice solves the same problem, infinite where that is not known.
    """
    if not outcome.solved:
        return Complaint("error")
    claim, spent, limit = outcome.raw.claim, outcome.raw.seconds, outcome.trial.seconds
    if claim != Claim.SOLVED:
        done = outcome.raw.counters.get("iterations")
        after = f" after {counted(done, 'iteration')}" if done else ""
        return Complaint("claim", f"it claims {claim}{after}, in {spent:.2g} s")
    if spent > limit:
        return Complaint("time", f"it took {spent:.2g} s, its limit was {limit:g} s", limit)
    if spent >= max(NOTICEABLE, SLOWER * fastest):
        text = f"it took {spent:.2g} s, the automatic choice {fastest:.2g} s: {spent / fastest:.0f} times as long"
        return Complaint("time", text, max(NOTICEABLE, SLOWER * fastest))
    return None


@dataclass(frozen=True, eq=False)
class Tried:
    """A remedy, or a check, with its outcome. `error` : on the problem that was asked. `works` : whether it meets the
    tolerance and leaves nothing to complain of."""

    remedy: Remedy
    attempt: TrialOutcome
    error: float
    works: bool

    @property
    def answer(self) -> Any:
        """Its answer to the problem that was asked; None without one."""
        answer = self.attempt.answer
        return answer if answer is None or self.remedy.back is None else self.remedy.back(answer)

    @property
    def ended(self) -> str:
        """How it ended: `works`, else its status, with what is left to complain of a right answer."""
        if self.works:
            return "works"
        claim, seconds = self.attempt.raw.claim, self.attempt.raw.seconds
        left = f" in {seconds:.2g} s" if claim == Claim.SOLVED else f", it claims {claim}"
        return f"{self.attempt.status}{left if self.attempt.solved else ''}"

    def __str__(self) -> str:
        outcome = f"error {self.error:.1e}" if self.attempt.answer is not None else self.attempt.message
        return f"{self.remedy.text}: {self.ended}, {outcome}"


@dataclass(frozen=True, eq=False)
class Suspect:
    """A property that may be the cause and is not confirmed. `check` : the same solver on the nearest problem without
    it, on which it fails as well; None where no such problem could be tried."""

    cause: Cause
    check: Tried | None

    def __str__(self) -> str:
        return f"{self.cause.kind}: {self.cause.evidence}"

    @property
    def reason(self) -> str:
        """Why it is not confirmed."""
        if self.check is not None:
            return f"the same solver fails as well with {self.cause.change} ({self.check.ended})"
        return "no problem without it could be tried"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Reasons for which a trial fails, or leaves something to complain of, and what was tried.

    Attributes
    ----------
    failed : what became of it. complaint : what is wrong with it, None where nothing is.
    cause : the first one that is proved, or without which the same solver succeeds; None where there is none.
    suspected : properties that were looked at before it and are not confirmed.
    tried : remedies and their outcomes. fastest : seconds of the automatic choice [s], infinite where not asked.
    certificate : how a proof is looked for. unfinished : what was not done when the time was over, '' otherwise.
    """

    failed: TrialOutcome
    complaint: Complaint | None = None
    cause: Cause | None = None
    suspected: tuple[Suspect, ...] = ()
    tried: tuple[Tried, ...] = ()
    certificate: str = ""
    unfinished: str = ""

    @property
    def fails(self) -> bool:
        """Whether the answer does not meet the tolerance."""
        return not self.failed.solved

    @property
    def remedy(self) -> Tried | None:
        """The first remedy that works."""
        return next((one for one in self.tried if one.works), None)

    def lines(self) -> Iterator[str]:
        """Yield what was found, for a reader; the first line is the answer to what was asked."""
        trial, failed = self.failed.trial, self.failed
        name = f"{trial.problem.name or trial.problem.node} by {trial.solver}"
        yield f"{name}: {failed.status}; {self._answer()}"
        if failed.answer is not None:
            yield f"  error      {failed.error:.2e}, asked for {trial.tolerance:.1e}"
        if failed.message and self.complaint is not None:
            yield f"  message    {' '.join(failed.message.split())}"
        if self.complaint is not None and self.complaint.text:
            yield f"  complaint  {self.complaint.text}"
        yield from self._causes()
        for one in self.tried:
            yield f"  tried      {one}"
        if self.certificate:
            yield f"  certify    {self.certificate}"
        if self.unfinished:
            yield f"  unfinished {self.unfinished}"

    def _answer(self) -> str:
        """Return the answer in a sentence: why, and what works."""
        if self.complaint is None:
            if self.unfinished:
                return "its answer is right"
            return f"nothing to explain: its answer is right, and it says so, in {self.failed.raw.seconds:.2g} s"
        right = "" if self.fails else f"its answer is right, the complaint may be its {self.complaint.kind}; "
        if self.cause is not None:
            why = f"the cause is: {self.cause.kind}"
        elif self.suspected:
            kinds = ", ".join(dict.fromkeys(one.cause.kind for one in self.suspected))
            why = f"no cause was confirmed, suspected: {kinds}"
        else:
            message = " ".join(self.failed.message.split())
            why = f"it raised {message}" if self.failed.status == Status.ERROR else "no cause was found"
        works = [one.remedy.text for one in self.tried if one.works]
        return right + why + (f"; what works: {works[0]}" if works else "")

    def _causes(self) -> Iterator[str]:
        for one in self.suspected:
            yield f"  suspected, not confirmed: {one}"
            yield f"             {one.reason}"
        if self.cause is not None:
            yield f"  cause      {self.cause.kind}: {self.cause.evidence}"
            if not self.cause.proved:
                yield f"  check      the same solver succeeds with {self.cause.change}"
        elif self.suspected:
            yield f"  cause      none was confirmed, {counted(len(self.suspected), 'property', 'properties')} suspected"
        elif self.complaint is not None:
            yield "  cause      none was found in the problem"
