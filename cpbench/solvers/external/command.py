"""Solvers that are a command: run once a solve, it reads a problem from a file and writes its answer to another.

    ./mine {problem} {answer} --tol {tol}

All of the process is timed: its start, reading and writing too. A program that `serve`s is measured without these.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import shlex
import string
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cpbench.errors import CpbenchError, Ended, FormatError, Unavailable
from cpbench.foundation.child_processes import kill_tree, start, wait
from cpbench.solvers.base import Availability, Budget, Claim, Record, SolverOutput, SolverSpec, Trait
from cpbench.solvers.external.served import (
    ANSWERED,
    CLAIM,
    HandedOver,
    ProgramSolver,
    backstop,
    missing_executable,
    output,
)
from cpbench.solvers.external.session import ProgramError

PLACEHOLDERS = {
    "problem": "path of the problem",
    "answer": "path where the answer is expected",
    "tol": "tolerance",
    "seconds": "time limit, inf for none",
    "iterations": "limit of iterations, -1 for none",
    "seed": "seed",
    "start": "path of a starting point, empty for none",
    "node": "formulation",
}
_MOST = 2**20
"""Bytes of a claim that are read."""


class CommandSolver(ProgramSolver):
    """A solver that is run as a command, without a shell.

        CommandSolver(spec, command, exchange="npy-dir", matrices="as-is", env=None, cwd=None)

    With exit code 0 and an answer it has claimed to have solved, unless it wrote a `claim.json` beside the answer or
    into its folder: {"claim": ..., "iterations": ..., "seconds": ..., "message": ..., "counters": ...}, of which all
    may be left out. Any other exit code is a crash.

    Parameters
    ----------
    command : words split as a shell does, in which `PLACEHOLDERS` and names of options may stand in braces. The rest
    is as for `ProgramSolver`. Raises CpbenchError when the command cannot be split, or has an unknown placeholder.
    """

    def __init__(self, spec: SolverSpec, command: str, *arguments: Any, **more: Any) -> None:
        split = words(command, [option.name for option in dataclasses.fields(spec.options)])
        super().__init__(dataclasses.replace(spec, traits=spec.traits | {Trait.LAUNCHES}), split, *arguments, **more)

    def setup(self, problem: HandedOver, budget: Budget, options: Any) -> HandedOver:
        """Remove the answers of earlier solves, which might be taken for this one's."""
        (problem.clean_answer_path().parent / CLAIM).unlink(missing_ok=True)
        return problem

    def solve(
        self, prepared: HandedOver, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        values = {
            **dataclasses.asdict(options),
            "problem": prepared.path("problem"),
            "answer": prepared.path("answer"),
            "tol": budget.tolerance,
            "seconds": budget.seconds,
            "iterations": -1 if budget.iterations is None else budget.iterations,
            "seed": budget.seed,
            "start": prepared.start(start) or "",
            "node": prepared.problem.node,
        }
        written = {name: value if isinstance(value, str) else _text(value) for name, value in values.items()}
        code = self._run([word.format_map(written) for word in self.command], backstop(budget.seconds))
        if code:
            raise Ended(self.spec.name, code)
        return SolverOutput(claim=Claim.SOLVED, point=prepared)

    def collect(self, output: SolverOutput) -> SolverOutput:
        handed: Any = output.point
        result = _claimed_output(self.spec.name, handed)
        if result.claim in ANSWERED and not handed.answered():
            raise ProgramError(f"{self.spec.name}: exited with code 0 and wrote no answer")
        return dataclasses.replace(result, point=handed.answer(self.spec.name, result.claim))

    def version(self) -> str:
        return ""

    def availability(self) -> Availability:
        lacking = missing_executable(self.command[0], self)
        return Availability("missing", lacking) if lacking else Availability("ok")

    def _run(self, command: list[str], seconds: float) -> int:
        """Return the exit code; what it prints goes where our stderr goes."""
        try:
            process = start(command, self.env, stdin=subprocess.DEVNULL, stdout=2, cwd=self.cwd)
        except OSError as cause:
            raise Unavailable("broken", f"{command[0]}: cannot be started ({cause.strerror or cause})") from None
        try:
            code = wait(process, seconds)
        except BaseException:
            kill_tree(process)
            raise
        if code is None:
            kill_tree(process)
            raise ProgramError(f"{self.spec.name}: did not end within {seconds:g} s")
        return code


def words(command: str, options: Iterable[str]) -> tuple[str, ...]:
    """Return the words of a command; raises CpbenchError on one that cannot be split or has an unknown placeholder."""
    placeholders = [*PLACEHOLDERS, *options]
    try:
        split = tuple(shlex.split(command))
        names = [(name, spec, conversion) for w in split for _, name, spec, conversion in string.Formatter().parse(w)]
    except ValueError as cause:
        raise CpbenchError(f"cannot be split into words ({cause}); a brace is written twice") from None
    if not split:
        raise CpbenchError("is empty")
    for name, spec, conversion in names:
        if name is not None and (name not in placeholders or spec or conversion):
            raise CpbenchError(f"has the placeholder {{{name}}}, known are {', '.join(placeholders)}")
    return split


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if isinstance(value, int | Path) or not math.isinf(value) else "inf"


def _claimed_output(solver: str, handed: HandedOver) -> SolverOutput:
    """Return what a `claim.json` says, or the answer itself, else solved; raises ProgramError."""
    answer = handed.path("answer")
    for path in (answer / CLAIM, answer.parent / CLAIM):
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            with path.open("rb") as file:
                text = file.read(_MOST + 1)
            path.unlink()  # what is left in a folder is the answer
            try:
                claimed = json.loads(text) if len(text) <= _MOST else None
            except (ValueError, RecursionError):
                claimed = None
            if not isinstance(claimed, dict):
                raise ProgramError(f"{solver}: wrote a {CLAIM} that is not a JSON object: {text[:200]!r}")
            return output(solver, {"claim": "solved", **claimed}, handed)
    try:
        claim = handed.exchange.claim(answer)
    except FormatError as cause:
        raise ProgramError(f"{solver}: wrote an answer that cannot be read: {cause.field} {cause.cause}") from None
    return output(solver, {"claim": "solved", **claim}, handed)
