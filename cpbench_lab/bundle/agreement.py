"""Whether a run says again what it said: statuses pair by pair. Times are another matter (`analysis.comparison`)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from cpbench.bench.results.rows import Row
from cpbench.verification import Status

LIMITED = (str(Status.TIMEOUT), str(Status.MEMOUT))
"""Statuses that depend on how fast and how large a machine is."""


@dataclass(frozen=True)
class Difference:
    """A pair that ended otherwise. `now` is '' for one that was not even planned."""

    problem: str
    label: str
    before: str
    now: str
    message: str = ""

    @property
    def limited(self) -> bool:
        """Whether a limit of time or memory made it so."""
        return self.before in LIMITED or self.now in LIMITED


@dataclass(frozen=True)
class Agreement:
    """Result of running a bundle again, beside the first.

    Attributes
    ----------
    same : pairs with the same status. different : the others. absent : pairs of solvers that are not here, by solver.
    lost : pairs of problems that are not here, by problem. elsewhere : pairs that were not run there either, or whose
    answers were made elsewhere.
    """

    same: int
    different: tuple[Difference, ...]
    absent: Mapping[str, int]
    lost: Mapping[str, int]
    elsewhere: int

    @property
    def compared(self) -> int:
        return self.same + len(self.different)


def agree(before: Iterable[Row], now: Mapping[str, Row], problems: Iterable[str]) -> Agreement:
    """Compare rows of a bundle with those of another run, by key; `problems` are fingerprints of those that are here.

    A solver that could not run on either side is not compared.

    >>> from dataclasses import replace
    >>> from cpbench.bench.results.rows import Planned, columns
    >>> row = Row(**{**dict.fromkeys(columns(Planned), ""), "fingerprint": "f"}, status="solved")
    >>> found = agree([row], {"": replace(row, status="wrong")}, ["f"])
    >>> found.different[0].before, found.different[0].now
    ('solved', 'wrong')
    """
    here = set(problems)
    rows = list(before)
    known = {row.solver for row in now.values()}
    same, elsewhere = 0, 0
    different: list[Difference] = []
    absent: dict[str, int] = {}
    lost: dict[str, int] = {}
    for row in rows:
        again = now.get(row.key)
        status = again.status if again is not None else ""
        solver, problem = row.solver, row.problem
        if row.origin or row.status in (Status.NOT_RUN, Status.UNAVAILABLE):
            elsewhere += 1
        elif row.fingerprint not in here:
            lost[problem] = lost.get(problem, 0) + 1
        elif status == Status.UNAVAILABLE or (again is None and solver not in known):
            absent[solver] = absent.get(solver, 0) + 1
        elif status == row.status:
            same += 1
        else:
            message = str(again.message or "") if again is not None else ""
            different.append(Difference(problem, row.label, row.status, status, message))
    return Agreement(same, tuple(different), dict(sorted(absent.items())), dict(sorted(lost.items())), elsewhere)


def ordered(differences: Sequence[Difference]) -> list[Difference]:
    """Return the differences, those that no limit explains first."""
    return sorted(differences, key=lambda item: (item.limited, item.problem, item.label))
