"""Problems and answers as arrays: what is written is read again, and what is not an answer is told."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.formulations import LCP
from cpbench.formulations.exchange import exchanges

NPY = exchanges.get("npy-dir")


def test_a_folder_is_what_its_description_says(tmp_path: Path) -> None:
    M = sp.csr_array(np.array([[2.0, 0.0], [1.0, 3.0]]))
    NPY.write_problem(LCP(M=M, q=np.array([-1.0, 2.0]), name="two"), tmp_path / "p")
    found = {path.name: path for path in (tmp_path / "p").iterdir()}
    assert sorted(found) == sorted(
        ["problem.json", "q.npy", "M.data.npy", "M.indices.npy", "M.indptr.npy", "M.shape.npy"]
    )
    assert json.loads(found["problem.json"].read_text()) == {"node": "lcp", "name": "two"}
    assert np.load(found["M.indptr.npy"]).dtype == np.int64
    np.testing.assert_array_equal(np.load(found["M.data.npy"]), [2.0, 1.0, 3.0])
    NPY.write_problem(LCP(M=np.eye(2), q=np.ones(2)), tmp_path / "p")
    assert {path.name for path in (tmp_path / "p").iterdir()} == {"problem.json", "q.npy", "M.npy"}


def _npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


ANSWERS = {
    "missing": (None, "z: is missing, expected 3 numbers"),
    "short": (_npy(np.ones(2)), "z: has shape (2,), expected 3 numbers"),
    "complex": (_npy(np.ones(3, complex)), "z: holds complex128, expected 3 real numbers"),
    "text": (_npy(np.array(["a", "b", "c"])), "z: holds <U1, expected 3 real numbers"),
    "objects": (_npy(np.array([None, None, None])), "z: holds Python objects"),
    "empty": (b"", "z: is not an array in NumPy's .npy format"),
    "cut": (_npy(np.ones(3))[:-8], "z: declares 24 bytes, the file holds 16 of them"),
    "huge": (_npy(np.ones(3)).replace(b"(3,), }      ", b"(10**18,), } "), "z: is not an array in NumPy's"),
}


@pytest.mark.parametrize("fault", ANSWERS)
def test_an_invalid_answer_is_refused(fault: str, tmp_path: Path) -> None:
    content, told = ANSWERS[fault]
    if content is not None:
        (tmp_path / "z.npy").write_bytes(content)
    with pytest.raises(FormatError) as raised:
        NPY.read_answer(tmp_path, LCP(M=np.eye(3), q=np.ones(3)))
    assert told in str(raised.value)
    assert "\n" not in str(raised.value)


def test_integers_are_numbers_and_nan_is_an_answer(tmp_path: Path) -> None:
    problem = LCP(M=np.eye(3), q=np.ones(3))
    for value in (np.ones(3, int), np.full(3, np.nan), np.ones((3, 1)), np.ones(3, np.float32)):
        np.save(tmp_path / "z.npy", value)
        point = NPY.read_answer(tmp_path, problem)
        np.testing.assert_array_equal(point.z, value.ravel())


@pytest.mark.parametrize(
    ("header", "told"),
    [
        ("", "names no problem"),
        ("[]", "names no problem"),
        ('{"node": "lpc"}', "unknown formulation 'lpc'"),
        ('{"node": "lcp", "dimension": 3}', "has dimension, which lcp has not"),
        ('{"node": "lcp"}', "q"),
    ],
)
def test_a_folder_that_is_not_a_problem_is_refused(header: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "problem.json").write_text(header)
    np.save(tmp_path / "M.npy", np.eye(2))
    with pytest.raises(FormatError, match=told):
        NPY.read_problem(tmp_path)
    with pytest.raises(FormatError, match="no such folder"):
        NPY.read_problem(tmp_path / "nowhere")
