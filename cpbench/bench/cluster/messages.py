"""Messages between the client of a cluster and its remote workers."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import field, replace
from typing import Any

from cpbench import storage
from cpbench.bench.block import Block
from cpbench.bench.messages import Message, Vectors
from cpbench.bench.planning.plan import Entry, Pair
from cpbench.bench.results.rows import Outcome
from cpbench.errors import CpbenchError
from cpbench.storage.base import split_address

Files = Mapping[str, tuple[str, str]]
"""The absolute path, on the client's machine, of each address' file, and its member."""
BYTES = ("answer", "history", "proof")
"""Fields of an outcome that travel as bytes."""


class RunBlock(Message):
    """Asks for the outcomes of a block's pairs, of as many as can be run within `seconds`, one at least.

    `before`, `known` : as of `Block`, the latter as statuses; `vectors` have the answers.
    """

    pairs: tuple[Pair, ...]
    before: Mapping[str, Pair]
    known: Mapping[str, str]
    files: Files
    seconds: float
    vectors: Vectors = field(default_factory=dict[str, Any])

    @staticmethod
    def of(block: Block, seconds: float) -> RunBlock:
        """Return the request for the pairs of a block."""
        pairs = (*block.pairs, *block.before.values())
        return RunBlock(
            tuple(map(_plain, block.pairs)),
            {key: _plain(pair) for key, pair in block.before.items()},
            {key: status for key, (status, _) in block.known.items()},
            {pair.address: file_of(pair) for pair in pairs},
            seconds,
            {key: answer for key, (_, answer) in block.known.items() if answer is not None},
        )

    @property
    def block(self) -> Block:
        """The block that is asked for."""
        known = {key: (status, self.vectors.get(key)) for key, status in self.known.items()}
        return Block(self.pairs, self.before, known)


class FileCopies(Message):
    """Brings a file of the client, and those that belong to it, as `vectors` by name, the one asked for first; none
    where the client cannot read it either."""

    file: str
    vectors: Vectors

    @staticmethod
    def of(pair: Pair) -> FileCopies:
        """Return copies of all files that a pair's problem is read from."""
        try:
            found = {path.name: path.read_bytes() for path in storage.files(pair.address, pair.format)}
        except (CpbenchError, OSError):
            found = {}  # the row will say why
        return FileCopies(file_of(pair)[0], found)


class PairEnded(Message):
    """Brings the outcome of a block's pair, by its place in the block."""

    place: int
    row: Mapping[str, Any]
    vectors: Vectors = field(default_factory=dict[str, Any])

    @staticmethod
    def of(place: int, outcome: Outcome) -> PairEnded:
        """Return the message of an outcome."""
        row = dict(vars(outcome))
        kept = {name: row.pop(name) for name in BYTES}
        return PairEnded(place, row, {name: value for name, value in kept.items() if value is not None})

    @property
    def outcome(self) -> Outcome:
        """The outcome of the pair."""
        return Outcome(**self.row, **self.vectors)


class FilesWanted(Message):
    """Says which files are not on this machine, or hold something else than was planned."""

    files: tuple[str, ...]


def file_of(pair: Pair) -> tuple[str, str]:
    """Return the absolute path of the file of a pair's problem, and its member."""
    path, member = split_address(pair.address)
    return os.path.abspath(path), member


def _plain(pair: Pair) -> Pair:
    """Return a pair as plain data, without what its cached properties keep."""
    return replace(pair, sizes=dict(pair.sizes), entry=Entry(pair.entry.solver, dict(pair.entry.options)))
