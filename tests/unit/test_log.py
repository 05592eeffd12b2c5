"""What is kept of a child's output."""

from __future__ import annotations

from pathlib import Path

import pytest

from cpbench.bench import log as log_module
from cpbench.bench.log import PART, Log


def _print(log: Log, text: str) -> None:
    with open(log.path, "a") as out:
        out.write(text)


@pytest.mark.parametrize("size", [0, 1, PART, PART + 1, 2 * PART])
def test_short_output_is_whole(tmp_path: Path, size: int) -> None:
    log = Log(tmp_path)
    text = "".join(str(i % 10) for i in range(size))
    _print(log, text)
    assert log.take() == text
    assert log.take() == ""
    log.close()


def test_of_long_output_both_ends_are_kept(tmp_path: Path) -> None:
    log = Log(tmp_path)
    _print(log, "begin" + "x" * 5000 + "end")
    text = log.take()
    assert text.startswith("beginx")
    assert text.endswith("xend")
    assert f"[... {5008 - 2 * PART} bytes ...]" in text
    log.close()


def test_the_file_is_emptied_when_it_grows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was cut in several steps reads as if it had been cut in one."""
    monkeypatch.setattr(log_module, "ROOM", 100)
    log = Log(tmp_path)
    text = "".join(f"{i:04d}" for i in range(1000))
    for at in range(0, len(text), 250):
        _print(log, text[at : at + 250])
        log.trim()
        assert Path(log.path).stat().st_size == 0
    assert log.take() == f"{text[:PART]}\n[... {len(text) - 2 * PART} bytes ...]\n{text[-PART:]}"
    log.close()


def test_closing_removes_the_file_once(tmp_path: Path) -> None:
    log = Log(tmp_path)
    _print(log, "words")
    log.close()
    log.close()
    log.trim()
    assert log.take() == ""
    assert list(tmp_path.iterdir()) == []
