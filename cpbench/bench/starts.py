"""Starting points: none, the file's guess, or the solver's own last answer.

A start belongs to the source problem and is carried to the converted one by the `push` of every conversion. Where there
is none the pair is unsupported (NotApplicable, with the reason); it is never run cold instead.

    cold         no start
    file         the first of the file's guesses, or the problem's own start; file:K the K-th; file:all each of them, a
                 pair of the plan each
    previous     the solver's own answer to the step before, brought to this one by `formulations.transfer`
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from cpbench import graph, storage
from cpbench.errors import CpbenchError, NotApplicable, ProblemError, UnknownName
from cpbench.formulations.base import Contacts, Problem
from cpbench.formulations.transfer import BY_ID, BY_ORDER, transfer
from cpbench.foundation.matrices import Vector

EVERY = 0
"""The number that stands for every guess of a file."""


class StartKind(StrEnum):
    COLD = "cold"
    FILE = "file"
    PREVIOUS = "previous"


@dataclass(frozen=True)
class StartPolicy:
    """A start policy.

    Attributes
    ----------
    guess : number of the file's guess, from 1; EVERY for all of them, of which a plan makes a pair each.
    """

    kind: StartKind = StartKind.COLD
    guess: int = 1

    def __str__(self) -> str:
        """Return the text that identifies the policy: part of a row's key."""
        if self.guess == EVERY:
            return f"{self.kind}:all"
        return f"{self.kind}:{self.guess}" if self.guess != 1 else str(self.kind)

    @property
    def warm(self) -> bool:
        """Return whether it needs a solver that takes a starting point."""
        return self.kind is not StartKind.COLD


@dataclass(frozen=True)
class Before:
    """The preceding step: a verified answer to it, and its contacts (None: not recorded)."""

    point: Any
    contacts: Contacts | None = None


@dataclass(frozen=True)
class Start:
    """A starting point, None for a cold start, and its description for the row."""

    point: Any | None
    description: str


def parse_start(text: str) -> StartPolicy:
    """Return `cold`, `file`, `file:2`, `file:all` or `previous`; raises UnknownName, CpbenchError on a wrong number.

    >>> str(parse_start("file:1")), parse_start("file:2").guess
    ('file', 2)
    """
    name, colon, number = text.strip().partition(":")
    kinds = [str(kind) for kind in StartKind]
    if name in kinds and not colon:
        return StartPolicy(StartKind(name))
    if name == StartKind.FILE and number == "all":
        return StartPolicy(StartKind.FILE, guess=EVERY)
    if name == StartKind.FILE and number:
        return StartPolicy(StartKind.FILE, guess=_counted(text, number))
    raise UnknownName("start", text, [*kinds, "file:K", "file:all"])


def one_start(text: str) -> StartPolicy:
    """Return the policy in a text where there is one solve of a problem by itself; raises CpbenchError on one that
    needs several."""
    policy = parse_start(text)
    if policy.kind is StartKind.PREVIOUS:
        raise CpbenchError(
            "--start previous: a problem by itself has no step before it; see cpbench run --start previous"
        )
    if policy.guess == EVERY:
        raise CpbenchError("--start file:all: one solve has one start, as file:2; see cpbench run --start file:all")
    return policy


def each_start(text: str, guesses: int) -> list[str]:
    """Return the policies that one stands for, on a problem whose file has this many guesses. Without guesses the first
    is named, so that the row reports that there is none.

    >>> each_start("file:all", 3), each_start("cold", 3), each_start("file:all", 0)
    (['file', 'file:2', 'file:3'], ['cold'], ['file'])
    """
    policy = parse_start(text)
    if policy.guess != EVERY:
        return [text]
    return [str(StartPolicy(StartKind.FILE, guess=k)) for k in range(1, max(guesses, 1) + 1)]


def step_before(address: str, format: str | None, fingerprint: str, answer: Vector) -> Before:
    """Return the step whose answer is kept as a plain vector; raises FormatError, and ProblemError when the file has
    changed."""
    problem = storage.load(address, format=format)
    # the answer is a plain vector: on other data it would be read as another point, without any error
    if problem.fingerprint != fingerprint:
        raise ProblemError(
            address, f"the file changed after it was solved: fingerprint {problem.fingerprint}, was {fingerprint}"
        )
    return Before(problem.point_from_vector(answer), getattr(problem, "contacts", None))


def start(
    policy: StartPolicy,
    problem: Problem,
    address: str,
    converted: Problem,
    steps: int,
    before: Before | None = None,
) -> Start:
    """Return the start on `converted`, which is `problem` after `steps` conversions.

    Raises NotApplicable with the reason where the policy gives no start, or a conversion cannot carry it.
    """
    begin = start_for(policy, problem, address, before)
    return begin if begin.point is None else Start(carry(begin.point, converted, steps), begin.description)


def start_for(policy: StartPolicy, problem: Problem, address: str, before: Before | None = None) -> Start:
    """Return the start on the problem at `address` itself; raises NotApplicable, FormatError.

    before : the preceding step; without it the policy `previous` gives a cold start, which its description says.
    """
    match policy.kind:
        case StartKind.COLD:
            return Start(None, "cold")
        case StartKind.FILE:
            return _from_file(problem, address, policy)
        case StartKind.PREVIOUS:
            return _from_step(problem, before)


def carry(point: Any, converted: Problem, steps: int) -> Any:
    """Return the start on a converted problem; raises NotApplicable where a conversion cannot carry it."""
    try:
        carried = graph.push(converted, point, steps)
        converted.check_point(carried)
    except CpbenchError as cause:
        raise NotApplicable("start", f"no way to carry it to {converted.node}: {cause}") from None
    if not carried.finite:
        raise NotApplicable("start", f"no way to carry it to {converted.node}: it is not finite there")
    return carried


def _counted(text: str, number: str) -> int:
    """Return K of `file:K`."""
    if not (number.isascii() and number.isdigit() and int(number) >= 1):
        raise CpbenchError(
            f"start '{text}': the guess is '{number}', expected its number from 1 on, as in file:2, or file:all"
        )
    return int(number)


def _from_file(problem: Problem, address: str, policy: StartPolicy) -> Start:
    guesses = storage.guesses(address) or _own(problem)
    if len(guesses) < policy.guess:
        contents = f"{len(guesses)} starting points, not {policy.guess}" if guesses else "no starting point"
        raise NotApplicable(f"start {policy}", f"the file has {contents}")
    guess = guesses[policy.guess - 1]
    if not guess.finite:
        raise NotApplicable(f"start {policy}", "the starting point in the file is not finite")
    zero = not any(x.any() for x in guess.arrays().values())
    return Start(guess, f"{policy}: zeros" if zero else str(policy))


def _own(problem: Problem) -> list[Any]:
    """Return the start that is part of a problem with maps (as MathOptFormat's primal_start), with multipliers 0; none
    where it is 0, which is the default."""
    start: Vector | None = getattr(problem, "start", None)
    if start is None or not start.any():
        return []
    first, *others = problem.zero_point().arrays().items()
    return [problem.point_type(**{first[0]: start}, **dict(others))]


def _from_step(problem: Problem, before: Before | None) -> Start:
    if before is None:
        return Start(None, "cold: no step before")
    try:
        transferred = transfer(before.contacts, before.point, problem)
    except NotApplicable as refusal:
        return Start(None, f"cold: {refusal.obstacle}")
    if transferred.how == BY_ID and transferred.new and not transferred.matched:
        return Start(transferred.point, "previous, no contact matched")
    return Start(transferred.point, f"previous, {transferred.how}" if transferred.how == BY_ORDER else "previous")
