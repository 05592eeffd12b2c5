"""Opens results files for commands and scripts, after a check of their seals."""

from __future__ import annotations

import logging
from pathlib import Path

from cpbench.bench.results.store import Store

logger = logging.getLogger("cpbench.results")


def sealed(path: Path) -> Store:
    """Open a file for reading and check its seals; warn of what could not be checked. Raises SealError."""
    store = Store(path)
    try:
        store.audit().require()
        for note in store.meta().get("seals", []):
            logger.warning("%s", note if str(path) in note else f"{path}: {note}")
    except BaseException:
        store.close()
        raise
    return store
