"""Messages between runner and child, whatever the child sends."""

from __future__ import annotations

import json
import multiprocessing as mp
import os
import struct
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from cpbench.bench.processes import channel
from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.process import PART, Log
from cpbench.bench.results.rows import Outcome
from cpbench.foundation import frames
from cpbench.foundation.frames import FrameError

HEAD = "<4sIQ"


@pytest.fixture
def ends() -> Iterator[tuple[Channel, Channel]]:
    ours, theirs = channel.pair()
    child = Channel(theirs)
    yield ours, child
    ours.close()
    child.close()


def _next(ours: Channel) -> bytes:
    deadline = time.monotonic() + 10.0
    while (message := ours.receive_nowait()) is None:
        assert time.monotonic() < deadline
    return message


@pytest.mark.parametrize("size", [0, 1, 4096, 5_000_000])
def test_there_and_back(ends: tuple[Channel, Channel], size: int) -> None:
    ours, child = ends
    message = os.urandom(size)
    echo = threading.Thread(target=lambda: child.send_bytes(child.recv_bytes()))
    echo.start()
    ours.send(message, 10.0)
    assert _next(ours) == message
    echo.join()


def test_several_at_once_stay_apart(ends: tuple[Channel, Channel]) -> None:
    ours, child = ends
    for k in range(5):
        child.send_bytes(bytes([k]) * k)
    assert [_next(ours) for _ in range(5)] == [bytes([k]) * k for k in range(5)]
    assert ours.receive_nowait() is None


def test_half_a_message_is_waited_for(ends: tuple[Channel, Channel]) -> None:
    ours, child = ends
    whole = struct.pack(HEAD, b"cpb1", 0, 10) + b"0123456789"
    for part in (whole[:3], whole[3:18], whole[18:-1]):
        child._socket.sendall(part)
        assert ours.receive_nowait() is None
    child._socket.sendall(whole[-1:])
    assert _next(ours) == b"0123456789"


def test_answers_to_an_earlier_request_are_dropped(ends: tuple[Channel, Channel]) -> None:
    """What a solve left to be said must not be taken for the next one's answer."""
    ours, child = ends
    ours.send(b"first", 1.0)
    child.recv_bytes()
    child.send_bytes(b"answer")
    child.send_bytes(b"afterthought")
    assert _next(ours) == b"answer"
    ours.send(b"second", 1.0)
    child.recv_bytes()
    child.send_bytes(b"other answer")
    assert _next(ours) == b"other answer"


@pytest.mark.parametrize(
    ("sent", "told"),
    [
        (b"printed into the wrong descriptor", "it begins with b'printed into the'"),
        (struct.pack(HEAD, b"cpb1", 0, 2**60), "1152921504606846976 bytes, over the limit"),
    ],
    ids=["text", "length"],
)
def test_what_is_no_message_is_refused(ends: tuple[Channel, Channel], sent: bytes, told: str) -> None:
    ours, child = ends
    child._socket.sendall(sent)
    with pytest.raises(FrameError, match=told):
        ours.receive_nowait()


def test_no_memory_is_taken_for_what_is_only_announced() -> None:
    import tracemalloc

    ours, theirs = channel.pair()
    theirs.sendall(struct.pack(HEAD, b"cpb1", 0, 2**29) + b"x" * 1000)
    tracemalloc.start()
    assert ours.receive_nowait() is None
    assert tracemalloc.get_traced_memory()[1] < 2**22
    tracemalloc.stop()
    ours.close()
    theirs.close()


def test_a_closed_channel_ends_in_errors(ends: tuple[Channel, Channel]) -> None:
    ours, child = ends
    child.send_bytes(b"last")
    child.close()
    assert _next(ours) == b"last"
    with pytest.raises(EOFError):
        ours.receive_nowait()
    with pytest.raises(OSError, match=r"[Bb]roken pipe"):
        ours.send(b"hello", 1.0)


def test_a_child_sees_the_runner_go(ends: tuple[Channel, Channel]) -> None:
    ours, child = ends
    ours.close()
    with pytest.raises(EOFError):
        child.recv_bytes()


def test_a_peer_that_does_not_read_is_not_waited_for(ends: tuple[Channel, Channel]) -> None:
    ours, _ = ends
    begun = time.monotonic()
    with pytest.raises(TimeoutError):
        ours.send(b"x" * 10_000_000, 0.2)
    assert 0.1 < time.monotonic() - begun < 5.0


@pytest.mark.parametrize("aligned", [1, 8, 64])
def test_arrays_of_all_types_begin_where_they_should(aligned: int) -> None:
    arrays = {kind: np.arange(n, n + 3).astype(kind) for n, kind in enumerate(sorted(frames.NUMBERS))}
    data = b"".join(frames.parts({"k": 1}, {**arrays, "bytes": b"abc", "none": np.zeros(0)}, aligned))
    header, read = frames.unpack(data, types=frames.NUMBERS, aligned=aligned)
    assert header == {"k": 1}
    for kind, array in arrays.items():
        assert read[kind].dtype == array.dtype
        assert read[kind].tolist() == array.tolist()
        begin = read[kind].__array_interface__["data"][0] - np.frombuffer(data, np.uint8).__array_interface__["data"][0]
        assert begin % aligned == 0
    assert read["bytes"] == b"abc"
    assert read["none"].size == 0


@pytest.mark.parametrize("kind", ["<i8", "|O", "<U4", "nonsense", 7, ["<f8"]])
def test_types_that_are_not_allowed_are_refused(kind: object) -> None:
    head = json.dumps({"vectors": [["x", 8, kind]]}).encode()
    with pytest.raises(FrameError):
        frames.unpack(struct.pack("<I", len(head)) + head + bytes(8))


def test_a_reader_without_nan_gets_none() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        frames.parts({"x": float("nan")}, {}, finite=True)
    assert np.isnan(frames.unpack(frames.pack({"x": float("nan")}))[0]["x"])
    assert frames.unpack(frames.pack({"row": Outcome(status="\udcff")}))[0]["row"]["status"] == "\udcff"


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
