"""A lane far from the client: it runs blocks on the files that this machine has, or on copies that come along."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from cpbench import frames
from cpbench.bench import block as blocks
from cpbench.bench.block import Block
from cpbench.bench.cluster.parcel import pack_outcome, read_blocks
from cpbench.bench.lane import Lane
from cpbench.bench.messages import Declined, Open, Opened
from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Outcome
from cpbench.bench.time_limits import REFEREE

Places = Mapping[str, tuple[str, str]]
"""The absolute path of each address' file on the client's machine, and its member."""


class Outpost:
    """A lane with the files of its problems: those that the client's machine has too, or copies of them."""

    def __init__(self, lane: Lane, folder: Path) -> None:
        self._lane, self._folder = lane, folder
        self._here: dict[str, str] = {}

    def work(self, header: Mapping[str, Any], vectors: Mapping[str, Any]) -> Iterator[bytes]:
        """Outcomes until all blocks are done, the seconds are over, or a file is wanted that is not here.

        The header names the absolute path of every address' file and its member (`places`), and the copies that
        come along (`copies`: the file, and the names of all that belong to it; none where there is nothing to copy).
        """
        for number, (file, names) in enumerate(header["copies"]):
            self._here[file] = self._keep([(n, vectors[f"copy {number} {n}"]) for n in names]) if names else file
        deadline = time.monotonic() + header["seconds"]
        at = 0
        for block in read_blocks(header, vectors):
            missing = self._missing(block, header["places"])
            if missing:
                yield frames.pack({"event": "wanted", "files": missing})
                return
            for k, (_, outcome) in enumerate(blocks.run(self._lane, self._placed(block, header["places"]))):
                yield pack_outcome(at + k, self._told(block.pairs[k], outcome, header["places"]))
                following = block.pairs[k + 1 : k + 2]
                derived = bool(following) and blocks.variant(following[0]) == blocks.variant(block.pairs[k])
                if time.monotonic() > deadline and not derived:
                    return
            at += len(block.pairs)

    def _missing(self, block: Block, places: Places) -> list[str]:
        """Return files that are not here, or hold something else than was planned."""
        wanted: list[str] = []
        for pair in (*block.pairs, *block.before.values()):
            file, member = places[pair.address]
            if file not in self._here:
                asked = Open(_address(file, member), pair.format, pair.fingerprint)
                reply = self._lane.referee.ask(REFEREE.limit(pair.limits.seconds), asked, Opened)
                if not isinstance(reply, Declined):
                    self._here[file] = file
                elif file not in wanted:
                    wanted.append(file)
        return wanted

    def _keep(self, contents: list[tuple[str, bytes]]) -> str:
        """Write the files that belong together into a folder of their own; where the first one is."""
        folder = Path(tempfile.mkdtemp(dir=self._folder))
        for name, content in contents:
            (folder / name).write_bytes(content)
        return str(folder / contents[0][0])

    def _placed(self, block: Block, places: Places) -> Block:
        """Return the block with the addresses its problems have here."""

        def placed(pair: Pair) -> Pair:
            file, member = places[pair.address]
            return replace(pair, address=_address(self._here[file], member))

        before = {key: placed(pair) for key, pair in block.before.items()}
        return Block(tuple(map(placed, block.pairs)), before, block.known)

    def _told(self, pair: Pair, outcome: Outcome, places: Places) -> Outcome:
        """Return the outcome with the client's address in what is said of the file."""
        message = outcome.message or ""
        file, member = places[pair.address]
        local = self._here[file]
        if local not in message:
            return outcome
        planned = pair.address.removesuffix(f"::{member}") if member else pair.address
        return outcome.changed(message=message.replace(local, planned))


def _address(file: str, member: str) -> str:
    return f"{file}::{member}" if member else file
