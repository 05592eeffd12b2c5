"""`cpbench export`."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.bench.results.store import Store
from cpbench.cli.options import force_option
from cpbench.errors import FormatError


@click.command()
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
    for path in (rows, answers):
        if path is not None and path.exists() and not force:
            raise FormatError(path, "", "exists already; use --force to replace it")
    store = Store(results)
    try:
        if rows is not None:
            _write_rows(store, rows)
            click.echo(f"rows: {rows}")
        if answers is not None:
            click.echo(f"answers: {answers} ({_write_answers(store, answers)})")
    finally:
        store.close()


def _write_rows(store: Store, path: Path) -> None:
    table = store.table()
    if path.suffix == ".csv":
        table.to_csv(path, index=False)
    elif path.suffix == ".json":
        table.to_json(path, orient="records", indent=1)
    elif path.suffix == ".parquet":
        try:
            table.to_parquet(path, index=False)
        except ImportError:
            raise FormatError(path, "", "Parquet needs pyarrow: pip install 'cpbench[arrow]'") from None
    else:
        raise FormatError(path, "", f"unknown suffix '{path.suffix}'; use .csv, .json or .parquet")


def _write_answers(store: Store, path: Path) -> int:
    """One group a problem, one dataset a label, with status, error and solver as attributes; the number written."""
    import h5py

    from cpbench.bench.results import answers

    partial = path.with_name(f".{path.name}.partial")
    count = 0
    try:
        with h5py.File(partial, "w") as file:
            for key, blob in store.answers():
                row = store.row(key)
                group = file.require_group(f"{row['problem']}-{row['fingerprint'][:8]}")
                group.attrs.update({"node": row["node"], "fingerprint": row["fingerprint"], "address": row["address"]})
                data = group.create_dataset(f"{row['label']} tol={row['tolerance']:g}", data=answers.unpack(blob))
                data.attrs.update(
                    {k: row[k] for k in ("status", "error", "claim", "route", "solver") if row[k] is not None}
                )
                count += 1
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    return count
