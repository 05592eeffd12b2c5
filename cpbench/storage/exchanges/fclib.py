"""`fclib`: contact problems in FCLIB's schema, which its C library and Siconos read.

The problem is in `fclib_local` (W, q, mu; V, R, s with bilateral constraints), `fclib_global` (M, H, f, w, mu; G, b) or
`fclib_global_rolling` (mu_r beside them): matrices by rows or as triplets, counts as int32 data sets of one number, all
sparse. Beside it stands a group `cpbench`, which FCLIB's readers pass over. The answer is FCLIB's `/solution`, in a
file of its own or in a copy of the problem's: r of a local problem; v and r of a global one; l with bilateral
constraints. What else FCLIB writes there (u) follows from these, and is not read. Attributes `node` and `fingerprint`
of `solution` say which problem it answers, and it is then held to that.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from cpbench.formulations.base import Point, Problem
from cpbench.formulations.exchange import Exchange, exchanges
from cpbench.storage import answers, dispatch
from cpbench.storage.base import write_atomic
from cpbench.storage.fclib import GROUPS
from cpbench.storage.hdf5_points import put_point
from cpbench.storage.hdf5_tree import new_file


class FCLIBFile(Exchange):
    """One file, in FCLIB's schema."""

    name = "fclib"
    summary = "one HDF5 file in FCLIB's schema; contact problems"
    suffix = ".hdf5"
    nodes = frozenset(GROUPS)

    def write_problem(self, problem: Problem, path: Path, dense: bool = False) -> None:
        """Write the problem; FCLIB's matrices are sparse, whatever `dense` asks for."""
        plain = dataclasses.replace(problem, provenance=())  # the way back is ours to know
        dispatch.save(plain, path, format="fclib", force=True, compress=False)

    def read_problem(self, path: Path) -> Problem:
        return dispatch.load(path)  # with or without the group that is ours

    def write_answer(self, point: Point, path: Path) -> None:
        with new_file() as (root, image):
            put_point(root, point, {})
        write_atomic(path, image[0], force=True)

    def read_answer(self, path: Path, problem: Problem) -> Any:
        return answers.load_answer(path, problem)


exchanges.add("fclib", FCLIBFile())
