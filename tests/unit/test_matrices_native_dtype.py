"""Arrays read from files keep a "<f8" dtype that equals float64; problem data must not (CVXOPT refuses it)."""

from __future__ import annotations

import io

import numpy as np
import scipy.sparse as sp
from scipy.io import loadmat, savemat

from cpbench.foundation import matrices


def test_data_from_a_mat_file_have_the_plain_dtype() -> None:
    buffer = io.BytesIO()
    savemat(buffer, {"v": np.array([[0.5], [1.5]]), "S": sp.csc_matrix(np.diag([0.5, 1.5]))})
    data = loadmat(buffer)
    assert memoryview(data["v"].ravel()).format == "<d"  # the case that matters is really there
    for array in (
        matrices.vector(data["v"].ravel()),
        matrices.matrix(data["v"]),
        matrices.matrix(data["S"]).data,
    ):
        assert memoryview(array).format == "d"
        assert not array.flags.writeable
