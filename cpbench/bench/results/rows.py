"""Rows of the results file: what is planned of a pair, and what its run measured.

The fields of `Planned` and then those of `Measured`, in their order, are the columns of the file, and their types the
types of SQL (`columns`). Limits of rows in one file, or of one set in it, have to agree.
"""

from __future__ import annotations

import io
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

import numpy as np

if TYPE_CHECKING:
    from cpbench.bench.planning.plan import Pair

_SQL: Mapping[type, str] = {str: "TEXT", float: "REAL", int: "INTEGER"}


@dataclass(frozen=True)
class Planned:
    """The part of a row that the plan fixes.

    Attributes
    ----------
    key : identity of the pair. sizes, options : JSON objects. set : the part of the plan. solver : its name; label :
    with options and route request. measure : the number that decides, None for all. start : the start policy.
    seconds, memory [bytes], threads, repeats_asked : the limits.
    """

    key: str
    problem: str
    address: str
    fingerprint: str
    node: str
    family: str
    sizes: str
    set: str
    solver: str
    label: str
    request: str
    options: str
    tolerance: float
    measure: str | None
    start: str
    sequence: str
    step: int
    seconds: float
    memory: int
    threads: int
    repeats_asked: int

    @staticmethod
    def of(pair: Pair) -> Planned:
        """Return the planned columns of a pair's row."""
        return Planned(
            key=pair.key,
            problem=pair.problem,
            address=pair.address,
            fingerprint=pair.fingerprint,
            node=pair.node,
            family=pair.family,
            sizes=json.dumps(dict(pair.sizes)),
            set=pair.set,
            solver=pair.entry.solver,
            label=pair.label,
            request=pair.request.name,
            options=json.dumps(dict(pair.entry.options), sort_keys=True),
            tolerance=pair.tolerance,
            measure=pair.measure,
            start=pair.start,
            sequence=pair.sequence,
            step=pair.step,
            seconds=pair.limits.seconds,
            memory=pair.limits.memory,
            threads=pair.limits.threads,
            repeats_asked=pair.limits.repeats,
        )


@dataclass(frozen=True)
class Measured:
    """The part of a row that a run fills; None where it was not measured.

    Attributes
    ----------
    error : on the problem that was asked. target_error : on the solver's own problem, target_tolerance what was asked
    for there. parts, counters : JSON objects. samples : JSON list of the seconds of all solves. wall to cpu [s],
    solve_min, solve_iqr [s]. peak : bytes. started : where the solver did start. attempts : how often the pair was run.
    jobs : solves side by side. reported : seconds by the solver's own account. certainty : level of the certificate of
    the answer, where one was sought. distance : a bound on its distance from a solution, over the size of that.
    certificate : what else it says. trip : round trip of an empty request [s] to the process of a served solver, None
    of a solver that runs in its worker. solve is the time of its method, solve_wall [s] what passed in the worker
    meanwhile.
    """

    status: str = "not_run"
    route: str | None = None
    kind: str | None = None
    claim: str | None = None
    error: float | None = None
    target_error: float | None = None
    flags: str | None = None
    message: str | None = None
    parts: str | None = None
    counters: str | None = None
    wall: float | None = None
    load: float | None = None
    convert: float | None = None
    setup: float | None = None
    solve: float | None = None
    lift: float | None = None
    verify: float | None = None
    cpu: float | None = None
    peak: int | None = None
    repeats: int | None = None
    samples: str | None = None
    solve_min: float | None = None
    solve_iqr: float | None = None
    signal: int | None = None
    code: int | None = None
    version: str | None = None
    started: str | None = None
    attempts: int | None = None
    jobs: int | None = None
    host: str | None = None
    loadavg: float | None = None
    reported: float | None = None
    finished: str | None = None
    target_tolerance: float | None = None
    certainty: str | None = None
    distance: float | None = None
    certificate: str | None = None
    trip: float | None = None
    solve_wall: float | None = None


@dataclass(frozen=True)
class Outcome(Measured):
    """The outcome of a pair: the measured columns of its row, and compressed, its answer, its history, and the proof
    that there is no solution."""

    answer: bytes | None = None
    history: bytes | None = None
    proof: bytes | None = None


@dataclass(frozen=True)
class Row(Measured, Planned):
    """A row as the results file has it."""


def columns(kind: type[Planned | Measured]) -> dict[str, str]:
    """Return the columns of a class with their SQL types.

    >>> columns(Planned)["step"], columns(Measured)["error"]
    ('INTEGER', 'REAL')
    """
    types = get_type_hints(kind)
    return {f.name: _SQL[(get_args(types[f.name]) or (types[f.name],))[0]] for f in fields(kind)}


PLANNED, MEASURED = columns(Planned), columns(Measured)
"""Columns of a row that the plan fixes, and those that the run fills, with their SQL types."""


# ------------------------------------------------------------------------------------------------- limits

LIMITS = {"seconds": "timeout", "memory": "memory", "threads": "threads", "repeats_asked": "repeats"}
"""The columns of limits, by the name that an option gives them."""


def limits_of(row: Planned) -> tuple[float, int, int, int]:
    """Return the limits of a row, in the order of `LIMITS`."""
    return row.seconds, row.memory, row.threads, row.repeats_asked


def difference(name: str, old: tuple[float, ...], new: tuple[float, ...]) -> str:
    """Return why a file refuses limits that are not the old ones of set `name`."""
    changes = zip(LIMITS.values(), old, new, strict=True)
    limit, before, now = next(change for change in changes if change[1] != change[2])
    what = f"set '{name}' was made" if name else "was made"
    advice = "results of other limits do not mix: use another file with -o"
    return f"{what} with {limit} {before:.12g}, now {now:.12g}; {advice}"


# ---------------------------------------------------------------------------------------------- kept answers


def pack_answer(point: Any) -> bytes:
    """Return a point as one compressed .npy file, which `numpy.load` reads too: its parts one after the other
    (`Problem.point_from_vector` splits them)."""
    vector = point.vector
    return zlib.compress(_header(vector.size) + vector.tobytes(), 1)


def unpack_answer(blob: bytes) -> Any:
    """Return the vector in a kept answer."""
    return np.load(io.BytesIO(zlib.decompress(blob)), allow_pickle=False)


@lru_cache(maxsize=2**10)
def _header(size: int) -> bytes:
    """Return the header of a .npy file with one vector of float64."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {"descr": np.dtype(np.float64).str, "fortran_order": False, "shape": (size,)}
    )
    return buffer.getvalue()
