"""`cpbench run`."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from cpbench.bench import machine, plan
from cpbench.bench.lane import Lane, Setting
from cpbench.bench.plan import Limits
from cpbench.bench.runner import execute, settings
from cpbench.bench.store import KEEP, Store
from cpbench.cli.options import Counts, format_option, limit_options, tolerance_option
from cpbench.cli.progress import Display
from cpbench.errors import CpbenchError, NoRoute, StoreError

FROZEN = ("timeout", "memory", "threads", "repeats")
"""Limits that all rows of one results file share."""


@click.command()
@click.argument("problems", nargs=-1, metavar="[PROBLEM|FOLDER]...")
@click.option("-s", "--solver", "solvers", multiple=True, metavar="NAME[opt=value]", help="Only these solvers.")
@click.option(
    "--routes",
    type=click.Choice(["exact", "facets", "all"]),
    help="Which conversions may be used; facets adds inner facets, all adds outer ones, relaxations and "
    "merely necessary conversions. Default: exact; for the built-in suite: facets.",
)
@click.option("--facets", type=Counts(), default="8,16", show_default=True, help="Facets of approximate routes.")
@click.option("--via", multiple=True, metavar="CONVERSION", help="Only routes through this conversion.")
@tolerance_option
@limit_options
@click.option("--repeats", type=click.IntRange(min=1), default=3, show_default=True, help="Of solves below 1 s.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the random order.")
@click.option("--keep", type=click.Choice(KEEP), default="all", show_default=True, help="Answers to keep.")
@click.option("-o", "--output", type=click.Path(path_type=Path, dir_okay=False), help="Results file (SQLite).")
@click.option("--report", "report_folder", type=click.Path(path_type=Path), help="Folder of the report.")
@click.option("--no-report", is_flag=True, help="Write no report.")
@click.option("--no-resume", is_flag=True, help="Start again: refuse an existing results file.")
@click.option("--dry-run", is_flag=True, help="Print what would be run.")
@click.option("-q", "--quiet", is_flag=True, help="No progress.")
@format_option
def command(
    problems: tuple[str, ...],
    solvers: tuple[str, ...],
    routes: str | None,
    facets: tuple[int, ...],
    via: tuple[str, ...],
    tolerance: float,
    timeout: float,
    memory: int,
    threads: int,
    repeats: int,
    seed: int,
    keep: str,
    output: Path | None,
    report_folder: Path | None,
    no_report: bool,
    no_resume: bool,
    dry_run: bool,
    quiet: bool,
    file_format: str | None,
) -> None:
    """Run every reachable solver on every problem, judge every answer on the problem that was asked, and report.

    Problems are files, packs (FILE::NAME) or folders; without any, the built-in suite is run. The same command
    after an interruption resumes.
    """
    from cpbench import storage
    from cpbench.solvers.base import solvers as registry

    builtin = not problems
    if builtin:
        from cpbench.generators.collection import builtin_folder

        problems = (str(builtin_folder()),)
    addresses = storage.problem_files(problems)
    if not addresses:
        raise CpbenchError(f"no problem file in {', '.join(problems)}; see cpbench list formats")
    entries = [plan.parse_entry(s) for s in solvers] or [plan.Entry(name) for name in registry.names()]
    routes = routes or ("facets" if builtin else "exact")
    asked = [plan.pinned(via, {"facets": facets[0]})] if via else plan.requests(routes, facets)
    name = "builtin" if builtin else "run"
    output = output or Path(f"{name}.sqlite")
    if no_resume and output.exists():
        raise StoreError(f"{output}: exists; remove it or leave --no-resume out to go on with it")
    limits = Limits(timeout, memory, threads, repeats)
    display = Display(quiet)
    if output.exists() and not dry_run:
        _same_limits(output, limits)
    try:
        (setting,) = settings(Setting(threads, memory))
        with Lane(setting) as lane:
            surveys, refused = _survey(lane, addresses, asked, file_format, display)
            _tell_twins(surveys)
            planned = plan.pairs(surveys, entries, asked, tolerance, limits, relaxations=routes == "all")
            if dry_run:
                _print_plan(planned, refused, limits)
                return
            _require_pairs(planned, surveys, refused)
            store = Store(output, create=True, keep=keep)
            try:
                before = store.meta()
                read = [survey["address"] for survey in surveys]
                store.note_files(read, refused)
                store.plan(planned)
                store.set_meta(
                    command=shlex.join(["cpbench", *sys.argv[1:]]),
                    cpbench=machine.versions().get("cpbench", ""),
                    date=time.strftime("%Y-%m-%d %H:%M"),
                    seed=seed,
                    machine=machine.describe(),
                    versions=machine.versions(),
                    jobs=1,
                    builtin=builtin,
                    formats=_formats(before.get("formats", {}), read, file_format),
                    **_frozen(limits),
                )
                display.begin(planned, store.pending())
                try:
                    execute([lane], store, planned, seed, display.progress)
                finally:
                    display.end()
                    store.set_meta(solvers=_solver_sheets(before.get("solvers", {}), planned, lane.versions))
                _finish(store, output, report_folder, no_report, builtin, refused)
            finally:
                store.close()
    except KeyboardInterrupt:
        click.echo(f"cpbench: interrupted; {output} has what was done, the same command goes on", err=True)
        sys.exit(130)


def _frozen(limits: Limits) -> dict[str, float]:
    return dict(zip(FROZEN, (limits.seconds, limits.memory, limits.threads, limits.repeats), strict=True))


def _same_limits(output: Path, limits: Limits) -> None:
    """Refuse to mix limits in an old file, before anything is done."""
    store = Store(output, create=True)
    try:
        before = store.meta()
    finally:
        store.close()
    for name, mine in _frozen(limits).items():
        if name in before and before[name] != mine:
            raise StoreError(
                f"{output}: was made with {name} {before[name]:g}, now {mine:g}; results of other limits "
                "do not mix: use another file with -o"
            )


def _require_pairs(planned: list[plan.Pair], surveys: list[dict[str, Any]], refused: list[tuple[str, str]]) -> None:
    """Nothing to run is bad input, and nothing is written for it."""
    if planned:
        return
    if not surveys:
        more = f" (and {len(refused) - 1} more files refused)" if len(refused) > 1 else ""
        raise CpbenchError(f"{refused[0][1]}{more}")
    raise NoRoute(
        f"no route leads from {surveys[0]['address']} to any of the solvers asked for; "
        f"see: cpbench route {surveys[0]['address']} --explain"
    )


def _survey(
    lane: Lane, addresses: list[str], asked: list[plan.Request], file_format: str | None, display: Display
) -> tuple[list[dict[str, Any]], list[tuple[str, str]]]:
    surveys: list[dict[str, Any]] = []
    refused: list[tuple[str, str]] = []
    for address in display.reading(addresses):
        try:
            surveys.append(lane.survey(address, asked, file_format))
        except CpbenchError as reason:
            refused.append((address, str(reason)))
    return surveys, refused


def _tell_twins(surveys: list[dict[str, Any]]) -> None:
    """Say which files hold the same problem: it is run once, under the first one's name."""
    first: dict[str, str] = {}
    for survey in surveys:
        twin = first.setdefault(survey["fingerprint"], survey["address"])
        if twin != survey["address"]:
            click.echo(f"same problem, run once: {survey['address']} is {twin}", err=True)


def _formats(before: Mapping[str, str], read: list[str], file_format: str | None) -> dict[str, str]:
    """The `--format` by which each file of the results was read, where one was given."""
    now = set(read)
    kept = {address: name for address, name in before.items() if address not in now}
    return kept if file_format is None else kept | dict.fromkeys(read, file_format)


def _solver_sheets(
    before: Mapping[str, Mapping[str, Any]], planned: list[plan.Pair], versions: Mapping[str, str]
) -> dict[str, Any]:
    """What the results say of each solver in them: those of earlier commands stay, and so does the version of one
    that had nothing left to do."""
    from cpbench.solvers.base import solvers as registry

    sheets: dict[str, Any] = dict(before)
    for pair in planned:
        spec = registry.get(pair.entry.solver).spec
        sheets[pair.label] = {
            "name": spec.name,
            "node": spec.node,
            "version": versions.get(spec.name) or before.get(pair.label, {}).get("version", ""),
            "licence": spec.licence,
            "publishing": spec.publishing,
            "summary": spec.summary,
            "citation": spec.citation,
        }
    return sheets


def _print_plan(planned: list[plan.Pair], refused: list[tuple[str, str]], limits: Limits) -> None:
    for pair in planned:
        click.echo(f"{pair.address}\t{pair.label}\t{pair.node} -> {pair.target}")
    for address, reason in refused:
        click.echo(f"refused: {address}: {reason}", err=True)
    worst = len(planned) * limits.seconds * max(1, limits.repeats)
    click.echo(f"{len(planned)} pairs, {len(refused)} files refused, at most {worst / 3600:.1f} h", err=True)


def _finish(
    store: Store,
    output: Path,
    report_folder: Path | None,
    no_report: bool,
    builtin: bool,
    refused: list[tuple[str, str]],
) -> None:
    for address, reason in refused:
        click.echo(f"refused: {reason if address in reason else f'{address}: {reason}'}", err=True)
    counts = store.counts()
    summary = ", ".join(f"{counts[s]} {s}" for s in sorted(counts, key=lambda s: -counts[s]))
    click.echo(f"{sum(counts.values())} pairs: {summary}")
    click.echo(f"results: {output}")
    if not no_report:
        from cpbench.report.markdown import write_report

        folder = report_folder or Path("reports") / ("builtin" if builtin else output.stem)
        path = write_report(store.table(), store.meta(), folder, "The built-in suite" if builtin else output.stem)
        click.echo(f"report: {path}")
