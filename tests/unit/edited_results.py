"""Results files, changed by hand and sealed anew: what another machine or version may have written."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from cpbench.bench.results import file_seal, seal_key, seals
from cpbench.bench.results.database import Database


def seal_anew(path: Path) -> None:
    """Put new seals on all rows and on the whole file, with this user's key."""
    key = seal_key.find_or_make()
    with closing(sqlite3.connect(path)) as db:
        rows = db.execute(seals.READ).fetchall()
        db.executemany("INSERT OR REPLACE INTO seals VALUES (?, ?)", [(row[0], seals.sealed(row, key)) for row in rows])
        db.execute("DELETE FROM file_seal")
        db.commit()
    with closing(Database(path)) as found:
        there = found.stream("SELECT key, seal FROM seals ORDER BY key")
        seal = file_seal.sealed(file_seal.contents(found).digests(), file_seal.digest_of_rows(there), key)
    with closing(sqlite3.connect(path)) as db:
        file_seal.write(db, seal)
        db.commit()
