"""Output of `cpbench run` before the first solve and after the last."""

from __future__ import annotations

import sys

from cpbench.api import run_text
from cpbench.api.folders import require_folder
from cpbench.bench import planned_run
from cpbench.bench.planning import dry_run as dry_runs
from cpbench.bench.planning.assembly import Assembly
from cpbench.bench.planning.run_plan import RunPlan
from cpbench.bench.results.store import Store
from cpbench.cli.terminal import fitted, folded, print_lines, width
from cpbench.foundation.extensions import hook
from cpbench.verification import Status


def announce(plan: RunPlan, quiet: bool, dry_run: bool, assembly: Assembly) -> bool:
    """Print what will be run; return whether to run it."""
    print_lines(run_text.planned(assembly), err=True)
    if not quiet:
        print_lines(fitted(run_text.duration(plan, assembly)), err=True)
    assembly.require_pairs()
    if dry_run:
        for line in dry_runs.lines(plan, assembly, planned_run.statuses(plan.results), width()):
            print_lines(folded(line))
        print_lines(run_text.refused(assembly.refused), err=True)
        return False
    planned_run.require_answers(plan, assembly.pairs)
    if plan.report_folder is not None:
        require_folder(plan.report_folder)  # before hours of work
    return True


def print_removed(store: Store) -> None:
    """Print the rows of an earlier run that are run again."""
    print_lines(run_text.removed(store), err=True)


def finish(plan: RunPlan, certify: bool, store: Store, assembly: Assembly) -> None:
    """Certify answers where asked, print the answer and the last lines, and write the report; exits with 1 where the
    run failed."""
    from cpbench.api.cross_examination import cross_examine
    from cpbench.api.quoting import quote_collection
    from cpbench.cli.answer import print_answer

    print_lines(run_text.refused(assembly.refused), err=True)
    if certify:
        print_lines(hook("certify_rows")(store), err=True)
        store.end()
    counts = store.counts()
    if counts.get(Status.UNAVAILABLE):
        print_lines(run_text.not_available(store), err=True)
    table = store.table()
    quote_collection(store)
    found = cross_examine(store, table, lambda line: print_lines([line], err=True))
    print_answer(store)
    ending = run_text.ending(plan, store, assembly, table, found)
    print_lines(("", *ending.lines))
    if counts and plan.report_folder is not None:
        from cpbench.api.reports import write_report
        from cpbench.report.html import vega

        files, _ = write_report(store, plan.report_folder, run_text.title(plan), table)
        print_lines(f"report: {path}" for path in files)
        print_lines(filter(None, [vega.lacking()]), err=True)
    print_lines((f"cpbench: {line}" for line in ending.failures), err=True)
    if ending.failed:
        sys.exit(1)
