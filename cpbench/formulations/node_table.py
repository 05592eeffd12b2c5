"""Tables by formulation: what a package can do with each, entered beside the function that does it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Generic, TypeVar

from cpbench.errors import DuplicateName

T = TypeVar("T")


class NodeTable(Mapping[str, T], Generic[T]):
    """Table of what one package knows of formulations, by node. A plugin enters its own formulation in the same way.

    Parameters
    ----------
    trait : what an entry is, in `cpbench doctor --node`. without : what does not work for a node without an entry.
    """

    def __init__(self, trait: str, without: str) -> None:
        self.trait, self.without = trait, without
        self._entries: dict[str, T] = {}

    def enter(self, entry: T, *nodes: str) -> T:
        """Enter `entry` for some nodes; raises DuplicateName where one of them has another entry."""
        for node in nodes:
            if self._entries.setdefault(node, entry) is not entry:
                raise DuplicateName(f"{self.trait} of '{node}' is defined twice: remove one")
        return entry

    def of(self, *nodes: str) -> Callable[[T], T]:
        """Return a decorator that enters what it decorates for some nodes; raises DuplicateName as `enter` does."""
        return lambda entry: self.enter(entry, *nodes)

    def __getitem__(self, node: str) -> T:
        return self._entries[node]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)
