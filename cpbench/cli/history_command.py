"""`cpbench history`."""

from __future__ import annotations

import fnmatch
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cpbench.bench.results.sealed import sealed
from cpbench.cli.options import Command, ListOption
from cpbench.errors import CpbenchError, FormatError, StoreError, UnknownName

if TYPE_CHECKING:
    import pandas as pd

    from cpbench.analysis.timeline import TimelineRun

SUFFIXES = (".md", ".csv", ".json", ".svg", ".png")


@click.command(cls=Command)
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RESULTS...")
@click.option("--label", "labels", cls=ListOption, metavar="GLOB", help="Solvers' labels to show. Repeatable.")
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    type=click.Path(path_type=Path, dir_okay=False),
    help=f"Write {', '.join(SUFFIXES)} instead of printing. Repeatable.",
)
def command(files: tuple[Path, ...], labels: tuple[str, ...], outputs: tuple[Path, ...]) -> None:
    """Show how solvers did over time: what each solved in every results file, and how fast against its first.

    Times are compared with the label's first file from the same machine, over the pairs solved in both; a file from
    another machine begins anew. The machine's own drift, by the solve that every run repeats, stands beside it.
    """
    from cpbench.analysis.timeline import timeline
    from cpbench.report import timeline_tables

    for path in outputs:
        if path.suffix not in SUFFIXES:
            raise click.UsageError(f"-o {path}: unknown suffix '{path.suffix}'; use {', '.join(SUFFIXES)}")
    runs = [run for run in map(_run, dict.fromkeys(path.resolve() for path in files)) if run is not None]
    if not runs:
        raise StoreError("none of the files has a row that was run: nothing to show; cpbench run PROBLEMS makes some")
    points = timeline(_named(runs))
    if labels:
        known = sorted(set(points["label"]))
        for pattern in labels:
            if not any(label == pattern or fnmatch.fnmatchcase(label, pattern) for label in known):
                raise UnknownName("label", pattern, known)
        chosen = [label for label in known if any(label == p or fnmatch.fnmatchcase(label, p) for p in labels)]
        points = points[points["label"].isin(chosen)].reset_index(drop=True)
    for path in outputs:
        _write(path, points)
        click.echo(f"history: {path}")
    if not outputs:
        for line in timeline_tables.columns(points):
            click.echo(line)


def _run(path: Path) -> TimelineRun | None:
    """A file that has something to tell; None of one in which nothing was run."""
    from cpbench.analysis import participation
    from cpbench.analysis.timeline import TimelineRun

    with sealed(path) as store:
        table, meta, machines = store.table(), store.meta(), store.machines()
    terms = participation.restricted(table, meta.get("solvers") or {})
    if terms:
        click.echo(f"{path}: licences restrict publishing figures of {', '.join(terms)}", err=True)
    if table["status"].isin(["not_run", "unavailable"]).all():
        click.echo(f"{path}: no pair was run; left out", err=True)
        return None
    return TimelineRun(
        str(path),
        table,
        str(meta.get("cpbench") or ""),
        machines,
        meta.get("machine") or {},
        str(meta.get("date") or ""),
        [solve["seconds"] for solve in meta["references"]],
        str(meta.get("reference") or ""),
    )


def _named(runs: list[TimelineRun]) -> list[TimelineRun]:
    """Files by as much of their path as tells them apart."""
    from dataclasses import replace

    parts = 1
    while len({Path(run.name).parts[-parts:] for run in runs}) < len(runs):
        parts += 1
    return [replace(run, name=str(Path(*Path(run.name).parts[-parts:]))) for run in runs]


def _write(path: Path, points: pd.DataFrame) -> None:
    from cpbench.report import timeline_tables

    if not path.absolute().parent.is_dir():
        raise CpbenchError(f"{path}: there is no folder {path.parent}; make it first")
    if path.suffix in (".svg", ".png"):
        from cpbench.report.timeline_figure import timeline_figure, write

        write(timeline_figure(points, f"{points['file'].nunique()} runs"), path)
        return
    text = {
        ".md": lambda: timeline_tables.markdown(points, path.stem),
        ".csv": lambda: timeline_tables.as_csv(points),
        ".json": lambda: timeline_tables.as_json(points),
    }[path.suffix]()
    try:
        path.write_text(text, encoding="utf-8", newline="\n")
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None
