"""All solutions of a small problem, as the façade and the command `solve --all` list them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench import graph, storage
from cpbench.api.problems import verify
from cpbench.errors import CpbenchError, FormatError, NoRoute
from cpbench.formulations.base import Kind, Point, Problem
from cpbench.foundation import matrices
from cpbench.foundation.extensions import hook
from cpbench.foundation.matrices import Dense, Vector
from cpbench.foundation.text import counted
from cpbench.storage.base import write_atomic
from cpbench_lab.certifying import require_flint

NODES = ("lcp", "mlcp")
"""Formulations of which all complementary bases are looked at."""
SUFFIXES = (".npy", ".csv", ".txt")
DIGITS = 12
"""Digits to which equilibria are the same."""


@dataclass(frozen=True, eq=False)
class EverySolution:
    """All solutions of a problem, over the rationals.

    Attributes
    ----------
    problem : the problem. points : its solutions, rounded to the nearest doubles; of a continuum (`endless`) those that
        are the only one of some complementary basis, as its ends are.
    route : the conversions to the problem whose bases were looked at.
    endless : whether they fill a continuum. components : of a game the points that are corners of one set of
    equilibria, by number from 0.
    """

    problem: Problem
    points: tuple[Point, ...]
    route: str = "direct"
    endless: bool = False
    components: tuple[tuple[int, ...], ...] = ()

    @property
    def count(self) -> float:
        """The number of solutions, infinity for a continuum."""
        return math.inf if self.endless else float(len(self.points))

    @property
    def x(self) -> Dense:
        """The solutions as vectors, the parts of a point one after the other, shape (count, n)."""
        return self._rows([point.arrays() for point in self.points])

    @property
    def own(self) -> list[dict[str, Vector]]:
        """The unknowns of each solution by name: x and y of a game, the parts of the point of any other problem."""
        return [hook("own_unknowns")(self.problem, point) or point.arrays() for point in self.points]

    def _rows(self, parts: Sequence[Mapping[str, Vector]]) -> Dense:
        size = sum(self.problem.point_sizes.values())
        vectors = [np.concatenate([np.zeros(0), *one.values()]) for one in parts]
        return np.array(vectors, dtype=np.float64).reshape(len(vectors), size)

    def lines(self) -> Iterator[str]:
        """Yield how many solutions there are, and each with the error that is measured of it."""
        if self.endless:
            yield f"a continuum of solutions, of which {counted(len(self.points), 'corner')} are listed"
        elif self.points:
            yield f"{counted(len(self.points), 'solution')}, all there are"
        else:
            yield "there is no solution: all complementary bases were looked at"
        for number, (point, own) in enumerate(zip(self.points, self.own, strict=True), 1):
            parts = (
                f"{name} = ({', '.join(f'{v:.9g}' for v in values.tolist())})"
                for name, values in own.items()
                if values.size
            )
            yield f"  {number}: {'; '.join(parts)}   error {verify(self.problem, point).error:.2g}"
        for corners in self.components:
            if len(corners) > 1:
                yield f"  one connected set of equilibria has the corners {', '.join(str(k + 1) for k in corners)}"

    def save(self, path: Path, *, force: bool = False) -> None:
        """Write a row of its `own` unknowns for each solution (.npy, .csv, .txt); raises FormatError on another suffix,
        and where the file exists (unless `force`)."""
        require_rows(path)
        rows = self._rows(self.own)

        def put(file: BinaryIO) -> None:
            if path.suffix == ".npy":
                np.save(file, rows, allow_pickle=False)
            else:
                np.savetxt(file, rows, fmt="%.17g", delimiter=",")

        write_atomic(path, put, force=force)


def reply_to(address: str, format: str | None, output: Path | None, force: bool) -> dict[str, Any]:
    """List all solutions of the problem of a file, as `cpbench solve --all` does: lines, record, and whether the file
    `output` was written. Raises CpbenchError."""
    problem = storage.load(address, format=format)
    found = every_solution(problem)
    name = problem.name or Path(address).stem
    first, *rest = found.lines()
    record: dict[str, Any] = {"problem": name, "endless": found.endless, "route": found.route}
    record["solutions"] = found.x.tolist()
    if (solutions := found.own) and solutions[0].keys() == {"x", "y"}:  # of a game
        record["equilibria"] = [{name: part.tolist() for name, part in own.items()} for own in solutions]
    if output is not None and found.points:
        found.save(output, force=force)
    lines = [f"{name} ({problem.node}): {first}", *rest]
    return {"lines": lines, "record": record, "good": True, "written": bool(found.points)}


def require_rows(path: Path) -> None:
    """Raise FormatError where the suffix is none of a file with a row for each solution."""
    if path.suffix not in SUFFIXES:
        raise FormatError(path, "", f"all solutions are written as rows of numbers: name it {', '.join(SUFFIXES)}")


def every_solution(problem: Problem) -> EverySolution:
    """Return all solutions of a problem that is a small LCP or MLCP, or equivalent to one.

    Every complementary basis is looked at, in exact arithmetic: about 12 pairs at most. Of a bimatrix game it is the
    vertices of the two best-response polytopes.

    Raises CpbenchError where it is another problem, too large or takes too long, and without python-flint.

    >>> import cpbench
    >>> found = cpbench.every_solution(cpbench.LCP(M=[[1.0, 2.0], [2.0, 1.0]], q=[-3.0, -3.0]))
    >>> found.x.tolist()
    [[3.0, 0.0], [0.0, 3.0], [1.0, 1.0]]
    """
    if (game := hook("game_sizes")(problem)) is not None:
        return _every_equilibrium(problem, *game)
    require_flint()
    from cpbench_lab.certificates.all_solutions import all_solutions, basic_solutions
    from cpbench_lab.certificates.exact_rows import nearest

    converted, steps, route = _converted(problem)
    found = all_solutions(converted)
    endless = found is not None and found.endless is not None
    listed = basic_solutions(converted) if endless else None if found is None else [exact for exact, _ in found.points]
    if listed is None:
        sizes = ", ".join(f"{symbol} = {size}" for symbol, size in converted.sizes().items())
        raise CpbenchError(
            f"{converted.node} with {sizes}: too large to look at every complementary basis, which takes 2^n solves; "
            "leave --all out for one solution"
        )
    points: dict[bytes, Any] = {}
    for exact in listed:
        point = converted.point_from_vector(np.array([nearest(value) for value in exact]))
        lifted = graph.lift(converted, point, steps)
        points.setdefault(b"".join((values + 0.0).tobytes() for values in lifted.arrays().values()), lifted)
    return EverySolution(problem, tuple(points.values()), route, endless)


def _every_equilibrium(problem: Any, m: int, n: int) -> EverySolution:
    """Return the extreme equilibria of a game of m rows and n columns; there are no others where none has a choice or
    an opponent's choice in common with another. Raises CpbenchError."""
    from cpbench_lab.certificates.equilibria import equilibria

    M = matrices.dense(problem.M)
    A, B = M[:m, m:], M[m:, :m].T
    pairs = equilibria(A, B)
    if pairs is None:
        raise CpbenchError(f"game of {m} x {n}: too large to look at all vertices of its best-response polytopes")
    # two that are the same to rounding are one in payoffs that are not rounded
    different = {tuple(tuple(round(float(value), DIGITS) for value in part) for part in pair): pair for pair in pairs}
    points: list[Any] = []
    shown = sorted(different, reverse=True)
    for pair in shown:
        x, y = (np.array([float(value) for value in part]) for part in different[pair])
        points.append(problem.point_type(z=np.concatenate([x / (x @ B @ y), y / (x @ A @ y)])))  # with costs of 1
    count = len(points)  # at least 1 (Nash 1951)
    one, other = (np.unique([pair[k] for pair in shown], axis=0, return_inverse=True)[1] for k in (0, 1))
    pairs_of = sp.coo_array((np.ones(count), (one, other + count)), shape=(2 * count, 2 * count))
    label = connected_components(pairs_of, directed=False)[1][one]
    parts = tuple(tuple(np.flatnonzero(label == k).tolist()) for k in dict.fromkeys(label.tolist()))
    return EverySolution(problem, tuple(points), "direct", len(parts) < count, parts)


def _converted(problem: Problem) -> tuple[Problem, int, str]:
    """Return the problem as an LCP or MLCP with the same solutions, how many conversions led there, and which.

    Raises CpbenchError.
    """
    if problem.node in NODES:
        return problem, 0, "direct"
    why = ""
    for node in NODES:
        try:
            arrival = graph.arrive(problem, node, frozenset({Kind.EQUIVALENT}))
        except NoRoute as cause:
            why = why or str(cause)
            continue
        return arrival.problem, len(arrival.route.steps), arrival.route.label
    raise CpbenchError(
        f"{problem.node}: all solutions are listed of an LCP or MLCP, or what is equivalent to one: {why}"
    )
