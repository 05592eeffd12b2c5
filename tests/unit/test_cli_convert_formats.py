"""`cpbench convert` writes every format that can be written: by the suffix of OUT, or by --as."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import cpbench
from storage_cases import cases

from cpbench import storage

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
