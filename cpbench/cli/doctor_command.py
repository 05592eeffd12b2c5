"""Say what works on this machine, and how to install what does not."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence

import click

from cpbench.bench import availability, machine
from cpbench.bench.availability import SolverState
from cpbench.cli.list_command import HEAD, RESTRICTED, cells
from cpbench.cli.progress import shown_progress
from cpbench.cli.terminal import fitted, print_lines, reading_width, table
from cpbench.solvers.base import package_version, solvers

FAULTS = {("mujoco", "4.0.0"): "computes wrong steps with sparse Jacobians: pip install 'mujoco!=4.0.0'"}
"""What is known of a version of a package, whichever program uses it."""


@click.command()
def command() -> None:
    """Say what works on this machine, and how to install what does not.

    The package of every solver is imported in a separate process, so that a package that crashes or hangs is reported
    and the command goes on.
    """
    for name, value in (*machine.describe().items(), *machine.versions().items()):
        click.echo(f"{name:<12} {value}")
    for (package, version), fault in FAULTS.items():
        if package_version(package) == version:
            print_lines(fitted([f"{package:<12} {version} {fault}"]))
    chosen = list(solvers)
    states = availability.examine(chosen)
    seen = {one.name: one for one in shown_progress(states, len(chosen), "trying solvers")}
    print_lines(fitted(checkup_lines([seen[solver.spec.name] for solver in chosen], reading_width())))


def checkup_lines(states: Sequence[SolverState], width: int) -> Iterator[str]:
    """Yield the solvers by their state on this machine, and for what is missing how to get it."""
    counts = {state: [one for one in states if one.state == state] for state in availability.STATES}
    yield f"solvers      {', '.join(f'{len(those)} {state}' for state, those in counts.items() if those)}"
    for state, those in counts.items():
        if those:
            yield {
                "ok": "ok",
                "licence": "licence: installed, and not allowed to run",
                "broken": "broken: installed, and failed when it was tried",
                "missing": "missing: not installed; what to do, and what it brings",
            }[state]
            yield from _ready(those) if state == "ok" else _absent(those, width)


def _ready(those: Sequence[SolverState]) -> Iterator[str]:
    """Yield a line for each solver that runs by default; the others are counted."""
    specs = {one.name: solvers.get(one.name).spec for one in those}
    shown = [one for one in those if specs[one.name].by_default]
    rows = [cells(specs[one.name], one) for one in shown]
    yield from table((f"  {name}", *others) for name, *others in (HEAD, *rows))
    if any(specs[one.name].publishing for one in shown):
        yield f"  {RESTRICTED}"
    if rest := len(those) - len(shown):
        yield f"  and {rest} that run only when they are named"


def _absent(those: Sequence[SolverState], width: int) -> Iterator[str]:
    """Yield a paragraph for each reason, with all solvers that it keeps away."""
    reasons: dict[str, list[str]] = {}
    for one in those:
        reasons.setdefault(one.detail.strip(), []).append(one.name)
    for reason, names in reasons.items():
        lines = reason.splitlines() or ["no reason was given"]
        yield from (f"  {line}" for line in lines)
        text = ", ".join(f"{name} ({solvers.get(name).spec.node})" for name in names)
        indent = " " * 6
        yield from textwrap.wrap(text, width, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)
