"""What no worker has done yet, and in tasks of which size it is given out.

A task is to take about `TASK` seconds, by what pairs have taken so far. Towards the end tasks become smaller and those
who have nothing left relieve those who have most, so that all workers end together.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterable, Iterator

from cpbench.bench.block import Block
from cpbench.bench.cluster.post import Post

TASK = 2.0
"""Seconds after which a task ends and what is left of it comes back: one that is lost costs little, and those who
come late find work."""
GUESS, MEMORY = 0.1, 0.3
"""Seconds a pair may take, before any did; and how much the last task counts in what is expected of the next."""
MOST = 1000
"""Pairs of one task, however short they are."""


class Backlog:
    """The blocks that no worker has, in order: those that are suspect wait behind all others, each to be run alone."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Block, bool]] = deque()
        self._mean = GUESS

    def add(self, blocks: Iterable[Block]) -> None:
        self._waiting.extend((block, False) for block in blocks)

    def set_apart(self, block: Block) -> None:
        """Let each pair of a suspect block run alone, or all of it where they start from one another."""
        rest: Block | None = block
        while rest is not None:
            alone, rest = (rest, None) if rest.chained else rest.cut(1)
            self._waiting.append((alone, True))

    def take_back(self, post: Post) -> None:
        """Give what a worker was given and has not begun to others, before all else."""
        self._waiting.extendleft((block, post.suspect) for block in reversed(post.blocks))
        post.blocks = []

    def learn(self, seconds: float, pairs: int) -> None:
        """So many pairs took so long."""
        self._mean += MEMORY * (seconds / pairs - self._mean)

    def give(self, post: Post, posts: Collection[Post]) -> bool:
        """Give an idle worker the next block unless it has one, else what another has before it; whether it has any."""
        if not post.blocks:
            post.suspect = bool(self._waiting) and self._waiting[0][1]
            post.blocks = [self._waiting.popleft()[0]] if self._waiting else self._relieve(posts)
        return bool(post.blocks)

    def task(self, post: Post, posts: Collection[Post]) -> Iterator[Block]:
        """Yield the parts of the worker's next task, one by one; each is among those sent when it comes."""
        quota = 1 if post.suspect else self._quota(post, len(posts))
        count = 0
        while count < quota:
            if not post.blocks and not post.suspect and self._waiting and not self._waiting[0][1]:
                post.blocks = [self._waiting.popleft()[0]]
            if not post.blocks:
                return
            block = post.blocks.pop(0)
            part, others = block.cut(quota - count)
            post.sent.append((part, block if block.chained else part))
            if others is not None and not block.chained:
                post.blocks.insert(0, others)
            count += len(part.pairs)
            yield part

    def _quota(self, post: Post, workers: int) -> int:
        """Return pairs of the next task."""
        waiting = sum(len(block.pairs) for block, _ in self._waiting) + post.ahead
        share = math.ceil(waiting / (2 * workers))
        return max(1, min(MOST, int(TASK / self._mean), share))

    def _relieve(self, posts: Iterable[Post]) -> list[Block]:
        """Half of what the worker with the most before it has not begun."""
        busiest = max(posts, key=lambda post: post.ahead)
        if busiest.suspect or busiest.ahead * self._mean < TASK:
            return []
        if len(busiest.blocks) > 1:
            half = len(busiest.blocks) // 2
            busiest.blocks, taken = busiest.blocks[:half], busiest.blocks[half:]
            return taken
        (block,) = busiest.blocks
        if block.chained:
            busiest.blocks = []
            return [block]
        first, others = block.cut(busiest.ahead // 2)
        busiest.blocks = [first]
        return [others] if others is not None else []
