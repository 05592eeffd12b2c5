"""Checks of a file format: what it writes comes back bit for bit, whole or not at all."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import Info
from cpbench.foundation import matrices
from cpbench.storage import Format
from cpbench.testing import Case, only_for, refused

INFO = Info(
    title="Würfel",
    description="two\nlines",
    math_info="P-matrix",
    source="a book",
    licence="CC0",
    family="boxes",
    citation="Author 1999",
    properties={"rank": 3, "psd": True, "known": [1.5, 2.0]},
)


def _written(form: Format, cases: list[Case], folder: Path) -> Iterator[tuple[Case, Path]]:
    """Yield the cases the format takes, each in a separate file; what it refuses must be a FormatError."""
    for k, case in enumerate(cases):
        if case.problem.node in form.writes:
            path = folder / f"{k}{form.suffixes[0]}"
            try:
                storage.save(case.problem, path, format=form.name)
            except FormatError:
                assert not path.exists(), f"{case.name}: refused, and yet a file is there"
                continue
            yield case, path


def check_some_case_is_written(form: Format, cases: list[Case]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        assert any(True for _ in _written(form, cases, Path(folder))), "no case is written: nothing else is checked"


def check_round_trip_is_exact(form: Format, cases: list[Case]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for case, path in _written(form, cases, Path(folder)):
            again = storage.load(path, format=form.name)
            assert again.node == case.problem.node, f"{case.name}: comes back as {again.node}"
            for name, value in case.problem.data().items():
                assert _same(again.data()[name], value), f"{case.name}: {name} changed"
            for name, F in case.problem.maps().items():
                assert again.maps()[name] == F, f"{case.name}: {name} changed"


def _same(a: Any, b: Any) -> bool:
    """Return whether equal numbers are in equal places; the signs of zeros too, but for matrices, where a storage may
    drop zeros."""
    signs = a.ndim == 2 or np.array_equal(np.signbit(a), np.signbit(b))
    return signs and matrices.digest(a) == matrices.digest(b)


def check_annotations_are_kept(form: Format, cases: list[Case]) -> None:
    """Name, info and the storage of each matrix come back too, where the format promises to keep provenance."""
    only_for(form.keeps_provenance, "formats that keep provenance")
    noted = [dataclasses.replace(c, problem=dataclasses.replace(c.problem, name="noted", info=INFO)) for c in cases]
    with tempfile.TemporaryDirectory() as folder:
        for case, path in _written(form, noted, Path(folder)):
            again = storage.load(path, format=form.name)
            assert again.name == case.problem.name, f"{case.name}: the name became '{again.name}'"
            for f in dataclasses.fields(Info):
                mine, theirs = getattr(INFO, f.name), getattr(again.info, f.name)
                assert mine == (dict(theirs) if f.name == "properties" else theirs), (
                    f"{case.name}: {f.name} is {theirs}"
                )
            for name, value in case.problem.data().items():
                kept = value.ndim == 1 or matrices.is_sparse(again.data()[name]) == matrices.is_sparse(value)
                assert kept, f"{case.name}: {name} is stored otherwise"


def check_files_are_not_overwritten(form: Format, cases: list[Case]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for case, path in _written(form, cases, Path(folder)):
            before = path.read_bytes()
            with refused(FormatError, "force", f"{case.name}: a name that is taken"):
                storage.save(case.problem, path, format=form.name)
            assert path.read_bytes() == before, f"{case.name}: refused, and yet the file changed"
            storage.save(case.problem, path, format=form.name, force=True)
            left = [p.name for p in path.parent.iterdir() if p.name.startswith(".")]
            assert not left, f"{case.name}: {', '.join(left)} stayed behind"


def check_cut_files_are_refused(form: Format, cases: list[Case]) -> None:
    """Check that half a file is a FormatError, never another problem, and never another exception."""
    with tempfile.TemporaryDirectory() as folder:
        for case, path in _written(form, cases, Path(folder)):
            content = path.read_bytes()
            path.write_bytes(content[: len(content) // 2])
            try:
                again = storage.load(path, format=form.name)
            except FormatError:
                continue
            assert again.fingerprint == case.problem.fingerprint, f"{case.name}: half a file reads as another problem"
