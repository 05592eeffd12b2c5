"""`fclib`: contact problems in FCLIB's schema, which its C library and Siconos read.

The problem is in `fclib_local` (W, q, mu; V, R, s with bilateral constraints), `fclib_global` (M, H, f, w, mu; G, b) or
`fclib_global_rolling` (mu_r beside them): matrices by rows or as triplets, counts as int32 data sets of one number, all
sparse. Beside it stands a group `cpbench`, which FCLIB's readers pass over. The answer is FCLIB's `/solution`, in a
file of its own or in a copy of the problem's: r of a local problem; v and r of a global one; l with bilateral
constraints. What else FCLIB writes there (u) follows from these, and is not read.
"""

from __future__ import annotations

from pathlib import Path

from cpbench.formulations.base import Problem
from cpbench.formulations.exchange import exchanges
from cpbench.storage import dispatch
from cpbench.storage.exchanges.hdf5 import HDF5File
from cpbench.storage.fclib import GROUPS


class FCLIBFile(HDF5File):
    """One file, in FCLIB's schema."""

    name = "fclib"
    summary = "one HDF5 file in FCLIB's schema; contact problems"
    suffix = ".hdf5"
    nodes = frozenset(GROUPS)
    format = "fclib"

    def write_problem(self, problem: Problem, path: Path, dense: bool = False) -> None:
        """Write the problem; FCLIB's matrices are sparse, whatever `dense` asks for."""
        super().write_problem(problem, path)

    def read_problem(self, path: Path) -> Problem:
        return dispatch.load(path)  # with or without the group that is ours


exchanges.add("fclib", FCLIBFile())
