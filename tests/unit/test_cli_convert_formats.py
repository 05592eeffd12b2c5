"""`cpbench convert` writes every format that can be written: by the suffix of OUT, or by --as."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from storage_cases import cases

from cpbench import storage
from cpbench.cli import main

CASES = cases()


def convert(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["cpbench", "convert", *map(str, arguments)])
    try:
        main()
    except SystemExit as done:
        return int(done.code or 0)
    return 0


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
def test_written(
    name: str, out: str, options: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, target = CASES[name], tmp_path / out
    storage.save(problem, tmp_path / "in.h5")
    assert convert(monkeypatch, tmp_path / "in.h5", target, "--to", problem.node, *options) == 0
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
def test_refused(
    name: str,
    out: str,
    options: tuple[str, ...],
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    problem = CASES[name]
    storage.save(problem, tmp_path / "in.h5")
    assert convert(monkeypatch, tmp_path / "in.h5", tmp_path / out, "--to", problem.node, *options) == 2
    assert reason in capsys.readouterr().err
    assert not (tmp_path / out).exists()
