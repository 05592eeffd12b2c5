"""One solve of a problem of a file, as `cpbench solve` shows and writes it."""

from __future__ import annotations

import json
import math
import os
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpbench import storage
from cpbench.api.answer_text import answer_lines, objective_of, status_text
from cpbench.bench.results.rows import MEASURED, Outcome
from cpbench.errors import CpbenchError
from cpbench.formulations.applications.own_unknowns import own_vector
from cpbench.formulations.base import Point, Problem
from cpbench.foundation.plain_text import on_one_line, printable
from cpbench.registry import PLUGIN_FILES
from cpbench.storage.answers import save_vector
from cpbench.verification import MET_TOLERANCE, PROVEN, REFUSED, error_text


@dataclass(frozen=True, eq=False)
class Answered:
    """Outcome of one solve; true in a condition where the answer is verified, or proved that there is none.

    Attributes
    ----------
    address, name, node : of the problem. label : of the solver. tolerance : what was asked for.
    outcome : what was measured.
    problem, point : the problem and the answer to it, None where there is no answer.
    """

    address: str
    name: str
    node: str
    label: str
    tolerance: float
    outcome: Outcome
    problem: Problem | None = None
    point: Point | None = None

    def __bool__(self) -> bool:
        return self.outcome.status in (*MET_TOLERANCE, *PROVEN)

    def record(self) -> dict[str, Any]:
        """Return what was measured with its problem and label, as JSON takes it."""
        measured = {name: getattr(self.outcome, name) for name in MEASURED}
        known = {name: value for name, value in measured.items() if value is not None}
        objective = self._objective()
        more = {} if objective is None else {"objective": objective}
        return {"problem": self.name, "solver": self.label, **more, **known}

    def _objective(self) -> float | None:
        return None if self.problem is None or self.point is None else objective_of(self.problem, self.point)

    def lines(self, *, verbose: bool = False) -> Iterator[str]:
        """Yield what the answer is worth in a line, its numbers, and with `verbose` all of them and what was
        measured."""
        row = self.outcome
        words = status_text(row.status, row.error, self.tolerance, self._objective())
        spent = [seconds for seconds in (row.setup, row.solve) if seconds is not None]
        took = f" in {_duration(sum(spent))}" if spent else ""
        name = on_one_line(self.name or Path(self.address).stem)
        yield f"{name} ({self.node}): {words}; by {self.label}{took}"
        # of what did not solve it, what the solver says; of a proof, what was proved
        if row.message and row.status not in MET_TOLERANCE and not verbose:
            yield f"  {printable(row.message)}"
        if not self and row.status not in REFUSED:
            yield on_one_line(
                f"  why, and what else to try: {_command('explain', _near(self.address), '-s', self.label)}"
            )
        if row.flags and row.error is not None and math.isfinite(row.error) and not verbose:
            yield f"  flags: {row.flags}"
        if self.problem is not None and self.point is not None and row.status not in PROVEN:
            yield from answer_lines(self.problem, self.point, self.tolerance, every=verbose)
        if verbose:
            yield from self._details()

    def _details(self) -> Iterator[str]:
        """Yield by what route the answer came, all that was measured of it, and what it took."""
        row = self.outcome
        if row.started not in (None, "cold"):
            yield f"  started    {row.started}"
        if row.route:
            yield f"  route      {row.route} ({row.kind})"
        if row.error is not None:
            yield f"  error      {error_text(row.error)}, asked for {self.tolerance:.3g}; claimed {row.claim}"
        if row.route != "direct" and row.target_error is not None:
            there, wanted = row.target_error, row.target_tolerance
            yield f"  there      {error_text(there)}, asked for {wanted:.3g}: the error on the solver's own problem"
        if row.flags:
            yield f"  flags      {row.flags}"
        for name, value in json.loads(row.parts or "{}").items():
            yield f"    {name:<28} {value:.3g}"
        parts = ("load", "convert", "setup", "solve", "lift", "verify")
        times = {part: getattr(row, part) for part in parts if getattr(row, part) is not None}
        if times:
            yield "  seconds    " + ", ".join(f"{k} {v:.3g}" for k, v in times.items())
        counters = json.loads(row.counters or "{}")
        if counters:
            yield "  counters   " + ", ".join(f"{k} {v}" for k, v in counters.items())
        if row.message:
            yield f"  message    {printable(row.message)}"

    def save(self, path: Path, *, force: bool = False) -> None:
        """Write the answer, as a plain vector (.npy, .csv, .txt) or with its problem and verdict (.h5). The vector of a
        game, of least squares and of a boxed LCP has the unknowns of these.

        Raises CpbenchError where there is no answer, FormatError where the file exists (unless `force`).
        """
        if self.problem is None or self.point is None:
            raise CpbenchError(f"{self.label}: no answer to write")
        if not save_vector(self.point, path, force=force, own=own_vector(self.problem, self.point)):
            row = self.outcome
            facts = {"solver": self.label, "claim": row.claim, "verdict": row.status}
            facts |= {"residual": row.error, "tolerance": self.tolerance}
            storage.save_answer(path, self.problem, self.point, facts, force=force, with_problem=True)


def _duration(seconds: float) -> str:
    """Return a time in words: 0.27 ms, 1.5 s.

    >>> _duration(2.69e-4), _duration(1.5)
    ('0.269 ms', '1.5 s')
    """
    return f"{seconds:.3g} s" if seconds >= 1.0 else f"{1e3 * seconds:.3g} ms"


def _command(*words: str) -> str:
    """Return `cpbench WORDS`, quoted for a shell, with the plugins that this command was given: names come from
    them."""
    given = [path for path in os.environ.get(PLUGIN_FILES, "").split(os.pathsep) if path]
    plugins = [word for path in dict.fromkeys(given) for word in ("--plugin", _near(path))]
    return shlex.join(["cpbench", *words, *plugins])


def _near(path: str) -> str:
    """Return a path from this folder on where it lies below it, else as it is."""
    place, here = Path(path), Path.cwd()
    return str(place.relative_to(here)) if place.is_absolute() and place.is_relative_to(here) else path
