"""Problems from the referee to the workers: the same mathematics, aligned and read-only."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from tiers import by_night

from cpbench.bench import shared_problem
from cpbench.formulations import LCP, MLCP
from cpbench.generators.base import LARGE, STANDARD, generators

SMALLER = [one.name for one in generators if one.tier not in (STANDARD, LARGE)]
LARGER = [one.name for one in generators if one.tier == STANDARD]


@pytest.mark.parametrize("name", [*SMALLER, *by_night(LARGER)])
def test_every_kind_of_problem_arrives_as_it_was(name: str, tmp_path: Path) -> None:
    for instance in generators.get(name).instances():
        shared_problem.write(instance.problem, tmp_path / "p")
        read = shared_problem.read(tmp_path / "p")
        assert type(read) is type(instance.problem)
        assert (read.fingerprint, read.name) == (instance.problem.fingerprint, instance.problem.name)
        assert read.sizes() == instance.problem.sizes()
        for key, matrix in instance.problem.data().items():
            assert sp.issparse(matrix) == sp.issparse(read.data()[key])


def test_arrays_are_aligned_and_read_only(tmp_path: Path) -> None:
    """An unaligned array is another type to a compiled loop, which would be compiled anew in a timed solve."""
    sparse = sp.csr_array(np.diag([1.0, 2.0, 3.0]))
    problem = MLCP(A=sparse, B=sparse, C=sparse, D=sparse, a=np.ones(3), b=np.ones(3), name="odd")
    shared_problem.write(problem, tmp_path / "p")
    for matrix in shared_problem.read(tmp_path / "p").data().values():
        parts = (matrix.data, matrix.indices, matrix.indptr) if sp.issparse(matrix) else (matrix,)
        for part in parts:
            assert part.flags.aligned
            assert not part.flags.writeable


def test_what_is_cut_short_is_no_problem(tmp_path: Path) -> None:
    shared_problem.write(LCP(M=np.eye(3), q=np.ones(3)), tmp_path / "p")
    whole = (tmp_path / "p").read_bytes()
    for size in (0, 5, 20, len(whole) - 1):
        (tmp_path / "p").write_bytes(whole[:size])
        with pytest.raises(ValueError):  # noqa: PT011 - of numpy or json, whichever meets it
            shared_problem.read(tmp_path / "p")
    with pytest.raises(FileNotFoundError):
        shared_problem.read(tmp_path / "absent")
