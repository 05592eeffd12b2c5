"""A block is what one slot runs in one go: all pairs of a problem, or all steps of a sequence.

The word is that of experimental design: runs in random order within blocks, so that a drift of the machine meets all
solvers of a problem alike. A block is data: it runs on any slot, here, in a thread beside others, or elsewhere.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from cpbench.bench.events import EventHandler, Solving, ignore_event
from cpbench.bench.messages import Prepared
from cpbench.bench.planning.plan import Limits, Pair
from cpbench.bench.results.rows import Outcome
from cpbench.bench.slot import Slot

Ending: TypeAlias = tuple[str, bytes | None]
"""Status and kept answer of a row."""


@dataclass(frozen=True)
class Block:
    """Pairs in the order in which they are run.

    Attributes
    ----------
    before : the pair from whose answer a pair starts, by the key of the latter.
    known : status and answer of such pairs that are not part of the block, because they were run earlier.
    """

    pairs: tuple[Pair, ...]
    before: Mapping[str, Pair] = field(default_factory=dict)
    known: Mapping[str, Ending] = field(default_factory=dict)

    @property
    def limits(self) -> dict[str, Limits]:
        """Limits of each solver, those of its first pair."""
        return {pair.entry.solver: pair.limits for pair in reversed(self.pairs)}

    @property
    def chained(self) -> bool:
        """Return whether its pairs start from one another, so that they cannot be run apart."""
        return any(pair.scene for pair in self.pairs)

    def rest(self, endings: Mapping[str, Ending]) -> Block | None:
        """Return the block without pairs that have ended, given by key; None when all have."""
        left = tuple(pair for pair in self.pairs if pair.key not in endings)
        return self._only(left, {**self.known, **endings}) if left else None

    def cut(self, count: int) -> tuple[Block, Block | None]:
        """Split it after `count` pairs, at least one.

        Of a chained block the second part cannot be run before the first has ended (`rest`).
        """
        count = max(count, 1)
        first, others = self.pairs[:count], self.pairs[count:]
        return self._only(first, self.known), self._only(others, self.known) if others else None

    def _only(self, pairs: tuple[Pair, ...], endings: Mapping[str, Ending]) -> Block:
        keys = {pair.key for pair in pairs}
        before = {key: pair for key, pair in self.before.items() if key in keys}
        wanted = {pair.key for pair in before.values()} - keys
        return Block(pairs, before, {key: endings[key] for key in wanted if key in endings})


def blocks(planned: Sequence[Pair], pending: set[str], seed: int, ending: Callable[[str], Ending]) -> list[Block]:
    """Return the pending pairs in blocks, in a seeded random order that does not depend on the order of the files.

    Problems are shuffled, and the solvers within each: a drift of the machine then touches all solvers of a problem
    alike, and every conversion is done once. With the start policy `previous` sequences are shuffled, not their
    steps.

    ending : returns status and answer of a row that is not pending.
    """
    draw = random.Random(seed)
    grouped: dict[str, list[Pair]] = {}
    # by key first: the shuffles below then depend on the seed alone
    for pair in sorted(planned, key=lambda p: p.key):
        grouped.setdefault(block_name(pair), []).append(pair)
    names = sorted(grouped)
    draw.shuffle(names)
    listed: list[Block] = []
    for name in names:
        members = grouped[name]
        draw.shuffle(members)
        members.sort(key=lambda p: p.step if p.scene else 0)
        todo = tuple(p for p in members if p.key in pending)
        if todo:
            keys = {p.key for p in todo}
            before = {key: pair for key, pair in predecessors(members).items() if key in keys}
            endings = {p.key: ending(p.key) for p in before.values() if p.key not in keys}
            listed.append(Block(todo, before, endings))
    return listed


def block_name(pair: Pair) -> str:
    """Return the name of the block that a pair belongs to."""
    return f"sequence {pair.scene}" if pair.scene else f"problem {pair.address} {pair.format or ''}"


def run(slot: Slot, block: Block, on_event: EventHandler = ignore_event) -> Iterator[tuple[Pair, Outcome]]:
    """Yield the outcome of every pair of the block in turn, when all workers have started."""
    slot.start(block.limits, on_event)
    prepared: dict[tuple[str, str, float, float], Prepared | Outcome] = {}
    endings: dict[str, Ending] = dict(block.known)
    held: tuple[str, str | None] = ("", None)
    for pair in block.pairs:
        if (pair.address, pair.format) != held:  # the referee holds one problem
            held, prepared = (pair.address, pair.format), {}
        where = (pair.request.name, pair.target, pair.tolerance, pair.limits.seconds)
        if where not in prepared:
            prepared[where] = slot.prepare(pair)
        on_event(Solving(pair))  # after the conversion, which belongs to no solver
        before = block.before.get(pair.key)
        outcome = slot.run(pair, prepared[where], before and (before, *endings[before.key]))
        endings[pair.key] = (outcome.status, outcome.answer)
        yield pair, outcome


def predecessors(members: Sequence[Pair]) -> dict[str, Pair]:
    """Return, by key, the pair of the preceding step with the same solver, options, request and tolerance.

    members : sorted by step.
    """
    last: dict[tuple[Any, ...], Pair] = {}
    result: dict[str, Pair] = {}
    for pair in members:
        if pair.scene is None:
            continue
        track = (pair.scene, pair.label, pair.tolerance, pair.measure)
        if track in last and last[track].step < pair.step:
            result[pair.key] = last[track]
        last[track] = pair
    return result
