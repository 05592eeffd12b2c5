"""Why a solver fails on a problem: causes are looked for in order, and what they claim is tried."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from cpbench import graph, verification
from cpbench.formulations.base import Problem
from cpbench.solvers.base import Claim, Solver, automatic_solver, missing, solvers
from cpbench.verification import Status
from cpbench_lab.diagnosis.attempts import Deadline, OutOfTime, SolverTrial, TrialOutcome, attempt
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy
from cpbench_lab.diagnosis.causes import DETECTORS
from cpbench_lab.diagnosis.diagnosis import NOTICEABLE, Complaint, Diagnosis, Suspect, Tried, complaint_of


def diagnose(
    trial: SolverTrial,
    attempt: Callable[[SolverTrial], TrialOutcome] = attempt,
    *,
    say: Callable[[str], None] | None = None,
    deadline: Deadline | None = None,
    foreign: bool = False,
) -> Diagnosis:
    """Solve; where that fails look for the first confirmed cause, and for remedies that work.

    Parameters
    ----------
    attempt : solves. say : takes a line on what is being tried. deadline : end of it all; none by default.
    foreign : whether solvers by others are remedies, too; they may hang or die, which only `apart` survives.

    A cause is one that is proved, or without which the same solver succeeds; the first in the order of
    `causes.DETECTORS` ends the search. Those before it are suspected only. At the deadline what was found so far is
    returned.
    """
    inquiry = _Inquiry(trial, attempt, say or (lambda line: None), deadline or Deadline(), foreign)
    return inquiry.diagnosis()


@dataclass
class _Inquiry:
    """State of a diagnosis, which may end at any time."""

    trial: SolverTrial
    attempt: Callable[[SolverTrial], TrialOutcome]
    say: Callable[[str], None]
    deadline: Deadline
    foreign: bool
    complaint: Complaint = field(init=False)
    case: FailedTrial = field(init=False)
    suspected: list[Suspect] = field(default_factory=list)
    cause: Cause | None = None
    confirming: Tried | None = None
    tried: list[Tried] = field(default_factory=list)

    def diagnosis(self) -> Diagnosis:
        """Do all of it, or what the time allows."""
        trial = self.trial
        self.say(f"{trial.solver} on {trial.problem.name or trial.problem.node}, at most {trial.seconds:g} s")
        try:
            failed = self._solve(trial)
        except OutOfTime:
            late = TrialOutcome(
                trial=trial, status=Status.TIMEOUT, message="the time of the explanation was over before"
            )
            return Diagnosis(late, Complaint("error"), unfinished="nothing was looked at")
        try:
            complaint = complaint_of(failed, self._fastest(failed))
        except OutOfTime:
            return Diagnosis(failed, unfinished="its time was not compared with that of the automatic choice")
        if complaint is None:
            return Diagnosis(failed)
        self.complaint = complaint
        self.case = FailedTrial(trial, failed, self._solve)
        unfinished = self._look()
        try:
            self._remedies()
        except OutOfTime:
            unfinished = "; ".join(filter(None, [unfinished, "not all remedies were tried"]))
        return Diagnosis(
            failed, self.complaint, self.cause, tuple(self.suspected), tuple(self.tried), unfinished=unfinished
        )

    def _solve(self, trial: SolverTrial) -> TrialOutcome:
        """Solve in the time that is left; raises OutOfTime where that decides the outcome."""
        left = self.deadline.left
        if not left:
            raise OutOfTime
        result = self.deadline.run(lambda: self.attempt(replace(trial, seconds=min(trial.seconds, left))))
        if (result.status == Status.TIMEOUT and left < trial.seconds) or not self.deadline.left:
            raise OutOfTime
        return result

    def _fastest(self, failed: TrialOutcome) -> float:
        """Return the seconds of the automatic choice, where a right answer took so long that they matter."""
        own = choice(self.trial.problem)
        right = failed.solved and failed.raw.claim == Claim.SOLVED
        if not right or failed.raw.seconds < NOTICEABLE or own is None or own == failed.trial.named[0].spec.name:
            return math.inf
        self.say(f"{own}, to compare its time")
        found = self._solve(replace(self.trial, solver=own, via=()))
        return found.raw.seconds if found.solved else math.inf

    def _look(self) -> str:
        """Look for causes until one is confirmed; returns what was not looked at when the time was over."""
        for k, detect in enumerate(DETECTORS):
            name = detect.__name__.replace("_", " ")
            self.say(f"looking for a cause: {name}")
            try:
                cause = self.deadline.run(lambda detect=detect: detect(self.case))
            except OutOfTime:
                left = ", ".join(one.__name__.replace("_", " ") for one in DETECTORS[k:])
                return f"causes that were not looked for: {left}"
            if cause is None:
                continue
            if cause.proved:
                self.cause = cause
                return ""
            try:
                check = self._without(cause)
            except OutOfTime:
                self.suspected.append(Suspect(cause, None))
                left = ", ".join(one.__name__.replace("_", " ") for one in DETECTORS[k + 1 :])
                return f"{cause.kind} was not checked to the end; causes that were not looked for: {left}"
            if check is not None and check.works:
                self.cause, self.confirming = cause, check
                return ""
            self.suspected.append(Suspect(cause, check))
        return ""

    def _without(self, cause: Cause) -> Tried | None:
        """Try the problem without the cause; None where there is none to try."""
        if cause.without is None:
            return None
        self.say(f"checking {cause.kind}: the same solver with {cause.change}, at most {cause.without.seconds:g} s")
        remedy = next((one for one in cause.remedies if one.trial is cause.without), None)
        return self._measured(remedy or Remedy(text=cause.change, trial=cause.without))

    def _remedies(self) -> None:
        """Try the remedies of the cause, and of those suspected, until one works; then each family of other solvers.

        None are tried where a proof says that there is no solution.
        """
        if self.cause is not None and self.cause.proved and self.cause.kind in verification.PROVEN:
            return
        named = [self.cause] if self.cause is not None else [one.cause for one in self.suspected]
        known = [self.confirming, *(one.check for one in self.suspected)]
        for remedies in ([one for cause in named for one in cause.remedies], *families(self.case, self.foreign)):
            tries = 0
            for remedy in remedies:
                ready = next((one for one in known if one is not None and one.remedy is remedy), None)
                if ready is None:
                    self.say(f"trying {remedy.text}, at most {remedy.trial.seconds:g} s")
                    ready = self._measured(remedy)
                elif not ready.works:
                    continue  # it was the check of a cause that is suspected
                if ready.attempt.status in (Status.UNSUPPORTED, Status.UNAVAILABLE):
                    continue
                self.tried.append(ready)
                tries += 1
                if ready.works or tries == TRIES:
                    break

    def _measured(self, remedy: Remedy) -> Tried:
        """Run a remedy, and measure its answer on the problem that was asked."""
        found = self._solve(remedy.trial)
        if remedy.back is None or found.answer is None:
            return Tried(remedy, found, found.error, self.complaint.met(found, found.solved))
        verdict = verification.judge(self.trial.problem, remedy.back(found.answer), self.trial.tolerance)
        return Tried(remedy, found, verdict.error, self.complaint.met(found, verdict.solved))


# -------------------------------------------------------------------------------------------------------- other solvers

TRIES = 3
"""Remedies of a family that are tried at most."""


def choice(problem: Problem) -> str | None:
    """Return the automatic choice for a problem's formulation; None where there is none."""
    return automatic_solver(problem.node)


def families(case: FailedTrial, foreign: bool) -> Iterator[Iterator[Remedy]]:
    """Yield families of solvers, by exact conversions, each to be tried until one of it works.

    They are the automatic choice of the problem's formulation; one solver of each other method of this formulation and
    of the failed solver's; and one of each method that is still missing, of formulations that an exact route leads to,
    the nearest first. Where all are asked (`foreign`) those installed are taken, else those of cpbench alone.
    """
    failed, own = case.solver.spec, choice(case.problem)
    if own is not None and own != failed.name:
        yield iter([_remedy(case, solvers.get(own))])
    near = tuple(dict.fromkeys((case.problem.node, failed.node)))
    methods = {failed.method, "automatic choice"}
    yield _of_nodes(case, near, methods, foreign)
    yield _of_nodes(case, _other_nodes(case, near), methods, foreign)


def _of_nodes(case: FailedTrial, nodes: tuple[str, ...], methods: set[str], foreign: bool) -> Iterator[Remedy]:
    """Yield one solver of each method that is not in `methods` yet, which grows."""
    for node in nodes:
        for solver in solvers:
            spec = solver.spec
            fits = spec.node == node and spec.kind.exact and spec.by_default and spec.method not in methods
            if fits and (solver.origin == "native" or (foreign and not missing(spec))):
                methods.add(spec.method)
                yield _remedy(case, solver)


def _other_nodes(case: FailedTrial, near: tuple[str, ...]) -> tuple[str, ...]:
    """Return the other formulations that an exact route leads to, those at the cheapest routes first."""
    source = case.problem.node
    others = [node for node in graph.reachable(source) if node not in near]
    routes = {node: graph.candidates(source, node) for node in others}
    return tuple(sorted((node for node in others if routes[node]), key=lambda node: routes[node][0].cost))


def _remedy(case: FailedTrial, solver: Solver) -> Remedy:
    trial = replace(case.trial, solver=solver.spec.name, via=())
    there = "" if solver.spec.node == case.problem.node else f", of {solver.spec.node}"
    return Remedy(text=f"{solver.spec.name} ({solver.spec.method}{there})", trial=trial)
