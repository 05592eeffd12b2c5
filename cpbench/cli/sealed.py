"""Results files as commands read them: only those whose rows are as a run wrote them."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.bench.results.store import Store


def sealed(path: Path) -> Store:
    """The file, open for reading, after its seals were checked; what could not be checked is said. Raises SealError."""
    store = Store(path)
    try:
        found = store.audit()
        found.require()
    except BaseException:
        store.close()
        raise
    if found.note:
        click.echo(found.note, err=True)
    return store
