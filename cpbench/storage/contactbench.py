"""ContactBench's .npz: G (Delassus matrix), g (free velocity), mus; the normal is the LAST of each triple there."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.formulations.fc import FrictionContact
from cpbench.storage.arrays import npz_names, read_npz
from cpbench.storage.base import Format, build, formats, no_member, stem


class ContactBenchNpz(Format):
    """u = Gr + g with rows (T1, T2, N) a contact, reordered to (N, T1, T2): W = PGPᵀ, q = Pg."""

    name = "contactbench-npz"
    summary = "ContactBench's NumPy file: frictional contact, local (G, g, mus)"
    suffixes = (".npz",)

    def recognises(self, path: Path, head: bytes) -> bool:
        return head.startswith(b"PK") and {"G", "g", "mus"} <= npz_names(path)

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        found = read_npz(path)
        for key in ("G", "g", "mus"):
            if key not in found or found[key].dtype.kind not in "biuf":
                raise FormatError(path, key, "is missing or no array of numbers")
        G, g, mu = found["G"], found["g"].reshape(-1), found["mus"].reshape(-1)
        rows = 3 * mu.size
        if G.shape != (rows, rows) or g.size != rows:
            raise FormatError(
                path,
                "G",
                f"has shape {G.shape} and g {g.size} numbers, expected {rows} (3 for each of {mu.size} contacts)",
            )
        order = (np.arange(rows).reshape(-1, 3)[:, [2, 0, 1]]).reshape(-1)
        return build(path, FrictionContact, "", name=stem(path), W=G[np.ix_(order, order)], q=g[order], mu=mu)


formats.add("contactbench-npz", ContactBenchNpz())
