"""`cpbench export`."""

from __future__ import annotations

from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import click

from cpbench.bench.results.sealed import sealed
from cpbench.bench.results.store import Store
from cpbench.cli.options import Command, force_option
from cpbench.storage.base import require_new


@click.command(cls=Command)
@click.argument("results", type=click.Path(path_type=Path))
@click.option(
    "--rows", type=click.Path(path_type=Path), help="Write the rows: .csv, .json or .parquet ([arrow] extra)."
)
@click.option("--answers", type=click.Path(path_type=Path), help="Write the kept answers to one HDF5 file.")
@force_option
def command(results: Path, rows: Path | None, answers: Path | None, force: bool) -> None:
    """Write the rows or the answers of a results file to other formats."""
    if rows is None and answers is None:
        raise click.UsageError("give --rows FILE or --answers FILE")
    from cpbench.report import row_files

    for path in (rows, answers):
        if path is not None:
            require_new(path, force)
    with sealed(results) as store:
        if rows is not None:
            row_files.write(store.table(), rows, force=force)
            click.echo(f"rows: {rows}")
        if answers is not None:
            click.echo(f"answers: {answers} ({_write_answers(store, answers, force)})")


def _name(row: Mapping[str, Any], taken: Container[str]) -> str:
    """Label, tolerance and what else tells rows of one problem apart, where it is not the usual: `lemke tol=1e-06
    start=file:2`; the number of the row among those of one name, where two sets have it."""
    parts = [str(row["label"]), f"tol={row['tolerance']:g}"]
    parts += [f"start={row['start']}"] if row["start"] not in (None, "", "cold") else []
    parts += [f"threads={row['threads']}"] if row["threads"] != 1 else []
    parts += [f"measure={row['measure']}"] if row["measure"] else []
    name = " ".join(parts).replace("/", "|")
    count = 1
    while (numbered := name if count == 1 else f"{name} ({count})") in taken:
        count += 1
    return numbered


def _write_answers(store: Store, path: Path, force: bool) -> int:
    """One group a problem, one dataset a label, with status, error and solver as attributes; the number written."""
    import h5py

    from cpbench.bench.results import answers
    from cpbench.storage.base import write_atomic

    count = 0

    def put(out: BinaryIO) -> None:
        nonlocal count
        with h5py.File(out, "w") as file:
            for key, blob in store.answers():
                row = store.row(key)
                group = file.require_group(f"{row['problem']}-{row['fingerprint'][:8]}")
                group.attrs.update({"node": row["node"], "fingerprint": row["fingerprint"], "address": row["address"]})
                data = group.create_dataset(_name(row, group), data=answers.unpack(blob))
                data.attrs.update(
                    {k: row[k] for k in ("status", "error", "claim", "route", "solver") if row[k] is not None}
                )
                count += 1

    write_atomic(path, put, force=force)
    return count
