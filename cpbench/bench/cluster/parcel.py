"""Blocks on their way to another machine, and outcomes on their way back: frames, nothing is pickled."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

from cpbench import frames
from cpbench.bench.block import Block, Ending
from cpbench.bench.planning.plan import Entry, Limits, Pair, Request
from cpbench.bench.results.rows import Outcome


def pack_blocks(todo: Sequence[Block], vectors: Mapping[str, Any] | None = None, **header: Any) -> bytes:
    """Blocks with what else the receiver needs; the answers that a next step starts from travel as vectors."""
    answers: dict[str, Any] = {}
    packed: list[dict[str, Any]] = []
    for block in todo:
        answers |= {f"known {key}": answer for key, (_, answer) in block.known.items() if answer is not None}
        packed.append(
            {
                "pairs": [_pair_header(pair) for pair in block.pairs],
                "before": {key: _pair_header(pair) for key, pair in block.before.items()},
                "known": {key: status for key, (status, _) in block.known.items()},
            }
        )
    return frames.pack({**header, "blocks": packed}, {**answers, **(vectors or {})})


def read_blocks(header: Mapping[str, Any], vectors: Mapping[str, Any]) -> Iterator[Block]:
    """Yield the blocks of a message."""
    for packed in header["blocks"]:
        known: dict[str, Ending] = {
            key: (status, vectors.get(f"known {key}")) for key, status in packed["known"].items()
        }
        before = {key: _pair(pair) for key, pair in packed["before"].items()}
        yield Block(tuple(map(_pair, packed["pairs"])), before, known)


def pack_outcome(at: int, outcome: Outcome) -> bytes:
    """Return the outcome of the pair that is number `at` in the blocks that were sent."""
    row = dict(vars(outcome))
    kept = {name: row.pop(name) for name in _KEPT}
    return frames.pack({"event": "outcome", "at": at, "row": row}, {k: v for k, v in kept.items() if v is not None})


def read_outcome(header: Mapping[str, Any], vectors: Mapping[str, Any]) -> Outcome:
    """Return the outcome of a message."""
    return Outcome(**header["row"], **vectors)


_KEPT = ("answer", "history", "proof")
"""What of an outcome travels as bytes."""


def _pair_header(pair: Pair) -> dict[str, Any]:
    """Return its fields, without what cached properties keep."""
    return asdict(replace(pair, sizes=dict(pair.sizes), entry=Entry(pair.entry.solver, dict(pair.entry.options))))


def _pair(header: Mapping[str, Any]) -> Pair:
    asked = header["request"]
    request = Request(
        asked["name"],
        tuple(asked["kinds"]),
        tuple((name, knobs) for name, knobs in asked["via"]),
        tuple(asked["nodes"]),
    )
    parts: dict[str, Any] = {
        "request": request,
        "entry": Entry(**header["entry"]),
        "limits": Limits(**header["limits"]),
    }
    return Pair(**{**header, **parts})
