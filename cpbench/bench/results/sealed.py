"""Results files as commands and scripts read them: only those whose rows are as a run wrote them."""

from __future__ import annotations

import logging
from pathlib import Path

from cpbench.bench.results.store import Store

logger = logging.getLogger("cpbench.results")


def sealed(path: Path) -> Store:
    """Return the file, open for reading, after its seals were checked; what could not be checked is said. Raises
    SealError."""
    store = Store(path)
    try:
        found = store.audit()
        found.require()
    except BaseException:
        store.close()
        raise
    if found.note:
        logger.warning("%s", found.note)
    return store
