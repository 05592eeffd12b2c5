"""Many problems of one formulation and one size, as stacked arrays."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import ProblemError
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices


@dataclass(frozen=True, eq=False)
class Stack:
    """k problems of one formulation whose data have the same shapes.

    Attributes
    ----------
    kind : the class of the problems. arrays : their data by name, (k, rows, columns) or (k, size), read-only.
    others : fields beside the data that all of them share, as the dimension of contacts. count : k.
    """

    kind: type[Problem]
    arrays: Mapping[str, np.ndarray[Any, np.dtype[np.float64]]]
    others: Mapping[str, Any]
    count: int

    @classmethod
    def of_arrays(cls, kind: type[Problem], given: Mapping[str, Any]) -> Stack:
        """Stack what has one axis more than a problem's own field; what has not is the same for all problems.

        Raises ProblemError on a name that is not a field, shapes that do not fit together, and an empty stack.
        """
        fields = {f.name: f for f in dataclasses.fields(kind)}
        if kind.has_maps():
            raise ProblemError(kind.node, "has nonlinear maps, which are not stacked")
        unknown = sorted(given.keys() - fields.keys())
        if unknown:
            raise ProblemError(kind.node, f"has no field {unknown[0]}: it has {', '.join(fields)}")
        data = {name: f.metadata["shape"] for name, f in fields.items() if "shape" in f.metadata}
        arrays = {name: np.asarray(value, dtype=float) for name, value in given.items() if name in data}
        counts = {len(a) for name, a in arrays.items() if a.ndim == len(data[name]) + 1}
        if len(counts) != 1:
            counted = " and ".join(map(str, sorted(counts))) if counts else "no"
            raise ProblemError(kind.node, f"has arrays of {counted} problems; a stacked field has one axis more")
        count = counts.pop()
        if not count:
            raise ProblemError(kind.node, "has arrays of no problem")
        others = {name: value for name, value in given.items() if name not in data}
        pattern = {name: a[0] if a.ndim == len(data[name]) + 1 else a for name, a in arrays.items()}
        pattern = kind(**pattern, **others).data()  # says whether the shapes fit, and what is left out
        stacked: dict[str, Any] = {}
        for name, one in pattern.items():
            value = arrays.get(name, matrices.dense(one))
            shape = (count, *one.shape)
            # a copy: what the caller writes afterwards changes no problem
            stacked[name] = np.array(np.broadcast_to(value, shape), order="C")
        return cls._checked(kind, stacked, others, count)

    @classmethod
    def of_problems(cls, problems: Sequence[Problem]) -> Stack:
        """Stack problems of one formulation and one size; raises ProblemError where they are not."""
        if not problems:
            raise ProblemError("problems", "are none: a stack has at least one")
        first = problems[0]
        kind, sizes, dimension = type(first), first.sizes(), getattr(first, "dimension", None)
        if kind.has_maps():
            raise ProblemError(kind.node, "has nonlinear maps, which are not stacked")
        for i, problem in enumerate(problems):
            if (
                type(problem) is not kind
                or problem.sizes() != sizes
                or getattr(problem, "dimension", None) != dimension
            ):
                raise ProblemError(f"problem {i}", f"is {problem!r}, the first is {first!r}: expected the same size")
        arrays = {
            name: np.array([matrices.dense(getattr(p, name)) for p in problems], dtype=float) for name in first.data()
        }
        return cls._checked(kind, arrays, {} if dimension is None else {"dimension": dimension}, len(problems))

    @classmethod
    def _checked(cls, kind: type[Problem], arrays: Mapping[str, Any], others: Mapping[str, Any], count: int) -> Stack:
        """Freeze the arrays; raises ProblemError where a number is none."""
        for name, array in arrays.items():
            may_be_infinite = kind.__dataclass_fields__[name].metadata.get("finite") is False
            # a sum is finite only if its terms are, and is made in less time than a look at each
            if may_be_infinite or not np.isfinite(array.sum()):
                bad = np.isnan(array) if may_be_infinite else ~np.isfinite(array)
                if bad.any():
                    index = tuple(int(i) for i in np.argwhere(bad)[0])
                    raise ProblemError(f"{kind.node}.{name}", f"is {array[index]} at {index}")
            matrices.freeze(array)
        return cls(kind, arrays, others, count)

    def __len__(self) -> int:
        return self.count

    @property
    def point_sizes(self) -> dict[str, int]:
        """Length of every part of an answer to one of them, in order."""
        return self.problem(0).point_sizes

    def problem(self, i: int) -> Problem:
        """Return one of them."""
        return self.kind(**{name: a[i] for name, a in self.arrays.items()}, **self.others)

    def only(self, some: np.ndarray[Any, Any]) -> Stack:
        """Return the stack of the problems at these places."""
        arrays = {name: matrices.freeze(a[some]) for name, a in self.arrays.items()}
        return Stack(self.kind, arrays, self.others, len(some))

    def pieces(self, entries: int) -> Iterator[slice]:
        """Yield slices of problems with about so many numbers each."""
        entries_of_one = max(sum(a[0].size for a in self.arrays.values()), 1)
        step = max(entries // entries_of_one, 1)
        for begin in range(0, self.count, step):
            yield slice(begin, min(begin + step, self.count))

    def direct_sum(self, some: slice) -> Problem:
        """Return one problem that is `some` of them side by side: block-diagonal matrices, vectors one after the
        other.

        Its solutions are theirs, side by side.
        """
        return self.kind(**{name: _side_by_side(a[some]) for name, a in self.arrays.items()}, **self.others)


def _side_by_side(array: np.ndarray[Any, Any]) -> Any:
    if array.ndim == 2:
        return array.ravel()
    k, rows, columns = array.shape
    index = matrices.index_dtype(k * rows, k * columns, array.size)
    at = np.arange(k * columns, dtype=index).reshape(k, 1, columns)
    data, indices = array.ravel(), np.broadcast_to(at, array.shape).ravel()
    shape, some = (k * rows, k * columns), data != 0
    if some.all():
        starts = np.arange(k * rows + 1, dtype=index) * columns
        return matrices.adopt(sp.csr_array((data, indices, starts), shape=shape))
    indptr = np.zeros(k * rows + 1, dtype=index)
    np.cumsum(some.reshape(k * rows, columns).sum(axis=1), out=indptr[1:])
    return matrices.adopt(sp.csr_array((data[some], indices[some], indptr), shape=shape))
