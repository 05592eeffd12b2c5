"""`cpbench convert` refuses conversions that would not fit into memory."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import scipy.sparse as sp
from command_line import cpbench

from cpbench import storage
from cpbench.formulations import FrictionContact


@pytest.fixture
def contact(tmp_path: Path) -> Path:
    path = tmp_path / "contact.hdf5"
    W = sp.block_diag([sp.csr_array(np.eye(3) + 0.1)] * 40, format="csr")
    storage.save(FrictionContact(W=W, q=-np.ones(120), mu=np.full(40, 0.3)), path)
    return path


def test_what_would_not_fit_is_refused_with_its_size(contact: Path, monkeypatch) -> None:
    free = SimpleNamespace(available=10_000)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: free)
    words = ("convert", contact.name, "lcp.h5", "--to", "lcp", "--via", "inner")
    done = cpbench(contact.parent, *words)
    assert done.returncode == 2
    # 81 entries of W's block and 17 of K, of 12 bytes; 10 rows a contact
    size = f"400 rows, {40 * 98} entries, {(40 * 98 * 12 + 401 * 4) / 1e3:.3g} kB at most"
    assert size in done.stderr
    assert not contact.with_name("lcp.h5").exists()
    free.available = 1_000_000
    assert cpbench(contact.parent, *words).returncode == 0
