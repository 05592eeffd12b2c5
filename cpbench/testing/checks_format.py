"""Checks of a file format: what it writes comes back bit for bit, whole or not at all."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from cpbench import matrices, storage
from cpbench.errors import FormatError
from cpbench.storage import Format
from cpbench.testing.cases import Case


def _written(form: Format, cases: list[Case], folder: Path) -> Iterator[tuple[Case, Path]]:
    """The cases the format takes, each in a file of its own; what it refuses must be a FormatError."""
    for k, case in enumerate(cases):
        if case.problem.node in form.writes:
            path = folder / f"{k}{form.suffixes[0]}"
            try:
                storage.save(case.problem, path, format=form.name)
            except FormatError:
                assert not path.exists(), f"{case.name}: refused, and yet a file is there"
                continue
            yield case, path


def check_round_trip_is_exact(form: Format, cases: list[Case]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for case, path in _written(form, cases, Path(folder)):
            again = storage.load(path, format=form.name)
            assert again.node == case.problem.node, case.name
            for name, value in case.problem.data().items():
                assert matrices.digest(again.data()[name]) == matrices.digest(value), f"{case.name}: {name} changed"


def check_files_are_not_overwritten(form: Format, cases: list[Case]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for case, path in _written(form, cases, Path(folder)):
            before = path.read_bytes()
            with pytest.raises(FormatError, match="force"):
                storage.save(case.problem, path, format=form.name)
            assert path.read_bytes() == before
            storage.save(case.problem, path, format=form.name, force=True)
            assert [p.name for p in path.parent.iterdir() if p.name.startswith(".")] == []


def check_cut_files_are_refused(form: Format, cases: list[Case]) -> None:
    """Half a file is a FormatError, never another problem, and never another exception."""
    with tempfile.TemporaryDirectory() as folder:
        for case, path in _written(form, cases, Path(folder)):
            content = path.read_bytes()
            path.write_bytes(content[: len(content) // 2])
            try:
                again = storage.load(path, format=form.name)
            except FormatError:
                continue
            assert again.fingerprint == case.problem.fingerprint, f"{case.name}: half a file reads as another problem"
