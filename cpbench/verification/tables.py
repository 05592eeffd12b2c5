"""What the judge knows of each formulation: the rows of its answers, and how their errors are measured."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from cpbench.formulations.node_table import NodeTable
from cpbench.verification.frame import System
from cpbench.verification.parts import Measure

Rows: TypeAlias = Callable[[Any, Any], System]

SYSTEMS: NodeTable[Rows] = NodeTable("rows for the judge", "residuals of the class decide the verdict")
"""Function of a problem and an answer that returns the rows of the answer."""
BY_PARTS: NodeTable[Measure] = NodeTable("measure of connected parts", "only linear parts are measured together")
"""What is measured of the nodes that are taken part by part; of others the linear parts are (`mixed_error`)."""
STACKED: NodeTable[bool] = NodeTable("verdicts as arrays", "solve_many judges answers one by one")
"""Nodes of which many answers are judged in one go (`stacked`)."""


def rows_of(*nodes: str, by: Measure | None = None, stacked: bool = False) -> Callable[[Rows], Rows]:
    """Return a decorator that enters the rows of some nodes, what is measured of them, and whether as arrays, too."""

    def enter(rows: Rows) -> Rows:
        if by is not None:
            BY_PARTS.enter(by, *nodes)
        if stacked:
            STACKED.enter(True, *nodes)
        return SYSTEMS.enter(rows, *nodes)

    return enter
