"""The kept answers of a results file, as one HDF5 file."""

from __future__ import annotations

from collections.abc import Container
from pathlib import Path
from typing import BinaryIO

import h5py

from cpbench.bench.results.rows import Row, unpack_answer
from cpbench.bench.results.store import Store
from cpbench.storage.base import write_atomic


def export_answers(store: Store, path: Path, *, force: bool = False) -> int:
    """Write a group for each problem and a dataset for each label, with status, error and solver as attributes.

    Returns the number of answers. Raises FormatError where the file exists (unless `force`) or cannot be written.
    """
    count = 0

    def put(out: BinaryIO) -> None:
        nonlocal count
        with h5py.File(out, "w") as file:
            for key, blob in store.answers():
                row = store.row(key)
                group = file.require_group(f"{row.problem}-{row.fingerprint[:8]}")
                group.attrs.update({"node": row.node, "fingerprint": row.fingerprint, "address": row.address})
                data = group.create_dataset(_name(row, group), data=unpack_answer(blob))
                attributes = {name: getattr(row, name) for name in ("status", "error", "claim", "route", "solver")}
                data.attrs.update({name: value for name, value in attributes.items() if value is not None})
                count += 1

    write_atomic(path, put, force=force)
    return count


def _name(row: Row, taken: Container[str]) -> str:
    """Return label, tolerance and what else tells rows of one problem apart, where it is not the usual: `lemke
    tol=1e-06 start=file:2`; the number of the row among those of one name, where two sets have it."""
    parts = [row.label, f"tol={row.tolerance:g}"]
    parts += [f"start={row.start}"] if row.start not in (None, "", "cold") else []
    parts += [f"threads={row.threads}"] if row.threads != 1 else []
    parts += [f"measure={row.measure}"] if row.measure else []
    name = " ".join(parts).replace("/", "|")
    count = 1
    while (numbered := name if count == 1 else f"{name} ({count})") in taken:
        count += 1
    return numbered
