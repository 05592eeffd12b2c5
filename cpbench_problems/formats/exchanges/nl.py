"""`nl`: AMPL's .nl, which solvers with an interface to AMPL read; they write their answer beside it, as problem.sol.

A solver is declared by `command = "SOLVER {problem} -AMPL"` and `exchange = "nl"`. Unknowns and rows have the order of
the problem, and multipliers of rows AMPL's signs, which are ours. What the bounds push with is the suffix `rc` where a
solver writes it, else what is left of the gradient, as AMPL computes it. The number behind `objno` is the claim: below
200 solved, then infeasible, unbounded, a limit, and from 500 on failed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.exchange import Exchange, exchanges
from cpbench.foundation.matrices import Vector
from cpbench.storage.base import read_text, write_atomic
from cpbench_problems.formats import nl, nl_write

_CLAIMS = ("solved", "solved", "infeasible", "unbounded", "max_iter")
_BOUNDS_PUSH = "rc"
_NUMBER = re.compile(r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf(?:inity)?|nan)", re.ASCII | re.IGNORECASE)
_REAL_OF_UNKNOWNS = "4"


class NLFile(Exchange):
    """The problem as an .nl file, the answer as a .sol file."""

    name = "nl"
    summary = "one .nl file of AMPL; the answer is problem.sol, as solvers write it that are called with -AMPL"
    suffix = nl.SUFFIX
    answer_name = "problem.sol"
    nodes = nl_write.NODES

    def obstacle(self, problem: Problem) -> str | None:
        why = super().obstacle(problem)
        if why is None and (reason := nl_write.obstacle(problem)):
            why = f"the exchange {self.name} cannot carry it: {reason}"
        return why

    def write_problem(self, problem: Problem, path: Path, dense: bool = False) -> None:
        """Write the problem; the format has no dense matrices, whatever `dense` asks for."""
        if problem.node not in nl_write.NODES:
            able = ", ".join(sorted(nl_write.NODES))
            raise FormatError(path, "", f"nl takes {able}, not a problem of type {problem.node}")
        write_atomic(path, nl.NL().encode(problem, compress=False), force=True)

    def read_problem(self, path: Path) -> Problem:
        return nl.read(path)

    def write_answer(self, point: Point, path: Path) -> None:
        parts = point.arrays()
        rows = np.concatenate([parts.get("lam", np.zeros(0)), parts.get("mu", np.zeros(0))])
        z, nu = parts["z"], parts.get("nu", np.zeros(0))
        lines = ["cpbench", "", "Options", "3", "1", "1", "0", *map(str, (rows.size, rows.size, z.size, z.size))]
        lines += [*map(repr, rows.tolist()), *map(repr, z.tolist()), "objno 0 0"]
        if nu.size:
            lines += [f"suffix 4 {nu.size} {len(_BOUNDS_PUSH) + 1} 0 0", _BOUNDS_PUSH]
            lines += [f"{k} {value!r}" for k, value in enumerate(nu.tolist())]
        write_atomic(path, "\n".join([*lines, ""]).encode(), force=True)

    def read_answer(self, path: Path, problem: Problem) -> Any:
        answer = _read(path)
        sizes = problem.point_sizes
        rows = sizes.get("lam", 0) + sizes.get("mu", 0)
        if answer.primal.size != sizes["z"]:
            raise FormatError(
                path, "", f"has {answer.primal.size} numbers, expected {sizes['z']}, one for each unknown"
            )
        parts: dict[str, Vector] = {"z": answer.primal}
        if "nu" in sizes:
            if answer.dual.size != rows:
                raise FormatError(path, "", f"has {answer.dual.size} multipliers of rows, expected {rows}")
            parts["lam"], parts["mu"] = np.split(answer.dual, [sizes["lam"]])
            parts["nu"] = answer.push if answer.push is not None else _left(problem, **parts)
        return problem.point_type(**parts)

    def holds_answer(self, path: Path) -> bool:
        return path.is_file() and _read(path).primal.size > 0

    def claim(self, path: Path) -> Mapping[str, Any]:
        if not path.is_file():
            return {}
        solution = _read(path)
        k = solution.result // 100
        return {"claim": _CLAIMS[k] if 0 <= k < len(_CLAIMS) else "failed", "message": solution.message}


@dataclass
class _Solution:
    """Contents of a .sol file. push : the suffix rc, None without one."""

    message: str
    dual: Vector
    primal: Vector
    result: int
    push: Vector | None


def _left(problem: Any, z: Vector, lam: Vector, mu: Vector) -> Vector:
    """Return what is left of the gradient of the objective when the rows have pushed."""
    if problem.node == "qp":
        return problem.Q @ z + problem.p - problem.A.T @ lam - problem.C.T @ mu
    with np.errstate(all="ignore"):
        gradient = problem.f.jacobian(z).toarray().ravel()
        return gradient - problem.g.jacobian(z).T @ lam - problem.h.jacobian(z).T @ mu


def _read(path: Path) -> _Solution:
    """Read a .sol file; raises FormatError."""
    lines = [line.strip() for line in read_text(path).split("\n")]
    if "Options" not in lines:
        raise FormatError(path, "", "has no line 'Options', expected the text of a .sol file")
    at = lines.index("Options")
    message = " ".join(line for line in lines[:at] if line)
    options, at = _numbers(path, lines, at + 1, 1)
    held, at = _numbers(path, lines, at, _size(path, options[0], 9))
    if held.size > 1 and held[1] == 3:
        # two of them are another number, the tolerance vbtol
        at -= 1
    sizes, at = _numbers(path, lines, at, 4)
    dual, at = _numbers(path, lines, at, _size(path, sizes[1], len(lines)))
    primal, at = _numbers(path, lines, at, _size(path, sizes[3], len(lines)))
    result = next((re.fullmatch(r"objno \d{1,9} (-?\d{1,9})", line) for line in lines[at:] if line), None)
    if result is None:
        raise FormatError(path, f"line {at + 1}", "has no 'objno NUMBER RESULT' behind the values")
    return _Solution(message, dual, primal, int(result[1]), _push(path, lines[at:], primal.size))


def _push(path: Path, lines: list[str], n: int) -> Vector | None:
    for k, line in enumerate(lines):
        words = line.split()
        if len(words) == 6 and words[:2] == ["suffix", _REAL_OF_UNKNOWNS] and lines[k + 1 : k + 2] == [_BOUNDS_PUSH]:
            result = np.zeros(n)
            for entry in lines[k + 2 : k + 2 + _size(path, float(words[2]) if words[2].isdecimal() else -1.0, n)]:
                pair = entry.split()
                if len(pair) != 2 or not re.fullmatch(r"\d{1,9}", pair[0]) or int(pair[0]) >= n:
                    raise FormatError(path, _BOUNDS_PUSH, f"has '{entry[:40]}', expected an unknown and a number")
                result[int(pair[0])] = _number(path, _BOUNDS_PUSH, pair[1])
            return result
    return None


def _numbers(path: Path, lines: list[str], at: int, count: int) -> tuple[Vector, int]:
    """Return the numbers of that many lines, and where the next line is."""
    if at + count > len(lines):
        raise FormatError(path, f"line {at + 1}", f"has {max(len(lines) - at, 0)} lines behind it, expected {count}")
    numbers = [_number(path, f"line {at + k + 1}", lines[at + k]) for k in range(count)]
    return np.array(numbers, float), at + count


def _number(path: Path, where: str, text: str) -> float:
    if not _NUMBER.fullmatch(text):
        raise FormatError(path, where, f"has '{text[:40]}', expected a number")
    return float(text)


def _size(path: Path, value: float, most: int) -> int:
    if not 0 <= value <= most or value != int(value):
        raise FormatError(path, "", f"has the size {value:g}, expected a whole number of 0 to {most}")
    return int(value)


exchanges.add("nl", NLFile())
