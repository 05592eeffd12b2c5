"""One pair through the real runner, for tests of what it makes of solvers that say what is not so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from cpbench import storage
from cpbench.bench.planning import plan
from cpbench.bench.results.rows import Outcome
from cpbench.bench.slot import Slot
from cpbench.solvers import solvers

LIMITS = plan.Limits(seconds=20.0, repeats=1)


def row_of(slot: Slot, problem: Any, solver: str, folder: Path) -> Outcome:
    available = solvers.get(solver).availability()
    if not available.ok:
        pytest.skip(f"needs a package: {available.detail}")
    address = folder / f"{solver}.h5"
    storage.save(problem, address)
    asked = [plan.exact()]
    (pair,) = plan.pairs([slot.survey(str(address), asked)], [plan.Entry(solver)], asked, 1e-6, LIMITS)
    return slot.run(pair, slot.prepare(pair))
