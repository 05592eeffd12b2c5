"""Messages between the runner, its referee and its workers: a frozen class each.

A message is sent as a frame (`cpbench.foundation.frames`): a header with the name of its class and its fields, followed
by its `vectors` as raw numbers. What is read is brought to the types of the fields or refused: a worker has run foreign
code, and may send anything.
"""

from __future__ import annotations

import collections.abc
import dataclasses
import math
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar, NewType, TypeAlias, cast, dataclass_transform, get_args, get_origin, get_type_hints

from cpbench.bench.planning.plan import Pair, Request
from cpbench.foundation import frames
from cpbench.foundation.frames import FrameError

Seconds = NewType("Seconds", float)
"""A duration, which is finite and not negative."""
Vectors: TypeAlias = Mapping[str, Any]
"""Vectors of numbers, or bytes, by name."""


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
class Message:
    """A message of one process to another; every class derived from this one is a frozen dataclass."""

    kinds: ClassVar[dict[str, type[Message]]] = {}
    """The classes of messages by name."""

    def __init_subclass__(cls) -> None:
        Message.kinds[cls.__name__] = dataclass(frozen=True)(cls)


class Failure(Message):
    """The reason why there is no other answer."""

    message: str = ""


class Failed(Failure):
    """An error that is not one of the others."""


class OutOfMemory(Failure):
    """The process needed more memory than its limit."""


class Late(Failure):
    """The answer did not come within the limit; made by the runner itself, as `Gone`."""


class Gone(Failure):
    """The process ended, or what it sent was not a message."""


# ------------------------------------------------------------------------------------------- to the referee


@dataclass(frozen=True)
class RefereeCase:
    """The facts of a pair that a referee needs: the problem that was asked, and the way to the solver's node."""

    address: str
    format: str | None
    fingerprint: str
    node: str
    request: Request
    tolerance: float
    measure: str | None = None

    @staticmethod
    def of(pair: Pair) -> RefereeCase:
        """Return the case of a pair."""
        return RefereeCase(
            pair.address, pair.format, pair.fingerprint, pair.target, pair.request, pair.tolerance, pair.measure
        )


class Survey(Message):
    """A request for the facts of a problem that a plan needs. `guesses` : whether to count its file's starting
    points."""

    address: str
    format: str | None
    requests: tuple[Request, ...]
    guesses: bool = False


class Open(Message):
    """A request to load a problem, unless it is loaded already."""

    address: str
    format: str | None
    fingerprint: str


class Prepare(Message):
    """A request to convert a problem to the solver's node."""

    case: RefereeCase


class FindStart(Message):
    """A request for the point from which to start. `before` : the preceding step; `vectors` have its `answer`."""

    case: RefereeCase
    policy: str
    before: RefereeCase | None = None
    vectors: Vectors = field(default_factory=dict[str, Any])


class Judge(Message):
    """A request to judge an answer; `vectors` are its parts and a `certificate`, none where it was not `answered`.

    `promise` : the kind of the solver. `proof_seconds` : for the proof of a claim that there is no solution.
    """

    case: RefereeCase
    claim: str
    answered: bool
    promise: str
    proof_seconds: float
    vectors: Vectors = field(default_factory=dict[str, Any])


# ----------------------------------------------------------------------------------------- from the referee


class Declined(Failure):
    """Bad input, by the message of its exception; `cause` is the name of that class."""

    cause: str = ""


class Surveyed(Message):
    """Facts of a problem for the plan. `nodes` : those whose first edge is open, by the name of the request."""

    address: str
    format: str | None
    problem: str
    fingerprint: str
    node: str
    family: str
    sizes: Mapping[str, Any]
    features: Mapping[str, Any]
    nodes: Mapping[str, Sequence[str]]
    sequence: str = ""
    step: int = 0
    guesses: int = 0


class Opened(Message):
    """The problem is loaded."""


class Prepared(Message):
    """A problem at the solver's node. `path` : the file that workers load. `convert` [s]. `tolerance` : there."""

    path: str
    checksum: int
    route: str
    kind: str
    convert: float
    tolerance: float


class StartFound(Message):
    """The point from which to start: its `vectors`, none for a cold start, and its description for the row."""

    description: str
    vectors: Vectors = field(default_factory=dict[str, Any])


class Judged(Message):
    """The verdict on an answer; `vectors` have the packed `answer` and the `proof`, where there are any."""

    status: str
    message: str
    error: float
    target_error: float | None
    flags: Sequence[str]
    parts: Mapping[str, Any]
    lift: float
    verify: float
    vectors: Vectors = field(default_factory=dict[str, Any])


class HistoryJudged(Message):
    """The errors of recorded iterates; `vectors` have the packed `history`."""

    vectors: Vectors


# ------------------------------------------------------------------------------------------ to a worker


class Solve(Message):
    """A request for a solve; `vectors` are the point to start from."""

    path: str
    tolerance: float
    seconds: float
    options: Mapping[str, Any]
    repeats: int = 1
    repeat_below: float = 1.0
    history: bool = False
    checksum: int | None = None
    vectors: Vectors = field(default_factory=dict[str, Any])


# ---------------------------------------------------------------------------------------- from a worker


class SolverUnavailable(Failure):
    """The solver cannot run here; `state` as in `solvers.base.Availability`."""

    state: str = "broken"


class ProblemUnsupported(Failure):
    """The solver does not take the problem."""


class WarmingUp(Message):
    """The solver is found to be available."""


class Ready(Message):
    """The worker takes requests."""

    version: str


class ProblemLoaded(Message):
    """The problem is loaded, which took `load` seconds; the limit of the solve counts from here on."""

    load: Seconds


class Result(Message):
    """The output of a solver, and what its solve used (`processes.meter`); `vectors` as in `Judge`.

    Where another process solves, `trip` is the round trip of an empty request to it, and `solve_wall` the time that
    passed here: `solve` is that of the method (`outcome.method_seconds`).
    """

    claim: str
    answered: bool
    message: str
    counters: Mapping[str, int]
    setup: Seconds
    solve: Seconds
    cpu: Seconds
    grown: int
    peak: int | None
    children: int
    threads: int
    wrote: bool
    reported: Seconds | None = None
    trip: Seconds | None = None
    solve_wall: Seconds | None = None
    vectors: Vectors = field(default_factory=dict[str, Any])


class Repeats(Message):
    """Seconds of `setup`, of `solve`, and that passed here during the latter, of each repeat."""

    times: tuple[tuple[Seconds, Seconds, Seconds], ...]


class Recorded(Message):
    """The iterates of a recorded solve (`history.IterateRecorder`), and seconds of the solve and of the recorder."""

    count: int
    solve: float
    cost: float
    calls: int
    vectors: Vectors


class JudgeHistory(Recorded):
    """A request to the referee for the errors of recorded iterates, of as many as can be judged within `seconds`."""

    case: RefereeCase
    seconds: float


# ------------------------------------------------------------------------------------------------ bytes


def pack(message: Message) -> bytes:
    """Return the bytes of a message.

    >>> unpack(pack(SolverUnavailable("pip install it", "missing")))
    SolverUnavailable(message='pip install it', state='missing')
    """
    fields = dict(vars(message))
    vectors: Vectors | None = fields.pop("vectors", None)
    return frames.pack({"message": type(message).__name__, "fields": fields}, vectors)


def unpack(data: bytes, header_bytes: float = math.inf) -> Message:
    """Return the message in bytes; raises FrameError where there is none, or its header is longer than
    `header_bytes`."""
    header, vectors = frames.unpack(data, header_bytes)
    try:
        kind, values = Message.kinds[header["message"]], header["fields"]
        if "vectors" in cast(Any, kind).__dataclass_fields__:
            values["vectors"] = vectors
        return cast(Message, _read(kind, values))
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as cause:
        raise FrameError(f"{type(cause).__name__}: {cause}") from None


def _read(kind: type, values: dict[str, Any]) -> Any:
    """Return an instance of a dataclass from the values in a header."""
    for name, exact, read in _conversions(kind):
        if name in values and type(values[name]) is not exact:
            values[name] = read(values[name])
    return kind(**values)


@cache
def _conversions(kind: Any) -> Sequence[tuple[str, Any, Callable[[Any], Any]]]:
    """Return the fields of a dataclass whose values are converted: name, type that needs no conversion, converter."""
    hints = get_type_hints(kind)
    readers = ((f.name, *_reader(hints[f.name])) for f in dataclasses.fields(kind))
    return [(name, exact, read) for name, exact, read in readers if read is not _as_it_is]


def _reader(hint: Any) -> tuple[Any, Callable[[Any], Any]]:
    """Return the type of values that need no conversion to the type of a field, and the converter of others."""
    origin, parts = get_origin(hint), [_reader(part)[1] for part in get_args(hint) if part is not Ellipsis]
    if hint in (str, bool, float):
        return hint, hint
    if hint in (int, Seconds):
        return None, _integer if hint is int else _seconds
    if dataclasses.is_dataclass(hint):
        return None, lambda value: _read(cast(type, hint), value)
    if origin is types.UnionType:  # with None
        return types.NoneType, parts[0]
    if origin is tuple and len(parts) == 1:
        return None, lambda value: tuple(map(parts[0], value))
    if origin is tuple:
        return None, lambda value: tuple(read(item) for read, item in zip(parts, value, strict=True))
    if origin is collections.abc.Mapping and parts[1] is not _as_it_is:
        return None, lambda value: {str(key): parts[1](item) for key, item in value.items()}
    return None, _as_it_is


def _as_it_is(value: Any) -> Any:
    return value


def _seconds(value: Any) -> float:
    seconds = float(value)
    if not 0.0 <= seconds < math.inf:
        raise ValueError(f"a time of {seconds} s")
    return seconds


def _integer(value: Any) -> int:
    """Return an integer within the range that the results file stores."""
    return max(-(2**63), min(int(value), 2**63 - 1))
