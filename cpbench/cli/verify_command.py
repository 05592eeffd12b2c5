"""Measure an answer on a problem, or judge the stored answers of a results file again."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from cpbench import storage, verification
from cpbench.api.problems import load, verify
from cpbench.api.results import is_results_file
from cpbench.bench import multipliers
from cpbench.bench.judging import optimality_gap, with_others
from cpbench.bench.results.rejudge import rejudge_file
from cpbench.cli.answered import answer_lines
from cpbench.cli.options import format_option, measure_option, number, tolerance_option
from cpbench.cli.terminal import print_lines, table
from cpbench.cli.types import ADDRESS, PATH
from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.programs import NLP, Convexity
from cpbench.foundation import extensions
from cpbench.generators.collection import address_text
from cpbench.proofs import prove
from cpbench.proofs.polyhedra import objective
from cpbench.verification import Status, Verdict

DECLARED = "that the problem is convex is its author's word, which cannot be checked here"


@click.command()
@click.argument("problem", type=ADDRESS)
@click.option("--answer", type=PATH, help="Answer file (.h5, .npy, .npz, .csv).")
@measure_option
@click.option("--all-measures", is_flag=True, help="Print the answer under every measure, with its source.")
@tolerance_option
@format_option
def command(
    problem: str,
    answer: Path | None,
    measure: str | None,
    all_measures: bool,
    tolerance: float,
    file_format: str | None,
) -> None:
    """Measure an answer on a problem; without --answer, the candidate in the file's own /solution.

    With --all-measures, show the measures of Siconos, FCLIB, PATH, Clarabel, SCS, HiGHS, DIMACS, OSQP, qpbenchmark,
    ContactBench, Kamino and Björkegren, as far as they know the formulation. With --measure NAME, one of these numbers
    decides.

    Where the formulation has multipliers, the other unknowns alone are an answer too: cpbench computes multipliers for
    them and says so.

    Of a results file in place of PROBLEM, measure all stored answers again, without solving, and name every row whose
    status or error does not follow from its answer; with --tolerance or --measure, every status that changes.

    The exit code is 1 when the answer does not pass, or is only stationary (optimality conditions hold, and the problem
    is not known to be convex); of a results file, when a row does not follow from its answer, or a problem has changed.
    """
    if is_results_file(problem):
        if all_measures or answer is not None:
            raise click.UsageError("--answer and --all-measures are for one answer to a PROBLEM, not for results")
        source = click.get_current_context().get_parameter_source("tolerance")
        wanted = tolerance if source and source.name != "DEFAULT" else None
        if not rejudge_file(problem, measure, wanted, lambda line: print_lines([line])):
            sys.exit(1)
        return
    loaded = load(problem, format=file_format)
    if answer is not None:
        given = storage.load_answer(answer, loaded, primal=True)
    else:
        stored = storage.solution(problem)
        if stored is None:
            raise FormatError(problem, "solution", "is missing; give an answer with --answer FILE")
        given = stored[0]
    point, completed = multipliers.whole(loaded, given, tolerance)
    verdict = with_others(verify(loaded, point, tolerance=tolerance, measure=measure), loaded, point)
    verdict = replace(verdict, parts={**verdict.parts, **optimality_gap(loaded, point)})
    if all_measures:
        lines = _table(extensions.hook("all_measures")(loaded, point, tolerance), tolerance)
    else:
        lines = judged_lines(verdict)
    verdict = multipliers.marked(verdict) if completed else verdict
    error = number(verdict.error) if measure else verification.error_text(verdict.error)
    print_lines([f"{address_text(problem)}: error {error}, {outcome(loaded, verdict)}"])
    if completed:
        print_lines([f"  {completed}"])
    if verdict.within and not verdict.solved:
        print_lines(unbounded_lines(loaded))
    print_lines(lines)
    print_lines(remark_lines(verdict))
    if isinstance(loaded, ContactProblem):
        print_lines(answer_lines(loaded, point, tolerance, solved=verdict.solved))
    if not verdict.solved:
        sys.exit(1)


def _table(measures: Sequence[Any], tolerance: float) -> Iterator[str]:
    """Yield a line for each measure, then the sources; `-` stands where a measure has no tolerance."""
    if not measures:
        return
    words = {True: "yes", False: "no", None: "-"}
    head = ("  measure", "value", f"at most {number(tolerance)}", "whose")
    rows = [
        (f"  {row.name}", number(row.value), words[row.within(tolerance)], row.source.partition(" (")[0])
        for row in measures
    ]
    yield from table([head, *rows])
    yield from (f"  {source}" for source in sorted({row.source for row in measures}))


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


def judged_lines(verdict: Verdict) -> Iterator[str]:
    """Yield the number that decides, and those that do not, with what they are."""
    for name, value in verdict.judged.items():
        yield f"  judged  {name:<28} {value:.3g}"
    if verdict.parts:
        yield "  not judged: residuals by which solvers of cpbench stop, and their parts (--all-measures names sources)"
    for name, value in verdict.parts.items():
        yield f"          {name:<28} {value:.3g}"


def remark_lines(verdict: Verdict) -> Iterator[str]:
    """Yield the flags, and what the verdict rests on where nothing measures it."""
    if verdict.flags:
        yield f"  flags   {', '.join(verdict.flags)}"
    if "convexity declared" in verdict.flags:
        yield f"          convexity declared: {DECLARED}"


def unbounded_lines(problem: Problem, seconds: float = 5.0) -> Iterator[str]:
    """Yield that the objective has no lower bound, where that is proved; problems with linear constraints only."""
    if objective(problem) is None:
        return
    attempt = prove(problem, str(Status.UNBOUNDED), seconds=seconds)
    if attempt.proof is not None:
        yield f"  unbounded: the objective has no lower bound, {attempt.message}"
