"""Status of a planned pair, made of what was measured and what was claimed, here and nowhere else.

The verdict is measured on the problem that was asked. Where a conversion led to the solver's own problem, its answer is
measured there too, at the tolerance that it was asked for: what is missed there is the solver's, the rest the route's.
The claim is what the solver said.
"""

from __future__ import annotations

from enum import StrEnum

from cpbench.formulations.base import Kind
from cpbench.verification.verdict import Verdict

INACCURATE_FACTOR = 100.0
"""A claimed answer within this factor of the tolerance is `inaccurate`, beyond it `wrong`."""

TARGET_UNRESOLVABLE = "target unresolvable"
"""Flag of a row: rounding decides whether the answer meets the tolerance on the solver's own problem."""


class Status(StrEnum):
    """Outcome of a planned pair. Every planned pair has one."""

    SOLVED = "solved"
    STATIONARY = "stationary"
    """Optimality conditions hold, but the problem is not convex."""
    APPROXIMATE = "approximate"
    """The solver solved the approximation that the route promises; the answer is not within the tolerance on the
    problem that was asked."""
    LOST = "lost"
    """The solver met its target; the conversion lost the accuracy."""
    INACCURATE = "inaccurate"
    """Not solved, claimed and close."""
    WRONG = "wrong"
    """Claimed, and is not: the solver missed its own target."""
    UNRESOLVABLE = "unresolvable"
    """Rounding decides whether the answer meets the tolerance."""
    INFEASIBLE = "infeasible"
    """No solution exists: proved on the problem that was asked, and of all problems within the tolerance of it
    (`margins`)."""
    UNBOUNDED = "unbounded"
    """The objective has no lower bound: a feasible point and a ray prove it, with a margin."""
    FAILED = "failed"
    """The solver gave up and said so, or claims what nothing proves: also where the rounding of the data decides."""
    MAX_ITER = "max_iter"
    TIMEOUT = "timeout"
    MEMOUT = "memout"
    CRASH = "crash"
    ERROR = "error"
    UNSUPPORTED = "unsupported"
    UNAVAILABLE = "unavailable"
    NOT_RUN = "not_run"


VERIFIED = (str(Status.SOLVED),)
"""Statuses of an answer that counts as solved."""
REFUSED = (str(Status.UNSUPPORTED), str(Status.UNAVAILABLE), str(Status.NOT_RUN))
"""Statuses of pairs in which the solver never started."""
MET_TOLERANCE = (*VERIFIED, str(Status.STATIONARY))
"""Statuses of an answer that meets the tolerance on the problem that was asked: enough to go on from it."""
PROVEN = (str(Status.INFEASIBLE), str(Status.UNBOUNDED))
"""Statuses of a problem that was proved to have no solution."""
FALSE_CLAIMS = (str(Status.INACCURATE), str(Status.WRONG))
"""Statuses of an answer that was claimed and missed the solver's own target."""
CONTRADICTION = "contradiction"
"""What `--fail-on` calls rows that contradict each other: no status of a row."""
CHARGED_TO_ROUTE = (str(Status.LOST), str(Status.APPROXIMATE))
"""Statuses of an answer that solves what the solver was given, and not what was asked."""


def status(
    verdict: Verdict,
    claim: str,
    *,
    kind: Kind = Kind.EQUIVALENT,
    target: Verdict | None = None,
    proven_infeasible: bool = False,
    proven_unbounded: bool = False,
) -> Status:
    """Return status of a finished solve: the first rule that holds.

    Parameters
    ----------
    verdict : on the problem that was asked. claim : a `solvers.Claim` value.
    kind : the weakest promise of the route and the solver. target : the verdict on the solver's own problem, at the
        tolerance that it was asked for; None where it is not known.
    """
    met = target is not None and target.within
    missed = [v for v in (verdict, target) if v is not None and not v.within]
    close = any(v.error <= INACCURATE_FACTOR * v.tolerance for v in missed)
    rules = (
        (verdict.within and not verdict.solved and proven_unbounded, Status.UNBOUNDED),
        (verdict.solved, Status.SOLVED),
        (verdict.within, Status.STATIONARY),
        (proven_infeasible, Status.INFEASIBLE),
        (proven_unbounded, Status.UNBOUNDED),
        (any("unresolvable" in v.flags for v in missed), Status.UNRESOLVABLE),
        (met and kind.exact, Status.LOST),
        (met, Status.APPROXIMATE),
        (claim == "solved" and target is None and not kind.exact, Status.APPROXIMATE),
        (claim in ("solved", "inaccurate") and close, Status.INACCURATE),
        (claim == "solved", Status.WRONG),
        (claim == "max_iter", Status.MAX_ITER),
    )
    return next((outcome for holds, outcome in rules if holds), Status.FAILED)
