"""A Dask worker as this process knows it, and what travels to it beside its blocks: the terms of the run, and copies
of files that it does not see."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cpbench
from cpbench import frames, storage
from cpbench.bench.block import Block, Ending
from cpbench.bench.planning.plan import Pair
from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError
from cpbench.registry import DECLARED, PLUGIN_FILES, TABLES
from cpbench.storage.base import split_address


@dataclass
class Post:
    """A Dask worker, as it is known here.

    Attributes
    ----------
    identity : of its process, once it has answered. blocks : given to it and not sent. sent : the parts at work,
    each with the block that it is the beginning of. since : when they were sent. suspect : whether they were at work
    when a worker died. copies : whether it does not see our files. files : those it has copies of.
    """

    address: str
    identity: str = ""
    host: str = ""
    future: Any = None
    blocks: list[Block] = field(default_factory=list)
    sent: list[tuple[Block, Block]] = field(default_factory=list)
    since: float = 0.0
    suspect: bool = False
    copies: bool = False
    files: set[str] = field(default_factory=set)

    @property
    def pairs(self) -> list[Pair]:
        """The pairs at work, in their order."""
        return [pair for part, _ in self.sent for pair in part.pairs]

    @property
    def ahead(self) -> int:
        """How many pairs it was given that are not sent."""
        return sum(len(block.pairs) for block in self.blocks)

    def end(self, endings: Mapping[str, Ending]) -> None:
        """Note that some of the pairs at work have ended, by key; what is left of a block whose part is done waits
        again."""
        left = [(part.rest(endings), whole.rest(endings)) for part, whole in self.sent]
        self.blocks = [whole for part, whole in left if part is None and whole is not None] + self.blocks
        self.sent = [(part, whole) for part, whole in left if part is not None and whole is not None]

    def put_back(self) -> None:
        """Let what was at work wait again: nothing is at work any more."""
        self.blocks = [whole for _, whole in self.sent] + self.blocks
        self.sent = []
        self.future = None


class Freight:
    """The files of a task: where each stands here, and the contents of those that go along."""

    def __init__(self, post: Post, wanted: Iterable[str]) -> None:
        self._post, self._wanted = post, {*wanted}
        self.places: dict[str, tuple[str, str]] = {}
        self.names: list[tuple[str, list[str]]] = []
        self.contents: dict[str, bytes] = {}
        self.weight = 0

    def take(self, part: Block) -> None:
        """Take along what the pairs of `part` need and the worker does not have."""
        for pair in (*part.pairs, *part.before.values()):
            if pair.address in self.places:
                continue
            path, member = split_address(pair.address)
            file = os.path.abspath(path)
            self.places[pair.address] = (file, member)
            if file in self._wanted or (self._post.copies and file not in self._post.files):
                self._copy(file, pair)

    def _copy(self, file: str, pair: Pair) -> None:
        try:
            found = [(path.name, path.read_bytes()) for path in storage.files(pair.address, pair.format)]
        except (CpbenchError, OSError):
            found = []  # the row will tell
        self._wanted.discard(file)
        self._post.files.add(file)
        self.contents |= {f"copy {len(self.names)} {name}": content for name, content in found}
        self.names.append((file, [name for name, _ in found]))
        self.weight += sum(len(content) for _, content in found)


def opening(setting: Setting) -> bytes:
    """Return what every station is told first: whose run it is, the limits of its lane, the plugins, the declared
    solvers.

    Files of tables stay here: what they declare is told, with the paths that it has here.
    """
    names = [name for name in os.environ.get(PLUGIN_FILES, "").split(os.pathsep) if name and not name.endswith(TABLES)]
    plugins = {name: Path(name).read_bytes() for name in names}
    anywhere = {k: v for k, v in asdict(setting).items() if k not in ("cpus", "lanes")}
    told = {"cpbench": cpbench.__version__, "setting": anywhere, "plugins": names}
    return frames.pack({**told, "solvers": os.environ.get(DECLARED, "")}, plugins)
