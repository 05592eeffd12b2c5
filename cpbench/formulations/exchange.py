"""Exchanges: how a problem is handed to another program, and how its answer is read back.

A format of `storage` keeps problems for people, with all that is known of them; an exchange is what a program that
knows nothing of cpbench reads and writes. What comes back is data of somebody else's making: every size is checked.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from cpbench.formulations.base import Point, Problem
from cpbench.registry import Registry


class Exchange(ABC):
    """One way to hand problems over.

    Attributes
    ----------
    name : what a declaration says (``exchange = "npy-dir"``). summary : one line for tables.
    suffix : the end of a path's name, "" for a folder.
    nodes : the formulations it can carry, None for all.
    answer_name : the file of an answer, beside the problem, where programs name it; "" where they are given a path.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    suffix: ClassVar[str] = ""
    nodes: ClassVar[frozenset[str] | None] = None
    answer_name: ClassVar[str] = ""

    def obstacle(self, problem: Problem) -> str | None:
        """Return why it cannot carry a problem, None where it can."""
        if self.nodes is not None and problem.node not in self.nodes:
            return f"the exchange {self.name} carries {', '.join(sorted(self.nodes))}, not {problem.node}"
        return None

    def holds_answer(self, path: Path) -> bool:
        """Return whether there is an answer in the file at `path`. Raises FormatError."""
        return path.exists()

    def claim(self, path: Path) -> Mapping[str, Any]:
        """Return what the file of an answer says of it, as `claim.json` does: claim, message. Raises FormatError."""
        return {}

    @abstractmethod
    def write_problem(self, problem: Problem, path: Path, dense: bool = False) -> None:
        """Put `problem` at `path`, in place of what is there; `dense`: no sparse matrix. Raises FormatError."""

    @abstractmethod
    def read_problem(self, path: Path) -> Problem:
        """Read the problem at `path`; raises FormatError."""

    @abstractmethod
    def write_answer(self, point: Point, path: Path) -> None:
        """Put an answer at `path`, in place of what is there. Raises FormatError."""

    @abstractmethod
    def read_answer(self, path: Path, problem: Problem) -> Any:
        """Read the point at `path`, which has the shape of an answer to `problem`; its numbers may be NaN.

        Raises FormatError when there is none, or it is of another shape or type.
        """


exchanges: Registry[Exchange] = Registry("exchange", "cpbench.storage.exchanges")
