"""`cpbench doctor`."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

import click

from cpbench import kernel_cache
from cpbench.bench import checkup, machine, time_limits
from cpbench.bench.checkup import Checkup
from cpbench.bench.processes import isolation
from cpbench.cli.options import Command
from cpbench.cli.terminal import folded, table


@click.command(cls=Command)
@click.option(
    "--warm", is_flag=True, help="Compile and load every solver and conversion now, so that the first run need not."
)
def command(warm: bool) -> None:
    """Say what works on this machine and how to get what does not.

    Every guest is imported, in a process of its own: one that crashes or hangs is told, and harms nobody.
    """
    from cpbench.solvers.base import solvers

    for name, value in (*machine.describe().items(), *machine.versions().items()):
        click.echo(f"{name:<12} {value}")
    click.echo("isolation")
    for what, told in isolation.detect().told():
        _say(f"  {what:<10} {told}")
    click.echo("limits       killed with all it started half a second later at most")
    for what, told in time_limits.told():
        _say(f"  {what:<10} {told}")
    chosen = list(solvers)
    seen: dict[str, Checkup] = {}
    if warm:
        click.echo("compiling what is not in the cache yet, minutes the first time", err=True)
        for module in kernel_cache.modules("expressions", "conversions"):
            kernel_cache.load(module)
    for one in checkup.examine(chosen, warm):
        seen[one.name] = one
        _progress(len(seen), len(chosen), one.name, warm)
    if sys.stderr.isatty():
        click.echo("\r\x1b[2K", nl=False, err=True)
    for line in _told([seen[solver.spec.name] for solver in chosen]):
        click.echo(line)


def _say(line: str) -> None:
    """A line about one of several things, in the width of the terminal."""
    click.echo("\n".join(folded(line, hanging=11)))


def _progress(done: int, of: int, name: str, warm: bool) -> None:
    """A line that changes on a terminal; elsewhere one a tenth of the way, where it takes long."""
    if sys.stderr.isatty():
        click.echo(f"\r\x1b[2Ktrying solvers {done}/{of} {name}", nl=False, err=True)
    elif warm and done % max(1, of // 10) == 0:
        click.echo(f"{done}/{of} solvers", err=True)


def _told(found: Sequence[Checkup]) -> Iterator[str]:
    counts = {state: [one for one in found if one.state == state] for state in checkup.STATES}
    yield f"solvers      {', '.join(f'{len(those)} {state}' for state, those in counts.items() if those)}"
    for state, those in counts.items():
        if those:
            yield {
                "ok": "ok",
                "licence": "licence: installed, and not allowed to run",
                "broken": "broken: installed, and failed when it was tried",
                "missing": "missing: not installed; what to do, and what it brings",
            }[state]
            yield from (_ready if state == "ok" else _absent)(those)


def _ready(those: Sequence[Checkup]) -> Iterator[str]:
    """A line a solver, of those that run by default; the others are counted."""
    from cpbench.cli.solver_tables import HEAD, cells, families
    from cpbench.solvers.base import solvers

    specs = {one.name: solvers.get(one.name).spec for one in those}
    shown = [one for one in those if specs[one.name].by_default]
    rows = [cells(specs[one.name], one) for one in shown]
    yield from table((f"  {name}", *rest) for name, *rest in [HEAD, *rows])
    if any(specs[one.name].publishing for one in shown):
        yield "  * figures must not be published without permission: cpbench list solvers NAME"
    rest = [specs[one.name] for one in those if one not in shown]
    if rest:
        yield from folded(f"  and {len(rest)} that run only when they are named: {families(rest)}")


def _absent(those: Sequence[Checkup]) -> Iterator[str]:
    """A paragraph a reason, with all solvers that it keeps away."""
    from cpbench.cli.solver_tables import folded_names

    reasons: dict[str, list[str]] = {}
    for one in those:
        reasons.setdefault(one.detail.strip(), []).append(one.name)
    for reason, names in reasons.items():
        lines = reason.splitlines() or ["no reason was given"]
        yield from (part for line in lines for part in folded(f"  {line}"))
        yield from folded_names(names)
