"""The state of the solvers on this machine, in lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cpbench.api.solver_tables import HEAD, WIDTH, cells, families, folded_names
from cpbench.bench import availability
from cpbench.bench.availability import SolverState
from cpbench.foundation.plain_text import columns
from cpbench.solvers.base import solvers


def checkup_lines(found: Sequence[SolverState], width: int = WIDTH) -> Iterator[str]:
    """Yield the solvers by their state on this machine, and for what is missing how to get it."""
    counts = {state: [one for one in found if one.state == state] for state in availability.STATES}
    yield f"solvers      {', '.join(f'{len(those)} {state}' for state, those in counts.items() if those)}"
    for state, those in counts.items():
        if those:
            yield {
                "ok": "ok",
                "licence": "licence: installed, and not allowed to run",
                "broken": "broken: installed, and failed when it was tried",
                "missing": "missing: not installed; what to do, and what it brings",
            }[state]
            yield from _ready(those) if state == "ok" else _absent(those, width)


def _ready(those: Sequence[SolverState]) -> Iterator[str]:
    """Yield a line for each solver that runs by default; the others are counted."""
    specs = {one.name: solvers.get(one.name).spec for one in those}
    shown = [one for one in those if specs[one.name].by_default]
    rows = [cells(specs[one.name], one) for one in shown]
    yield from (f"  {line}" for line in columns([HEAD, *rows]))
    if any(specs[one.name].publishing for one in shown):
        yield "  * figures must not be published without permission: cpbench list solvers NAME"
    rest = [specs[one.name] for one in those if one not in shown]
    if rest:
        yield f"  and {len(rest)} that run only when they are named: {families(rest)}"


def _absent(those: Sequence[SolverState], width: int) -> Iterator[str]:
    """Yield a paragraph for each reason, with all solvers that it keeps away."""
    reasons: dict[str, list[str]] = {}
    for one in those:
        reasons.setdefault(one.detail.strip(), []).append(one.name)
    for reason, names in reasons.items():
        lines = reason.splitlines() or ["no reason was given"]
        yield from (f"  {line}" for line in lines)
        yield from folded_names(names, width)
