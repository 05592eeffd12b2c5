"""Output of `cpbench run` before the first solve and after the last."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

from cpbench.bench import skipped
from cpbench.bench.planning import dry_run
from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.results.store import Store
from cpbench.bench.run import OpenRun, require_answers
from cpbench.cli import run_text
from cpbench.cli.terminal import folded, print_lines, width
from cpbench.storage.base import require_folder
from cpbench.verification import Status


def announce(assembly: Assembly) -> None:
    """Print what a reader should know before the run; raises CpbenchError where there is nothing to run."""
    print_lines(run_text.planned(assembly), err=True)
    assembly.require_pairs()


def print_plan(run: OpenRun) -> None:
    """Print the plan, its number of pairs and how long they take at most; nothing is written."""
    plan, assembly = run.plan, run.assembly
    before = skipped.statuses_of(plan.results)
    for line in dry_run.lines(plan, assembly, before, width()):
        print_lines(folded(line))
    print_lines(run_text.refused(assembly.refused), err=True)


def require_places(plan: RunPlan, assembly: Assembly) -> None:
    """Raise CpbenchError where the results could not be used as the plan asks, or the report could not be written."""
    require_answers(plan, assembly.pairs)
    if plan.report_folder is not None:
        require_folder(plan.report_folder)  # before hours of work


def finish(plan: RunPlan, store: Store, assembly: Assembly, step: Callable[[str], None]) -> None:
    """Print the answer and the last lines, and write the report; exits with 1 where the run failed. `step` notes what
    is being done."""
    from cpbench.analysis.run_table import RunTable
    from cpbench.api.concluding import conclude
    from cpbench.cli.answer import print_answer

    print_lines(run_text.refused(assembly.refused), err=True)
    counts = store.counts()
    if counts.get(Status.UNAVAILABLE):
        print_lines(run_text.not_available(store), err=True)
    step("looking for contradictions")
    run = RunTable.of(store.table(), store.meta())
    conflicts = conclude(store, run.rows, lambda line: print_lines([line], err=True))
    run = replace(run, meta=store.meta())  # with the contradictions and the collection
    print_answer(run)
    ending = run_text.ending(plan, store, assembly, run.stored, conflicts)
    print_lines(("", *ending.lines))
    if counts and plan.report_folder is not None:
        from cpbench.api.reports import write_report

        step("writing the report")
        files, _ = write_report(store, plan.report_folder, run_text.title(plan), run)
        print_lines(f"report: {path}" for path in files)
    print_lines((f"cpbench: {line}" for line in ending.failures), err=True)
    if ending.failed:
        sys.exit(1)
