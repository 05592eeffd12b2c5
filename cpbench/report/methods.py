"""The last section of a report: what every number in it means."""

from __future__ import annotations

from pathlib import Path

from cpbench.analysis.best import WITHIN
from cpbench.analysis.bootstrap import FEW, REPLICATES
from cpbench.analysis.profiles import FLOOR
from cpbench.formulations.base import Kind
from cpbench.report.figures import EMPHASISED
from cpbench.report.text import seconds
from cpbench.verification import DIRECTION_DEGREES, INACCURATE_FACTOR, TARGET_UNRESOLVABLE

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
    "twice": "the package of the solver claimed an answer, by a test and in its own units, that misses the "
    "tolerance, and was asked once more, for a smaller tolerance",
    "children": "the solver left processes behind",
    "threads": "it used more threads than it was given",
    "wrote": "it wrote to the problem's data",
    "clock": "its answer came much later than its own clock says, and the time is the runner's, with all that passed "
    "until the answer was there",
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


METHODS = (
    (Path(__file__).parent / "methods.md")
    .read_text(encoding="utf-8")
    .format(
        flags="; ".join(f"*{name}*: {meaning}" for name, meaning in FLAGS.items()),
        inaccurate=INACCURATE_FACTOR,
        floor=seconds(FLOOR),
        emphasised=EMPHASISED,
        replicates=REPLICATES,
        few=FEW,
        within=WITHIN,
    )
)
