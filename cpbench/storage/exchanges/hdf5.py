"""`hdf5`: a problem as `cpbench` itself keeps it, in one HDF5 file.

A sparse matrix M is a group `cpbench/M` as in FCLIB (nzmax, m, n, nz, p, i, x), a dense one a 2-D data set; vectors are
data sets of `cpbench/vectors`, nonlinear maps the string `cpbench/mof`, a model in MathOptFormat; node and name are
attributes of `cpbench`. Contact problems stand in FCLIB's own group, see `fclib`. An answer is an HDF5 file with a
group `/solution`, one data set for every part of the node's point; a contact problem's λ is FCLIB's `l`, and may be
missing where it is empty. Nothing else in the file is looked at, but `solution` may say by the attributes `node` and
`fingerprint` which problem it answers, and is then held to that.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from cpbench.formulations.base import Point, Problem
from cpbench.formulations.exchange import Exchange, exchanges
from cpbench.foundation import matrices
from cpbench.storage import answers, dispatch
from cpbench.storage.base import write_atomic
from cpbench.storage.hdf5_points import put_point
from cpbench.storage.hdf5_writer import new_file


class HDF5File(Exchange):
    """One file, in the schema of the native format."""

    name = "hdf5"
    summary = "one HDF5 file in cpbench's own schema"
    suffix = ".h5"
    format = "native"
    maps = True

    def write_problem(self, problem: Problem, path: Path, dense: bool = False) -> None:
        if dense:
            full = {name: matrices.dense(value) for name, value in problem.data().items() if value.ndim == 2}
            problem = dataclasses.replace(problem, **full)
        plain = dataclasses.replace(problem, provenance=())  # the way back is ours to know
        dispatch.save(plain, path, format=self.format, force=True, compress=False)

    def read_problem(self, path: Path) -> Problem:
        return dispatch.load(path, format=self.format)

    def write_answer(self, point: Point, path: Path) -> None:
        with new_file() as (root, image):
            put_point(root, point, {})
        write_atomic(path, image[0], force=True)

    def read_answer(self, path: Path, problem: Problem) -> Any:
        return answers.load_answer(path, problem)


exchanges.add("hdf5", HDF5File())
