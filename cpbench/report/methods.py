"""The last section of a report: what every number in it means."""

from __future__ import annotations

from collections.abc import Mapping

from cpbench.analysis.best import WITHIN
from cpbench.analysis.bootstrap import FEW, REPLICATES
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.sensitivity import CUSTOM
from cpbench.formulations.base import Kind
from cpbench.report.figures import EMPHASISED
from cpbench.report.text import seconds
from cpbench.verification import DIRECTION_DEGREES, INACCURATE_FACTOR, TARGET_UNRESOLVABLE

LOSSES = (
    "Here the solver met its target, and the answer that the conversion carried back does not meet the tolerance of "
    "the problem that was asked. *Factor*: the error there over the error on the solver's own problem."
)
"""Sentence above a table of conversions that lost answers."""
FLAGS = {
    "unresolvable": "rounding decides whether the answer meets the tolerance",
    TARGET_UNRESOLVABLE: "rounding decides whether the answer meets the tolerance on the solver's own problem",
    "direction": f"accepted, but some contact slips more than {DIRECTION_DEGREES:g}° off the direction that the law "
    "prescribes",
    "contact": "accepted, but a contact that carries load misses the law by more than a tenth of its own reaction or "
    "velocity",
    "scale": "the natural residual passes and the energy norm does not",
    "absolute": "a part of the problem has no constants, and was measured absolutely",
    "repeat": "a repeat of the timing failed after the first answer, which stands",
    "remembered": "the repeats were so much faster than the first solve that it alone counts",
    "twice": "the package of the solver claimed an answer, by a test and in units of its own, that misses the "
    "tolerance, and was asked once more, for a smaller tolerance",
    "children": "the solver left processes behind",
    "threads": "it used more threads than it was given",
    "wrote": "it wrote to the problem's data",
    "clock": "its answer came much later than its own clock says, and the time is the runner's, with all that passed "
    "until the answer was there",
    "history": "not run, but read off the iterates of a run at a tighter tolerance",
    "mixed": "merged from runs with other limits, machines or versions",
}
"""Meaning of the flags of a row."""
KINDS = {
    Kind.EQUIVALENT: "every answer there is an answer here, and the other way round",
    Kind.ONE_WAY: "every answer there is an answer here",
    Kind.NECESSARY: "promises less than an answer: a necessary condition",
    Kind.APPROXIMATE: "promises less than an answer: the law is approximated",
    Kind.RELAXATION: "promises less than an answer: a part of the law is dropped",
}
"""Promise of a route."""


def _listed(meanings: Mapping[str, str]) -> str:
    return "; ".join(f"*{name}*: {meaning}" for name, meaning in meanings.items())


METHODS = f"""\
**Problems and pairs.** A pair is a problem, a solver with its options, and a request for a route (`exact`, or a
conversion named after the `@`). Every pair is fixed before the run and has a row; N, the number of problems of a
formulation, is the number of different problems among its pairs and does not depend on any outcome. Rows are compared
within one formulation, tolerance, start and number of threads only.

**Unavailable.** A solver that is not installed, is broken or lacks a licence has its pairs all the same. One that
could run on no problem of a formulation is left out of that formulation's tables and figures, and is listed once with
its reason; N stays.

**Solved.** An answer is carried back through the conversions to the problem that was asked, and its error is computed
there from the problem's data by code and in a process that share nothing with the solver. The pair is *solved* when
the error is at most the tolerance, whatever the solver claims. *Stationary* is the same for a problem that is not
convex: the conditions of optimality hold, minimality is not shown. It is counted in a column of its own, and is in no
profile, rank or mean, unless the report was asked to count it as solved (`--count-stationary`), which its first lines
then say. A problem that is proved to have no solution is *infeasible*, and one whose objective is proved to have no
lower bound is *unbounded*: right outcomes, but no answers, so that they count as not solved for everybody alike. The
proof, a combination of the conditions (Farkas) or a feasible point and a ray, holds exactly, in rational arithmetic,
on the problem that was asked, and is kept. It has a margin of at least the tolerance: no problem whose numbers each
differ by that share of themselves has a solution up to ten times the size that its sides and bounds set. A claim
without such a proof is *failed*.

**Error.** The relative change of the terms of the problem's rows that would make the answer exact (Oettli and Prager
1964), held in norms over connected parts, as methods hold their conditions: a connected part of the problem's matrix
is equilibrated and has one size for its rows, the largest sum of the sizes of the terms of one, and an unknown is
measured by its largest effect on a row. In these units the error is the largest natural map of a pair
(complementarity problems and inequalities), the natural map of the friction law in energy (contact), or the largest
violation of a row, a bound or the gradient (programs: QP, cone QP, NLP). An idle side or price gives no size. The
duality gap of a part is compared with the terms of its objective, and the same error with sizes by the constants
alone must be within the root of the tolerance: unknowns that a problem leaves free hide nothing.
Units of rows and unknowns, idle rows and bounds, other problems beside, the order of rows and equal rows change
nothing; a program written as a complementarity problem has the error of that (its pairs, not its gap). A row of a
nonlinear map is measured by its own terms. NaN and missing numbers are ∞. A part of a problem without any constant has
no size, and is measured absolutely (flag). The measures of the literature are printed beside it, and `--measure` lets
one of them decide.

**Flags.** {_listed(FLAGS)}. After *children*, *threads* and *wrote* the process was replaced. The row of a solver that
was asked *twice* has the run that it reports, with the time of this run alone: the second where that answer is right,
else the first.

**Claim and verdict.** What a solver says of its answer (the claim) is recorded and never believed. Claimed and not
within the tolerance is *inaccurate* up to {INACCURATE_FACTOR:g} times the tolerance, *wrong* beyond; both are claims
that do not hold. A solver of a converted problem speaks of that one, so its answer is measured there too, at the
tolerance that it was asked for. Where it meets that, and the answer that was carried back does not meet the tolerance
of the problem asked, the solver is not charged: on an exact route the conversion *lost* it, on a route that promises
less it is *approximate*. Neither is solved, neither is wrong. Where rounding decides, it is *unresolvable*.

**Routes.** *Equivalent* and *one-way* conversions are exact: every answer of the converted problem is one of the
problem asked. *Necessary*, *approximate* (facets) and *relaxation* promise less; where a solver took such a route it
is marked, and its answers are judged on the exact law like all others.

**Start.** Cold: none is given. *file*: the first guess of the problem's file, *file:K* the K-th. *perturbed:σ*: the
file's solution, if it is one, with Gaussian noise of relative size σ in every block. *previous*: the solver's own
verified answer to the step before of a recorded sequence, with contacts matched by their persistent identities,
tangential parts turned into the new frames, and new contacts at 0; where that step was not solved the start is cold,
and the row says so. Sequences are recorded trajectories: each step is the same problem for all solvers, and no solver's
answer moves the bodies. A solver that takes no starting point is *unsupported* there.

**Histories.** The iterates of one more solve, kept at growing intervals of time and judged like answers on the
problem that was asked; the residual that a solver reports is recorded beside them and not used. The time to a
tolerance is that of the first kept iterate that meets it: an upper bound.

**Time.** Conversion + set-up + solve + carrying back, wall clock, in a warmed-up process; the median of the repeats
of a short solve. Reading the file and judging are not in it. A pair that is not solved has no time: it is ∞, however
quickly it came to its end. Where another process solves (*served*), the solve is that of its method: by the clock of
the process where cpbench reads that clock and it is plausible, else what passed here less the round trip of an empty
request, the median at the start of the session (columns `solve`, `solve_wall`, `trip`).

**Performance profile** (Dolan and Moré, Math. Programming 91, 2002). ρ(τ) is the number of problems solved within τ
times the least time any solver of the figure needed for that problem, over N; a problem of which a
conversion lost its answer is not among the N of that solver. The steps are exact, equal times share the lead, times
below {seconds(FLOOR)} count as {seconds(FLOOR)} (the article has no such floor), failures are at ∞, and problems that
no solver solved stay among the N. Only distance to the best curve is meant: the order of two other solvers
may change when a third is left out (Gould and Scott, ACM TOMS 43, 2016).

**Mean time.** The shifted geometric mean exp(mean log(t + s)) − s over all N problems (as above without lost answers);
a problem that the solver did
not solve is *charged* the penalty, the time limit (or the slowest answer, where conversion or set-up took one beyond
it), also where no route led to the solver. The shift s is the median of all times of the formulation and is printed; a
shift far above the times makes this an arithmetic mean that a single failure decides. The *rank* by the mean is
repeated at a tenth of the shift, ten times the shift and {seconds(CUSTOM)} (customary elsewhere) and, where that
matters, with 2 and 10 times the limit as penalty (PAR2, PAR10): where ranks move, the choice decides. The mean over
*commonly solved* problems charges nothing, but leaves the hard ones out; it is taken over those that all of the
{EMPHASISED} solvers with the largest area under the profile solve, and their number stands above it.

**Interval.** 95 % bootstrap, {REPLICATES} replicates: *families* of problems are drawn with replacement, since the
problems of one family (the time steps of one scene) resemble each other and would make it too narrow one by one; a
problem without a family is one by itself. Read at the percentiles widened as Student's t asks with so many families
(Hesterberg, The American Statistician 69, 2015); with fewer than {FEW} families none is shown. Solvers are compared by
the same problems, so that intervals that overlap do not say that two are alike.

**Virtual best.** The least time of any solver on each problem. *Gap*: the geometric mean of a solver's ratio to it,
over the problems that it solved and over those commonly solved; *within {WITHIN:g} times* is a fraction of all N. *Best
without it*: by what factor the virtual best is slower where that solver is left out (geometric mean over the problems
that others solve too); 1 says that it is never missed.

**Median and slowdown** are taken over the problems that the solver itself solved, whose number stands beside them:
*slowdown* is the median of its time over the least time of any solver (the virtual best). They tell nothing about
problems it did not solve. *Below {seconds(FLOOR)}*: how many of its times are too short for a ratio to tell anything.

**Claims that hold** have Wilson's 95 % interval (JASA 22, 1927), which takes the pairs for independent.
"""
