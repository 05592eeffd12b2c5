"""Random search with successive halving: many configurations on few problems, the better third on three times as many.

Karnin, Koren and Somekh, Almost optimal exploration in multi-armed bandits, ICML 2013; Jamieson and Talwalkar,
Non-stochastic best arm identification and hyperparameter optimization, AISTATS 2016. What grows is the number of
problems, which are the same for all configurations and in an order that the seed decides; brackets follow one another
until the time is over. On each problem the configurations of a rung are run one after the other, in a random order,
so that a drift of the machine touches all of them alike.

The best of many measurements is also the luckiest. The last thing that the budget is spent on is therefore a final:
the best and the default configuration are run once more on all problems, side by side, and only that counts.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace

from cpbench.advice.tuning.score import Score, score, seconds
from cpbench.bench.block import Block
from cpbench.bench.events import EventHandler, ignore_event
from cpbench.bench.planning.plan import Entry, Pair
from cpbench.bench.results.rows import Outcome
from cpbench.bench.runner import Executor
from cpbench.errors import CpbenchError
from cpbench.plurals import counted

ETA = 3
"""One configuration of so many goes on to so many times as many problems."""
LEAST = 2
"""Problems of the first rung, at least."""
FINALISTS = 3
"""Configurations that meet the default one in the final."""
MARGIN = 1.5
"""How much longer than by the average so far the final may take."""
RESERVE = 0.25
"""The largest share of the budget that is kept for the final."""
SILENCE = 0.05
"""Share of the budget after which another rung is told of."""


@dataclass
class Trial:
    """A configuration, and its times [s] by fingerprint of the problem, ∞ where it did not solve it."""

    entry: Entry
    times: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class SearchResult:
    """Result of a search.

    Attributes
    ----------
    entry : the best configuration. score, default : its score and that of the default one, over the same problems.
    configurations, solves : how many were begun. seconds : wall clock. problems : fingerprints of those used.
    whole : whether the two were compared on all problems; where time was short it was a part of them.
    final : whether they were compared side by side.
    """

    entry: Entry
    score: Score
    default: Score
    configurations: int
    solves: int
    seconds: float
    problems: tuple[str, ...]
    whole: bool
    final: bool


def rungs(problems: int) -> list[int]:
    """Return how many problems the rungs of a bracket have.

    >>> rungs(30), rungs(5), rungs(1)
    ([2, 4, 10, 30], [2, 5], [1])
    """
    sizes = [problems]
    while math.ceil(sizes[0] / ETA) >= LEAST:
        sizes.insert(0, math.ceil(sizes[0] / ETA))
    return sizes


class Search:
    """One search. `found` may be asked at any time, after an interruption too.

    Parameters
    ----------
    planned : a pair a problem, whose solver and options are replaced. entries : configurations, the default first.
    budget : wall clock [s]; the solve that is being run when it is over is the last. told : is told how it goes.
    keep : is given every pair with its outcome.
    """

    def __init__(
        self,
        planned: Sequence[Pair],
        entries: Iterator[Entry],
        budget: float,
        seed: int = 0,
        *,
        report: Callable[[str], None] = lambda _: None,
        keep: Callable[[Pair, Outcome], None] = lambda *_: None,
        on_event: EventHandler = ignore_event,
    ) -> None:
        self._problems = sorted(planned, key=lambda pair: _draw(seed, pair.fingerprint))
        self._entries, self._seed = entries, seed
        self._report, self._keep, self._on_event = report, keep, on_event
        self._default = Trial(next(entries))
        self._trials = [self._default]
        self._final: list[Trial] = []
        self._budget = budget
        self._begun = self._spoke = time.monotonic()
        self._ended = 0.0
        self._solves = 0
        self._limit = planned[0].limits.seconds

    def run(self, executor: Executor) -> None:
        """Search until the budget is spent or nothing new is left to try."""
        try:
            sizes = rungs(len(self._problems))
            for bracket in itertools.count(1):
                fresh = [Trial(entry) for entry in itertools.islice(self._entries, ETA ** (len(sizes) - 1))]
                self._trials += fresh
                if not fresh or not self._bracket(executor, bracket, fresh, sizes):
                    break
            self._meet(executor)
        finally:
            self._ended = time.monotonic()

    @property
    def found(self) -> SearchResult:
        """The best so far; raises CpbenchError when no configuration was run on any problem."""
        rivals = self._final or self._whole or self._furthest()
        shared = set.intersection(*(set(trial.times) for trial in rivals))
        if not shared:
            raise CpbenchError("the budget was spent before any configuration was run on a problem; give it more")
        # the default stands first, so that a tie is its
        best = min(rivals, key=lambda trial: self._score(trial, shared))
        begun = [trial for trial in self._trials if trial.times]
        return SearchResult(
            best.entry,
            self._score(best, shared),
            self._score(rivals[0], shared),
            len(begun),
            self._solves,
            (self._ended or time.monotonic()) - self._begun,
            tuple(sorted(set().union(*(trial.times for trial in begun)))),
            len(shared) == len(self._problems),
            bool(self._final),
        )

    @property
    def _whole(self) -> list[Trial]:
        """The default and the others that were run on all problems, if there are others."""
        whole = [trial for trial in self._trials if len(trial.times) == len(self._problems)]
        return whole if len(whole) > 1 and whole[0] is self._default else []

    def _furthest(self) -> list[Trial]:
        """Return the default, and those that came to as many problems as any other did."""
        others = [trial for trial in self._trials if trial is not self._default]
        most = max((len(trial.times) for trial in others), default=0)
        return [self._default, *(trial for trial in others if len(trial.times) == most > 0)]

    def _bracket(self, executor: Executor, number: int, alive: list[Trial], sizes: Sequence[int]) -> bool:
        """Return whether time is left after it."""
        for rung, size in enumerate(sizes, 1):
            done = self._rung(executor, [self._default, *alive], self._problems[:size])
            names = {pair.fingerprint for pair in self._problems[:size]}
            if not done:
                return False
            alive = sorted(alive, key=lambda trial: self._score(trial, names))
            best = f"best {alive[0].entry.label}: {self._score(alive[0], names)}"
            rungs_ = f"bracket {number}, rung {rung} of {len(sizes)}"
            self._tell(f"{rungs_}: {counted(len(alive), 'configuration')} on {counted(size, 'problem')}; {best}")
            alive = alive[: math.ceil(len(alive) / ETA)] if rung < len(sizes) else alive
        return True

    def _meet(self, executor: Executor) -> None:
        """Run the final; do nothing where the budget does not last for all of it."""
        rivals = sorted(self._whole[1:], key=lambda trial: self._score(trial, set(trial.times)))
        again = [Trial(trial.entry) for trial in (self._default, *rivals[:FINALISTS])]
        if rivals and self._rung(executor, again, self._problems, final=True):
            self._final = again

    def _tell(self, line: str) -> None:
        now = time.monotonic()
        if now - self._spoke >= SILENCE * self._budget:
            self._spoke = now
            self._report(f"{now - self._begun:.0f} s: {line}")

    def _left(self, final: bool) -> bool:
        """Return whether there is time for another solve; before the final, as much as that takes is kept for it."""
        spent = time.monotonic() - self._begun
        final_takes = MARGIN * (1 + FINALISTS) * len(self._problems) * spent / max(self._solves, 1)
        return spent < self._budget - (0.0 if final else min(final_takes, RESERVE * self._budget))

    def _rung(
        self, executor: Executor, trials: Sequence[Trial], problems: Sequence[Pair], *, final: bool = False
    ) -> bool:
        """Run what has not been run; False when the time was over before."""
        owners: dict[str, Trial] = {}
        todo: list[Block] = []
        for problem in problems:
            pairs: list[Pair] = []
            for trial in trials:
                if problem.fingerprint not in trial.times:
                    pairs.append(replace(problem, entry=trial.entry))
                    owners[pairs[-1].key] = trial
            if pairs:
                todo.append(Block(tuple(sorted(pairs, key=lambda pair: _draw(self._seed, pair.key)))))
        if not todo:
            return True
        if not self._left(final):
            return False
        with closing(executor.outcomes(todo, self._on_event)) as outcomes:
            for pair, outcome in outcomes:
                self._solves += 1
                if outcome.status == "unavailable":
                    raise CpbenchError(f"{pair.entry.solver} cannot run here: {outcome.message}")
                owners[pair.key].times[pair.fingerprint] = seconds(outcome)
                self._keep(pair, outcome)
                if not self._left(final):
                    break
        return all(problem.fingerprint in trial.times for problem in problems for trial in trials)

    def _score(self, trial: Trial, names: set[str]) -> Score:
        return score((trial.times[name] for name in sorted(names)), self._limit)


def _draw(seed: int, text: str) -> bytes:
    return hashlib.sha256(f"{seed} {text}".encode()).digest()
