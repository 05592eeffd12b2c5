"""Text for a reader: the measurements of an answer."""

from __future__ import annotations

from collections.abc import Iterator

from cpbench.formulations.base import Problem
from cpbench.formulations.nlp import NLP, Convexity
from cpbench.proofs import prove
from cpbench.proofs.polyhedra import objective
from cpbench.verification import Status, Verdict

DECLARED = "that the problem is convex is its author's word, which cannot be checked here"


def outcome(problem: Problem, verdict: Verdict) -> str:
    """Return in words whether an answer passes; of a stationary point, what is known and what is not."""
    at = f"at {verdict.tolerance:.3g}"
    if verdict.solved:
        return f"passes {at}"
    if not verdict.within:
        return f"does not pass {at}"
    unknown = isinstance(problem, NLP) and problem.convexity is Convexity.UNKNOWN
    convex = "the problem is not known to be convex" if unknown else "the problem is not convex"
    return f"optimality conditions hold {at}; {convex}, minimality is not shown"


def lines(verdict: Verdict) -> Iterator[str]:
    """Yield the number that decides, and those that do not, with what they are."""
    for name, value in verdict.judged.items():
        yield f"  judged  {name:<28} {value:.3g}"
    if verdict.parts:
        yield "  not judged: residuals by which solvers of cpbench stop, and their parts (--all-measures names sources)"
    for name, value in verdict.parts.items():
        yield f"          {name:<28} {value:.3g}"


def remarks(verdict: Verdict) -> Iterator[str]:
    """Yield the flags, and what the verdict rests on where nothing measures it."""
    if verdict.flags:
        yield f"  flags   {', '.join(verdict.flags)}"
    if "convexity declared" in verdict.flags:
        yield f"          convexity declared: {DECLARED}"


def unbounded(problem: Problem, seconds: float = 5.0) -> Iterator[str]:
    """Yield that the objective has no lower bound, where that is proved; problems with linear constraints only."""
    if objective(problem) is None:
        return
    attempt = prove(problem, str(Status.UNBOUNDED), seconds=seconds)
    if attempt.proof is not None:
        yield f"  unbounded: the objective has no lower bound, {attempt.message}"
