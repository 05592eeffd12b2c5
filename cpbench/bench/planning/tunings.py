"""Records in a plan of how options of its solvers were tuned, and on which problems.

    [[tuning]]
    solver = "nsgs[omega=1.32,shuffle=true]"
    method = "random search, successive halving"
    score = "..."
    seed = 0
    budget = 3600.0
    spent = 3598.2
    configurations = 120
    solves = 2041
    split = "dev"
    problems = ["<fingerprint>", ...]

`cpbench tune` writes it. Results and reports mark the solver, and a run of the test split refuses these problems.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from cpbench.bench.messages import Surveyed
from cpbench.bench.planning import grids
from cpbench.bench.planning.plan import Entry
from cpbench.errors import CpbenchError

NAMED = 8
"""Most problems that an error message names; more are counted."""


@dataclass(frozen=True)
class Tuning:
    """The search that found the options of one solver.

    Attributes
    ----------
    solver : with its options, as in `--solver`. score : what was made small, with the value for the options found
    and for the default ones (`found`, `default`). seed : of the configurations, and of the order of problems.
    budget, spent : wall clock [s]. configurations : that were tried. solves : pairs that were run for it.
    split : dev, test, or empty for all problems. problems : fingerprints of those that were used.
    """

    solver: str
    method: str = ""
    score: str = ""
    found: str = ""
    default: str = ""
    seed: int = 0
    budget: float = 0.0
    spent: float = 0.0
    configurations: int = 0
    solves: int = 0
    split: str = ""
    problems: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        return grids.grid(self.solver)[0].label

    def as_data(self) -> dict[str, Any]:
        """Return the tuning as results files keep it."""
        return {**asdict(self), "problems": list(self.problems)}


def read(table: Mapping[str, Any]) -> Tuning:
    """Return the tuning in a table of a plan file; raises CpbenchError."""
    known = {f.name: f.default for f in fields(Tuning)}
    for key, value in table.items():
        if key not in known:
            raise CpbenchError(f"{key} = {value!r}: unknown key; known: {', '.join(known)}")
        if key == "problems":
            right = isinstance(value, list) and all(isinstance(item, str) for item in value)
        elif isinstance(known[key], int | float):
            right = isinstance(value, int | float) and not isinstance(value, bool)
        else:
            right = isinstance(value, str)
        if not right:
            raise CpbenchError(f"{key} = {value!r}: expected what cpbench tune writes")
    if not table.get("solver"):
        raise CpbenchError("names no solver; write solver = 'NAME[option=value,...]'")
    tuning = Tuning(**{**table, "problems": tuple(table.get("problems", ()))})
    if len(grids.grid(tuning.solver)) != 1:
        raise CpbenchError(f"solver = {tuning.solver!r}: is several solvers, a tuning is of one")
    return tuning


def require_unseen(
    tunings: Iterable[Tuning], entries: Sequence[Entry], problems: Sequence[Surveyed], split: str
) -> None:
    """Raise CpbenchError for a set of the test split with problems on which one of its solvers was tuned.

    problems : as surveyed.
    """
    if split != "test":
        return
    labels = {entry.label for entry in entries}
    for tuning in tunings:
        seen = [p for p in problems if p.fingerprint in tuning.problems] if tuning.label in labels else []
        if seen:
            names = sorted({p.problem or p.address for p in seen})
            more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
            raise CpbenchError(
                f"--split test: {tuning.label} was tuned on {', '.join(names[:NAMED])}{more}; leave them out, or tune "
                "on the others (cpbench tune --split dev)"
            )
