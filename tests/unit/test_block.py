"""Blocks as data: moved to other files they are still chained."""

from __future__ import annotations

from dataclasses import replace

from cpbench.bench.block import Block, predecessors
from cpbench.bench.planning.plan import Entry, Pair, exact


def _step(number: int) -> Pair:
    """Return a step of a sequence whose files are given relative to a folder that holds them."""
    return Pair(
        address=f"s{number}.h5", problem=f"s{number}", fingerprint=f"{number:016x}", node="lcp", family="", sizes={},
        request=exact(), entry=Entry("lemke"), target="lcp", tolerance=1e-6,
        start="previous", sequence="s", step=number,
    )  # fmt: skip


def test_a_moved_block_is_chained_as_before() -> None:
    """Keys of steps name their folder, and so change: what refers to them has to change with them."""
    first, *others = map(_step, range(3))
    before = predecessors([first, *others])
    block = Block(tuple(others), before, {first.key: ("solved", b"answer")})
    moved = block.moved(lambda file: f"/elsewhere/{file}")
    assert [pair.address for pair in moved.pairs] == ["/elsewhere/s1.h5", "/elsewhere/s2.h5"]
    assert {pair.key for pair in moved.pairs}.isdisjoint(pair.key for pair in block.pairs)
    second, third = moved.pairs
    assert moved.before[third.key] == second
    earlier = moved.before[second.key]
    assert (earlier.address, moved.known) == ("/elsewhere/s0.h5", {earlier.key: ("solved", b"answer")})


def test_members_of_packs_stay_members() -> None:
    member = replace(_step(0), address="pack.h5::a")
    (moved,) = Block((member,)).moved(lambda file: f"/x/{file}").pairs
    assert moved.address == "/x/pack.h5::a"
