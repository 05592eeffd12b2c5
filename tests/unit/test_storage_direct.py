"""HDF5 goes straight into the file that gets its name last; indices are read in the width they were written in."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

from cpbench import storage
from cpbench.formulations import LCP
from cpbench.foundation.matrices import matrix


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform == "win32", reason="no limits of file sizes")
def test_a_disk_that_fills_up_leaves_nothing(tmp_path: Path) -> None:
    code = (
        "import resource, signal, sys, numpy as np; from cpbench import errors, storage\n"
        "from cpbench.formulations import LCP\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (50000, 50000))\n"
        "try: storage.save(LCP(M=np.eye(200), q=np.ones(200)), sys.argv[1], compress=False)\n"
        "except errors.FormatError as refusal: print(refusal)\n"
    )
    path = tmp_path / "a.h5"
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"{path}: cannot be written (File too large)"
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(("stored", "held"), [("i4", np.int32), ("i8", np.int64), (">i4", np.int32), ("u2", np.int64)])
def test_indices_of_any_width_are_read(tmp_path: Path, stored: str, held: type) -> None:
    M = sp.csr_array(np.array([[2.0, 0.0, 1.0], [0.0, 3.0, 0.0], [1.0, 0.0, 4.0]]))
    path = tmp_path / "a.h5"
    storage.save(LCP(M=M, q=np.ones(3)), path)
    with h5py.File(path, "r+") as file:
        group = file["cpbench/M"]
        for name in ("i", "p"):
            values = group[name][()].astype(stored)
            del group[name]
            group[name] = values
    got = storage.load(path).M
    assert got.indices.dtype == held
    assert (got != M).nnz == 0
    assert matrix(got) is got
