"""Keep the outcomes of a run as text for version control, and show the changes in a later run."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from cpbench.cli.options import ListOption, Sections, fail_on_option, force_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import FILE, PATH
from cpbench.errors import CpbenchError, UnknownName
from cpbench.foundation.plurals import counted
from cpbench.storage.base import require_new

FAIL_ON = ("regression", "wrong", "crash", "fixed", "changed", "new", "vanished", "unmeasured")
SECTIONS = {
    "Files": ["output", "force", "check"],
    "Update": ["update", "accept", "reason", "prune"],
    "Differences": ["slack", "fail_on", "help"],
}
EXAMPLES = (
    "cpbench results baseline run.sqlite -o baseline.csv",
    "cpbench results baseline run.sqlite --check baseline.csv --fail-on regression,wrong,crash,fixed",
    "cpbench results baseline run.sqlite --update -o baseline.csv",
    "cpbench results baseline run.sqlite --update -o baseline.csv --accept 'gear-*:nsgs' --reason 'see upstream #17'",
)


@click.command(cls=Sections, sections=SECTIONS, examples=EXAMPLES)
@click.argument("results", type=PATH)
@click.option("-o", "--output", type=FILE, help="Baseline to write.")
@force_option
@click.option("--check", type=FILE, help="Baseline to compare the results with.")
@click.option("--update", is_flag=True, help="Write better, different and new outcomes into -o; list worse ones.")
@click.option(
    "--accept",
    cls=ListOption,
    metavar="PATTERN",
    help="Pairs to accept although they are worse: PROBLEM:LABEL, a glob.",
)
@click.option("--reason", default="", metavar="TEXT", help="Reason of --accept; kept in the last column.")
@click.option("--prune", is_flag=True, help="Remove pairs that the results do not have.")
@click.option(
    "--slack",
    type=click.FloatRange(min=0),
    default=0.1,
    show_default=True,
    help="Relative difference of a counter that is allowed.",
)
@fail_on_option(f"Changes with which the command ends with 1: any of {','.join(FAIL_ON)}.")
def command(
    results: Path,
    output: Path | None,
    force: bool,
    check: Path | None,
    update: bool,
    accept: tuple[str, ...],
    reason: str,
    prune: bool,
    slack: float,
    fail_on: tuple[str, ...],
) -> None:
    """Keep the outcomes of a run as sorted text for version control, and show what a later run changes.

    Each pair has a line: status, power of ten of the error, counters, and the reason of a known failure (written by
    hand, and kept). There are no times, machines or dates. An update takes over better outcomes. Worse outcomes are
    listed and the old line stays, unless they are accepted with a reason. Lines of pairs that were not run stay as they
    are.

    The exit code is 1 for --fail-on, and when rows of RESULTS were changed after the run.
    """
    from cpbench.analysis import ratchet
    from cpbench.api import baselines
    from cpbench.report import baseline_file

    for name in fail_on:
        if name not in FAIL_ON:
            raise UnknownName("change", name, FAIL_ON)
    if (output is None) == (check is None):
        raise CpbenchError("say -o FILE to write a baseline, with --update to bring it up to date, or --check FILE")
    if update and (output is None or force):
        raise CpbenchError("--update goes with -o FILE and without --force: it changes that baseline")
    if (accept or prune) and not update:
        raise CpbenchError("--accept and --prune say how --update changes a baseline; add --update")
    if bool(accept) != bool(reason.strip()):
        raise CpbenchError("--accept PATTERN needs --reason TEXT, and the other way round: it is kept beside the pair")
    if fail_on and output is not None and not update:
        raise CpbenchError("--fail-on needs something to differ from: --check FILE, or --update")
    new, restricted = baselines.outcomes(results)
    if restricted:
        names = ", ".join(restricted)
        click.echo(f"licences restrict publishing figures of {names}: mind who sees the baseline", err=True)
    if output is not None and not (update and output.exists()):
        require_new(output, force)
        baseline_file.write(output, new)
        measured = baselines.measured(new)
        click.echo(f"{output}: {counted(measured, 'pair')}, {len(new) - measured} that were not run here left out")
        return
    kept = check or output
    assert kept is not None
    changes = ratchet.changes(baseline_file.read(kept), new, slack)
    accepted = ratchet.accepted(changes, accept)
    if accept and not accepted.any():
        raise CpbenchError(f"--accept {accept[0]}: no pair that got worse is called so; the list has PROBLEM:LABEL")
    print_lines(baselines.lines(changes, accepted))
    if output is not None:
        baseline_file.write(output, ratchet.updated(changes, accepted, reason, prune=prune))
        click.echo(f"{output}: updated")
    failed = baselines.failures(changes, accepted, fail_on)
    if failed:
        click.echo(f"cpbench: {', '.join(f'{n} {name}' for name, n in failed.items())} (--fail-on)", err=True)
        sys.exit(1)
