"""Results files, changed by hand and sealed anew: what another machine or version may have written."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from cpbench.bench.results import seal_key, seals


def seal_anew(path: Path) -> None:
    """Put new seals on all rows, with this user's key."""
    key = seal_key.find_or_make()
    with closing(sqlite3.connect(path)) as db:
        rows = db.execute(seals.READ).fetchall()
        db.executemany("INSERT OR REPLACE INTO seals VALUES (?, ?)", [(row[0], seals.sealed(row, key)) for row in rows])
        db.commit()
