"""`cpbench convert --memory`: large conversions are announced, and refused where they would not fit."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench import storage
from cpbench.cli import main, progress
from cpbench.formulations import FrictionContact


@pytest.fixture
def contact(tmp_path: Path) -> Path:
    path = tmp_path / "contact.hdf5"
    W = sp.block_diag([sp.csr_array(np.eye(3) + 0.1)] * 40, format="csr")
    storage.save(FrictionContact(W=W, q=-np.ones(120), mu=np.full(40, 0.3)), path)
    return path


def convert(monkeypatch: pytest.MonkeyPatch, contact: Path, *options: str) -> int:
    out = contact.with_name("lcp.h5")
    arguments = ["cpbench", "convert", str(contact), str(out), "--to", "lcp", "--via", "inner", *options]
    monkeypatch.setattr(sys, "argv", arguments)
    try:
        main()
    except SystemExit as leave:
        return int(leave.code or 0)
    return 0


def test_what_would_not_fit_is_refused_with_its_size(contact: Path, monkeypatch, capsys) -> None:
    assert convert(monkeypatch, contact, "--memory", "10K") == 2
    # 81 entries of W's block and 17 of K, of 12 bytes; 10 rows a contact
    size = f"400 rows, {40 * 98} entries, {(40 * 98 * 12 + 401 * 4) / 1e3:.3g} kB at most"
    said = capsys.readouterr().err
    assert size in said
    assert "--memory" in said
    assert not contact.with_name("lcp.h5").exists()


@pytest.mark.parametrize("options", [(), ("--memory", "1M"), ("--memory", "0")])
def test_what_fits_is_converted(contact: Path, monkeypatch, capsys, options: tuple[str, ...]) -> None:
    assert convert(monkeypatch, contact, *options) == 0
    assert capsys.readouterr().err == ""


def test_a_large_conversion_is_announced(contact: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(progress, "LARGE", 1)
    assert convert(monkeypatch, contact) == 0
    said = capsys.readouterr()
    assert said.err.startswith("fc-lcp-inner: 400 rows")
    assert "at most" not in said.out
