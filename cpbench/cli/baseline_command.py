"""`cpbench baseline`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cpbench.bench.results.sealed import sealed
from cpbench.cli.options import ListOption, Sections, force_option
from cpbench.errors import CpbenchError, StoreError, UnknownName
from cpbench.plurals import counted

if TYPE_CHECKING:
    import pandas as pd

LISTED, FEW = 40, 8
"""Lines told of one kind of change; of pairs that are on one side only."""
FAIL_ON = ("regression", "wrong", "crash", "fixed", "changed", "new", "vanished", "unmeasured")
SECTIONS = {
    "Files": ["output", "force", "check"],
    "Update": ["update", "accept", "reason", "prune"],
    "Differences": ["slack", "fail_on", "help"],
}
EXAMPLES = (
    "cpbench baseline run.sqlite -o baseline.csv",
    "cpbench baseline run.sqlite --check baseline.csv --fail-on regression,wrong,crash,fixed",
    "cpbench baseline run.sqlite --update -o baseline.csv",
    "cpbench baseline run.sqlite --update -o baseline.csv --accept 'gear-*:nsgs' --reason 'see upstream #17'",
)


@click.command(cls=Sections, sections=SECTIONS, examples=EXAMPLES)
@click.argument("results", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path, dir_okay=False), help="The baseline.")
@force_option
@click.option("--check", type=click.Path(path_type=Path, dir_okay=False), help="Tell what differs from this baseline.")
@click.option("--update", is_flag=True, help="Take over into -o what is better, other or new; list what is worse.")
@click.option(
    "--accept",
    cls=ListOption,
    metavar="PATTERN",
    help="Take over what is worse too: PROBLEM:LABEL, a glob.",
)
@click.option("--reason", default="", metavar="TEXT", help="Why it is accepted; kept in the last column.")
@click.option("--prune", is_flag=True, help="Remove pairs that the results do not have.")
@click.option(
    "--slack", type=click.FloatRange(min=0), default=0.1, show_default=True, help="Part a counter may differ."
)
@click.option(
    "--fail-on",
    cls=ListOption,
    default=(),
    metavar="CHANGES",
    help=f"End with 1 on any of {','.join(FAIL_ON)}.",
)
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
    """Keep the outcomes of a run as sorted text for version control, and tell what a later run changes.

    A line a pair: status, power of ten of the error, counters, and why a failure is known (written by hand, kept).
    No times, machines or dates. An update is a ratchet: what got better is taken over, what got worse is listed and
    stays, unless it is accepted with a reason. Pairs that were not run are left alone.

    Ends with 1 for --fail-on, and when rows of RESULTS are not as a run wrote them.
    """
    from cpbench.analysis import baseline, ratchet
    from cpbench.report import baseline_file

    for name in fail_on:
        if name not in FAIL_ON:
            raise UnknownName("change", name, FAIL_ON)
    _require_sense(output, check, update, accept, reason, prune, fail_on, force)
    new = _outcomes(results)
    if output is not None and not (update and output.exists()):
        if output.exists() and not force:
            raise CpbenchError(f"{output}: exists; --update takes over what is better, --force replaces it")
        baseline_file.write(output, new)
        measured = len(new) - int(new["status"].isin(baseline.UNMEASURED).sum())
        click.echo(f"{output}: {counted(measured, 'pair')}, {len(new) - measured} that were not run here left out")
        return
    kept = check or output
    assert kept is not None
    found = ratchet.changes(baseline_file.read(kept), new, slack)
    meant = ratchet.accepted(found, accept)
    if accept and not meant.any():
        raise CpbenchError(f"--accept {accept[0]}: no pair that got worse is called so; the list has PROBLEM:LABEL")
    _tell(found, meant)
    if output is not None:
        baseline_file.write(output, ratchet.updated(found, meant, reason, prune=prune))
        click.echo(f"{output}: updated")
    failed = {name: count for name in fail_on if (count := int((_meant(found, name) & ~meant).sum()))}
    if failed:
        click.echo(f"cpbench: {', '.join(f'{n} {name}' for name, n in failed.items())} (--fail-on)", err=True)
        sys.exit(1)


def _require_sense(
    output: Path | None,
    check: Path | None,
    update: bool,
    accept: tuple[str, ...],
    reason: str,
    prune: bool,
    fail_on: tuple[str, ...],
    force: bool,
) -> None:
    """Raises CpbenchError on options that do not go together."""
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


def _outcomes(results: Path) -> pd.DataFrame:
    from cpbench.analysis import baseline, participation

    with sealed(results) as store:
        table, sheets = store.table(), store.meta().get("solvers") or {}
    new = baseline.of(table)
    if new["status"].isin(baseline.UNMEASURED).all():
        cause = f"none of {counted(len(new), 'pair')} was run" if len(new) else "no row"
        raise StoreError(f"{results}: {cause}: nothing to keep; run it with: cpbench run PROBLEMS -o {results}")
    terms = participation.restricted(table, sheets)
    if terms:
        click.echo(f"licences restrict publishing figures of {', '.join(terms)}: mind who sees the baseline", err=True)
    return new


def _tell(found: pd.DataFrame, accepted: pd.Series[bool]) -> None:
    """What differs, worst first, and how many of each kind."""
    from cpbench.analysis import baseline
    from cpbench.analysis.ratchet import Change

    told = found.assign(label=baseline.labels(found), setting=_settings(found), accepted=accepted)
    for change in (c for c in Change if c not in (Change.SAME, Change.KNOWN, Change.UNMEASURED)):
        rows = told[told["change"] == change]
        listed = FEW if change in (Change.NEW, Change.VANISHED) else LISTED
        for _, row in rows.head(listed).iterrows():
            mark = "accepted" if row["accepted"] else change
            note = f" (known: {row['known']})" if row["known"] else ""
            click.echo(f"{mark:10} {row['problem']}:{row['label']} {row['setting']}{row['detail']}{note}")
        if len(rows) > listed:
            click.echo(f"{change:10} and {len(rows) - listed} more")
    counts = found["change"].value_counts()
    click.echo(", ".join(f"{counts[c]} {c}" for c in Change if counts.get(c)))
    stale = int(counts.get(Change.FIXED, 0))
    if stale:
        click.echo(f"{stale} known failures are none any more: --update removes the reason (flaky... keeps it quiet)")


def _settings(found: pd.DataFrame) -> pd.Series[str]:
    """What tells pairs of one problem and solver apart, where the baseline has more than one of it."""
    told = found["problem"].str.slice(0, 0)
    for name in ("tolerance", "start", "threads", "measure", "sequence"):
        if found[name].nunique() > 1:
            told += f"{name}=" + found[name] + " "
    return told


def _meant(found: pd.DataFrame, name: str) -> pd.Series[bool]:
    """Which changes a word of --fail-on is about: wrong and crash are those that the baseline does not have."""
    from cpbench.analysis.ratchet import Change

    if name in ("wrong", "crash"):
        return (found["status_new"] == name) & (found["status_old"] != name)
    return found["change"] == (Change.REGRESSED if name == "regression" else name)
