"""The laboratory's tables by formulation, for `cpbench doctor --node`."""

from __future__ import annotations

from typing import Any

from cpbench.registry import NodeTable


def node_tables() -> tuple[NodeTable[Any], ...]:
    """Return the tables; their modules are imported here, none of which needs an optional package."""
    from cpbench_lab.certificates.mixed import POLYHEDRAL
    from cpbench_lab.diagnosis.scaled import UNITS
    from cpbench_lab.diagnosis.uniform import UNIFORM

    return POLYHEDRAL, UNITS, UNIFORM
