"""Causes of failures, a detector in each file: a function of a case that returns the cause, or None.

The order is that in which they are looked for: what the problem or the question excludes, what the solver was not
allowed, what the problem lacks, what the iterates show, and last what a solver merely says. Pairs that are both zero
come before a way back that loses digits and before a singular block: without them both are the same, so that a solver
that then succeeds copes with these. The overall magnitude comes after units that lie apart, which have one too, and
masses before hyperstatic contacts: with even masses these stay, while what makes them determined evens masses.
"""

from collections.abc import Callable

from cpbench_lab.diagnosis.case import Cause, FailedTrial
from cpbench_lab.diagnosis.causes.cone import wrong_cone
from cpbench_lab.diagnosis.causes.cycling import cycling
from cpbench_lab.diagnosis.causes.degenerate import degenerate
from cpbench_lab.diagnosis.causes.diverging import diverging
from cpbench_lab.diagnosis.causes.hyperstatic import hyperstatic
from cpbench_lab.diagnosis.causes.infeasible import infeasible
from cpbench_lab.diagnosis.causes.interior import no_interior
from cpbench_lab.diagnosis.causes.iterations import iterations
from cpbench_lab.diagnosis.causes.lost import lost
from cpbench_lab.diagnosis.causes.magnitude import magnitude
from cpbench_lab.diagnosis.causes.masses import masses
from cpbench_lab.diagnosis.causes.nonmonotone import nonmonotone
from cpbench_lab.diagnosis.causes.refused import refused
from cpbench_lab.diagnosis.causes.rounding import rounding
from cpbench_lab.diagnosis.causes.scale import scale
from cpbench_lab.diagnosis.causes.singular import singular
from cpbench_lab.diagnosis.causes.start import start
from cpbench_lab.diagnosis.causes.time import time_limit
from cpbench_lab.diagnosis.causes.unbounded import unbounded

DETECTORS: tuple[Callable[[FailedTrial], Cause | None], ...] = (
    infeasible,
    unbounded,
    rounding,
    wrong_cone,
    degenerate,
    lost,
    iterations,
    time_limit,
    start,
    scale,
    magnitude,
    masses,
    hyperstatic,
    nonmonotone,
    singular,
    no_interior,
    cycling,
    diverging,
    refused,
)

__all__ = ["DETECTORS"]
