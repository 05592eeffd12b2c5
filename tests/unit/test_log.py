"""What is kept of a child's output."""

from __future__ import annotations

import multiprocessing as mp
import os
import time

import pytest

from cpbench.bench.processes.log import PART, Log


def _log() -> Log:
    return Log(mp.get_context("spawn"))


def _print(log: Log, text: str) -> None:
    os.write(log.writer.fileno(), text.encode())


@pytest.mark.parametrize("size", [0, 1, PART, PART + 1, 2 * PART])
def test_short_output_is_whole(size: int) -> None:
    log = _log()
    text = "".join(str(i % 10) for i in range(size))
    _print(log, text)
    assert log.take() == text
    assert log.take() == ""
    log.close()


def test_of_long_output_both_ends_are_kept() -> None:
    log = _log()
    _print(log, "begin" + "x" * 5000 + "end")
    text = log.take()
    assert text.startswith("beginx")
    assert text.endswith("xend")
    assert f"[... {5008 - 2 * PART} bytes ...]" in text
    log.close()


def test_what_comes_in_pieces_reads_as_one() -> None:
    log = _log()
    text = "".join(f"{i:04d}" for i in range(1000))
    for at in range(0, len(text), 250):
        _print(log, text[at : at + 250])
        time.sleep(0.001)
    assert log.take() == f"{text[:PART]}\n[... {len(text) - 2 * PART} bytes ...]\n{text[-PART:]}"
    log.close()


def test_closing_twice_and_late_words() -> None:
    log = _log()
    _print(log, "words")
    log.close()
    log.close()
    assert log.take() in ("", "words")
    log.started()
