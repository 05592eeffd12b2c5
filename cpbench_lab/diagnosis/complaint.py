"""What there is to complain of in the end of a trial: its error, what the solver claims of a right answer, its time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from cpbench.foundation.text import counted
from cpbench.solvers.base import Claim
from cpbench_lab.diagnosis.attempts import TrialOutcome

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
