"""Figures drawn by other processes: the same files, whatever becomes of these."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from synthetic_results import looks_of, suite

from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import Profile, performance_profile
from cpbench.report import easel as easel_module
from cpbench.report import figures
from cpbench.report.easel import Easel

LOOKS = looks_of(suite(problems=6, labels=4)["label"])
FEW = 1
"""Figures up to which the easels here start no process."""
NAMES = [f"figure-{k}" for k in range(FEW + 1)]


@pytest.fixture(scope="module")
def profile() -> Profile:
    return performance_profile(rows_of.times(rows_of.normalised(suite(problems=6, labels=4))))


def drawn(folder: Path, profile: Profile, processes: int, names: list[str] = NAMES) -> dict[str, bytes]:
    """The files of so many figures, each with its own title."""
    folder.mkdir()
    with Easel(folder, processes, FEW) as easel:
        for name in names:
            easel.draw(name, figures.profile_figure, profile, name, {}, LOOKS)
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def here(profile: Profile, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return drawn(tmp_path_factory.mktemp("here") / "a", profile, 1)


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """The processes that a test starts."""
    found: list[subprocess.Popen[bytes]] = []
    start = easel_module._started

    def noted() -> Any:
        found.append(process := start())
        return process

    monkeypatch.setattr(easel_module, "_started", noted)
    return found


def test_the_files_are_the_same_bytes(tmp_path: Path, profile: Profile, here: dict[str, bytes], started: Any) -> None:
    assert len(here) == 3 * len(NAMES)
    assert drawn(tmp_path / "b", profile, 2) == here
    assert {process.returncode for process in started} == {0}
    assert len(started) <= 2


@pytest.mark.nightly
def test_few_figures_start_no_process(tmp_path: Path, profile: Profile, here: dict[str, bytes], started: Any) -> None:
    few = drawn(tmp_path / "b", profile, 2, NAMES[:FEW])
    assert few.items() < here.items()
    assert not started


@pytest.mark.nightly
def test_what_a_killed_process_left_is_drawn(
    tmp_path: Path, profile: Profile, here: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    start = easel_module._started

    def dying() -> Any:
        process = start()
        assert process is not None
        os.kill(process.pid, signal.SIGKILL)
        return process

    monkeypatch.setattr(easel_module, "_started", dying)
    assert drawn(tmp_path / "b", profile, 2) == here


@pytest.mark.nightly
def test_where_no_process_starts_all_is_drawn(
    tmp_path: Path, profile: Profile, here: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.executable", str(tmp_path / "absent"))
    assert drawn(tmp_path / "b", profile, 2) == here


@pytest.mark.nightly
def test_what_cannot_be_handed_over_is_drawn(tmp_path: Path, profile: Profile, here: dict[str, bytes]) -> None:
    folder = tmp_path / "b"
    folder.mkdir()
    with Easel(folder, 2, FEW) as easel:
        for name in NAMES:
            easel.draw(name, lambda title: figures.profile_figure(profile, title, {}, LOOKS), name)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == here


@pytest.mark.nightly
def test_an_error_of_a_figure_is_raised(tmp_path: Path, profile: Profile) -> None:
    def draw_nothing() -> None:
        with Easel(tmp_path, 2, FEW) as easel:
            for name in NAMES:
                easel.draw(name, figures.profile_figure, profile, name, {}, LOOKS)
            easel.draw("none", figures.profile_figure, None, "no profile", {}, LOOKS)

    with pytest.raises(AttributeError, match="curves"):
        draw_nothing()


def test_an_error_elsewhere_ends_the_processes(tmp_path: Path, profile: Profile, started: Any) -> None:
    def fail() -> None:
        with Easel(tmp_path, 2, FEW) as easel:
            for name in NAMES:
                easel.draw(name, figures.profile_figure, profile, name, {}, LOOKS)
            raise KeyError("a section")

    with pytest.raises(KeyError):
        fail()
    assert started
    assert all(process.returncode is not None for process in started)
