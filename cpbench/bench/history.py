"""The way of one solve to its answer: iterates kept while it runs, judged afterwards on the problem that was asked.

The worker records (`recorded`), in a separate solve after those that are timed. The referee measures every iterate
that was kept (`RecordedIterates`, `History`), so that what a solver tells of itself is never needed.
"""

from __future__ import annotations

import gc
import math
import time
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench.bench.messages import JudgeHistory, Recorded
from cpbench.errors import PointError, StoreError
from cpbench.formulations.base import Problem
from cpbench.foundation import frames
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Solver, SolverOutput

if TYPE_CHECKING:
    import pandas as pd

ROOM, LEAST = 64, 4
"""The most iterates kept of a solve, and how many are kept however large they are."""
BYTES = 32e6
"""Bytes of iterates kept, where that is more than LEAST of them."""
FINEST = 1e-4
"""Seconds below which times count as equal when iterates are thinned."""


class IterateRecorder:
    """The `Record` of one solve: keeps iterates at geometrically growing times; its own time is not the solver's.

    All are kept until the room is full, then only those that lie apart by a factor, which grows when they are still
    too many. The clock starts when the recorder is made.

    Parameters
    ----------
    room : the most iterates kept; the answer (`finish`) comes on top.
    """

    def __init__(self, room: int = ROOM) -> None:
        self._room = room
        self._kept: list[tuple[float, int, float, Any]] = []
        self._apart = 0.0
        self._due = self._last = 0.0
        self.calls, self.cost = 0, 0.0
        self._begun = time.perf_counter()

    def __call__(self, iteration: int, residual: float, point: Callable[[], Any]) -> None:
        now = time.perf_counter()
        self.calls += 1
        self._last = elapsed = now - self._begun - self.cost
        # a point is made only where it is kept: to make one can cost as much as an iteration
        if elapsed >= self._due:
            self._kept.append((elapsed, iteration, residual, point()))
            if len(self._kept) >= self._room:
                self._thin()
            self._due = self._next()
        self.cost += time.perf_counter() - now

    def finish(self, output: SolverOutput) -> Recorded:
        """Return what was kept and, last, the answer, whatever was recorded.

        A solve that is done with its last iterate still has to conclude; one that ended with another would have, too,
        and that time is added to all.
        """
        total = time.perf_counter() - self._begun - self.cost
        tail = total - self._last if output.claim is Claim.SOLVED and self._kept else 0.0
        kept = [(min(seconds + tail, total), k, residual, point) for seconds, k, residual, point in self._kept]
        if output.point is not None:
            last = output.counters.get("iterations", kept[-1][1] if kept else 0)
            kept.append((total, last, math.nan, output.point))
        vectors = {
            "time": np.array([seconds for seconds, *_ in kept]),
            "iteration": np.array([float(iteration) for _, iteration, *_ in kept]),
            "residual": np.array([residual for *_, residual, _ in kept]),
            "iterates": np.concatenate([np.zeros(0), *(v for *_, p in kept for v in p.arrays().values())]),
        }
        return Recorded(len(kept), total, self.cost, self.calls, vectors)

    def _next(self) -> float:
        return self._kept[-1][0] + self._apart * max(self._kept[-1][0], FINEST)

    def _thin(self) -> None:
        every = self._kept
        # to three quarters at once: thinning reads all that is kept, and has to be rare
        while len(self._kept) > 3 * self._room // 4:
            self._apart = max(1.25 * self._apart, 0.01)
            self._kept = every[:1]
            for one in every[1:]:
                if one[0] >= self._next():
                    self._kept.append(one)


def recorded(solver: Solver, problem: Problem, budget: Budget, options: Any, start: Any | None) -> Recorded:
    """Solve once more and record it."""
    prepared = solver.setup(problem, budget, options)
    size = sum(problem.point_sizes.values())
    # else this solve might pay for collecting what the timed ones left
    gc.collect(0)
    recorder = IterateRecorder(max(LEAST, min(ROOM, int(BYTES / (8 * size + 1)))))
    return recorder.finish(solver.solve(prepared, budget, options, start, recorder))


@dataclass(frozen=True, eq=False)
class RecordedIterates:
    """A record of a worker, nothing of it believed but the times: `iterates` is (count, numbers of an answer)."""

    time: Vector
    iteration: Vector
    residual: Vector
    iterates: np.ndarray[Any, np.dtype[np.float64]]
    solve: float
    cost: float
    calls: int

    @classmethod
    def of(cls, message: JudgeHistory, size: int) -> RecordedIterates:
        """Return the iterates in a message, for answers of `size` numbers; raises PointError where it does not hold
        together."""
        try:
            columns = {
                name: np.asarray(message.vectors[name], dtype=float) for name in ("time", "iteration", "residual")
            }
            if any(column.shape != (message.count,) for column in columns.values()):
                raise ValueError(
                    f"{message.count} iterates with {[c.size for c in columns.values()]} times and residuals"
                )
            # times are the one thing that is taken over: falsified ones would at least have to keep their order
            if not (np.isfinite(columns["time"]).all() and (np.diff(columns["time"], prepend=0.0) >= 0.0).all()):
                raise ValueError("the times do not rise")
            iterates = np.asarray(message.vectors["iterates"], dtype=float).reshape(message.count, size)
        except (KeyError, TypeError, ValueError) as cause:
            raise PointError(f"the recorded iterates are none: {cause}") from None
        return cls(**columns, iterates=iterates, solve=message.solve, cost=message.cost, calls=message.calls)

    def judged(self, errors: Mapping[int, tuple[float, tuple[str, ...]]]) -> History:
        """Return the history of the iterates whose error and flags are given, by their places."""
        measured = sorted(errors)
        return History(
            time=self.time[measured],
            iteration=self.iteration[measured],
            residual=self.residual[measured],
            error=np.array([errors[k][0] for k in measured]),
            flags=tuple(",".join(errors[k][1]) for k in measured),
            solve=self.solve,
            cost=self.cost,
            calls=self.calls,
        )


@dataclass(frozen=True, eq=False)
class History:
    """Measurements of the iterates of a solve that were kept, in order of time.

    Attributes
    ----------
    time : seconds that a solve which ended with the iterate would have taken, without those of the recorder.
    iteration : of the solver. residual : the solver's own, NaN where it reported none. error : ours, on the problem
    that was asked, ∞ for no answer. flags : remarks of the verdict at the tolerance that the iterate just meets.
    solve : seconds of the whole recorded solve. cost : seconds the recorder took on top. calls : of the recorder.
    """

    time: Vector
    iteration: Vector
    residual: Vector
    error: Vector
    flags: tuple[str, ...]
    solve: float
    cost: float = 0.0
    calls: int = 0

    def pack(self) -> bytes:
        """Pack into one compressed blob."""
        header = {"flags": self.flags, "solve": self.solve, "cost": self.cost, "calls": self.calls}
        return zlib.compress(frames.pack(header, {stored: getattr(self, name) for name, stored in STORED.items()}), 6)

    @classmethod
    def unpack(cls, blob: bytes) -> History:
        """Read a packed history; raises StoreError when the blob is none of ours."""
        try:
            header, columns = frames.unpack(zlib.decompress(blob))
            return cls(
                **{name: columns[stored] for name, stored in STORED.items()},
                flags=tuple(map(str, header["flags"])),
                solve=float(header["solve"]),
                cost=float(header["cost"]),
                calls=int(header["calls"]),
            )
        except (zlib.error, frames.FrameError, KeyError, TypeError, ValueError) as cause:
            raise StoreError(f"a history of {len(blob)} bytes cannot be read: {cause}") from None


STORED = {"time": "time", "iteration": "iteration", "residual": "told", "error": "error"}
"""Names in results files of the columns of a history."""


def coarse_to_fine(count: int) -> list[int]:
    """Return 0 … count - 1 with the last first, then the first, then the middles of what is between: cut anywhere,
    what was done is spread over the whole.

    >>> coarse_to_fine(6)
    [5, 0, 2, 1, 3, 4]
    """
    order = [count - 1, 0][: min(count, 2)]
    gaps = [(0, count - 1)]
    while gaps:
        low, high = gaps.pop(0)
        if high - low > 1:
            # breadth first: judging ends after HISTORY_SECONDS, wherever it is then
            middle = (low + high) // 2
            order.append(middle)
            gaps += [(low, middle), (middle, high)]
    return order


def table(histories: Iterable[tuple[str, bytes]]) -> pd.DataFrame:
    """Packed histories by key as one long table: key, the columns of `History`, the share of `solve` that is over."""
    import pandas as pd

    parts: list[pd.DataFrame] = []
    for key, blob in histories:
        history = History.unpack(blob)
        share = history.time / history.solve if history.solve > 0 else np.ones_like(history.time)
        columns = {name: getattr(history, name) for name in STORED}
        parts.append(pd.DataFrame({"key": key, **columns, "share": share}))
    empty = pd.DataFrame(
        {"key": pd.Series(dtype=object), **{name: pd.Series(dtype=float) for name in (*STORED, "share")}}
    )
    return pd.concat(parts, ignore_index=True) if parts else empty
