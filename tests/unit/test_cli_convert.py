"""`cpbench convert` writes every format that can be written, and refuses what would not fit into memory."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import scipy.sparse as sp
from command_line import cpbench
from storage_cases import cases

from cpbench import storage
from cpbench.formulations import FrictionContact

CASES = cases()


@pytest.mark.parametrize(
    ("name", "out", "options"),
    [
        ("fcm3-sparse-5-2", "out.hdf5", ("--as", "fclib")),
        ("gfc2-dense-5-2", "out.hdf5", ()),
        ("grfc5-dense-5-2", "out.h5", ("--as", "fclib")),
        ("grfc3-sparse-1-0", "out.dat", ()),
        ("rfc5-dense-5", "out.dat", ()),
        ("rfc3-dense-5", "out.dat", ()),
        ("rfc3-dense-5", "rolling.txt", ("--as", "siconos-rfc2d")),
        ("relay-dense-7", "out.dat", ()),
        ("soclcp-dense-second", "out.dat", ()),
        ("afc-dense-5", "out.h5", ("--as", "native")),
    ],
)
def test_written(name: str, out: str, options: tuple[str, ...], tmp_path: Path) -> None:
    problem, target = CASES[name], tmp_path / out
    storage.save(problem, tmp_path / "in.h5")
    assert cpbench(tmp_path, "convert", "in.h5", out, "--to", problem.node, *options).returncode == 0
    again = storage.load(target, format=options[1] if target.suffix == ".txt" else None)
    assert (again.node, again.fingerprint) == (problem.node, problem.fingerprint)


@pytest.mark.parametrize(
    ("name", "out", "options", "reason"),
    [
        ("afc-dense-5", "out.h5", ("--as", "fclib"), "FCLIB has one coefficient of friction a contact"),
        ("rfc5-dense-5", "out.h5", ("--as", "fclib"), "FCLIB has rolling friction in global form alone"),
        ("gfc2-dense-5-2", "out.dat", (), "has 2 bilateral constraints: Siconos text has no place for them"),
        ("avi-dense-set-7", "out.dat", (), "has a set X: Siconos text has no place for it"),
        ("relay-dense-7", "out.dat", ("--as", "siconos-lpc"), "unknown format 'siconos-lpc': did you mean siconos-lcp"),
    ],
)
def test_refused(name: str, out: str, options: tuple[str, ...], reason: str, tmp_path: Path) -> None:
    problem = CASES[name]
    storage.save(problem, tmp_path / "in.h5")
    done = cpbench(tmp_path, "convert", "in.h5", out, "--to", problem.node, *options)
    assert (done.returncode, reason in done.stderr) == (2, True), done.stderr
    assert not (tmp_path / out).exists()


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
