"""Nonlinear maps as data: F from ℝⁿ to ℝᵐ as a list of operations on numbered values, with nothing to execute.

Values are numbered: 0 … n−1 are the unknowns, then the constants, then one for every operation in turn, whose arguments
have smaller numbers (so there is no cycle). The list is canonical: only what the outputs need, in the order in which a
walk from the first output to the last, left argument first, is done with it; an operation that occurs twice stands
once. So equal functions that were built differently have equal lists, and a file read again gives the same bits.

A parameter is a constant with a name, which no other constant is merged with: its value may be changed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cpbench.errors import ProblemError
from cpbench.formulations.expressions.operators import NUMPY, Operator
from cpbench.foundation.extensions import hook
from cpbench.foundation.matrices import Sparse, Vector, freeze

if TYPE_CHECKING:
    from cpbench.formulations.expressions.evaluation import Compiled

LARGEST = 10_000_000
"""Operations and constants a map may have; one of this size takes a minute to build."""

LISTED = ("constants", "heads", "left", "right", "outputs")
"""Arrays of a list of operations, in the order in which `Map` takes them."""

Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Map:
    """F : ℝⁿ → ℝᵐ with exact sparse derivatives.

    Attributes
    ----------
    inputs : n. constants : (c,) finite. heads : (k,) numbers of `Operator`.
    left, right : (k,) numbers of the arguments' values; right is −1 where an operator has one argument.
    outputs : (m,) numbers of values. named : name -> place in `constants` of the parameters.

    Raises ProblemError where a number is out of range, an argument comes after its use or a constant is not finite.
    """

    inputs: int
    constants: Vector
    heads: Index
    left: Index
    right: Index
    outputs: Index
    named: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in LISTED:
            array = np.array(getattr(self, name), dtype=np.float64 if name == "constants" else np.int64)
            if array.ndim != 1:
                raise ProblemError(f"map.{name}", f"has shape {array.shape}, expected one dimension")
            object.__setattr__(self, name, freeze(array))
        self._check()

    def _check(self) -> None:
        k, first = self.heads.size, self.inputs + self.constants.size
        if self.inputs < 0 or not (self.left.size == self.right.size == k):
            raise ProblemError("map", f"has {k} heads, {self.left.size} left and {self.right.size} right arguments")
        if k + self.constants.size > LARGEST:
            raise ProblemError("map", f"has {k + self.constants.size} operations and constants, at most {LARGEST}")
        if not np.isfinite(self.constants).all():
            raise ProblemError("map.constants", "has a number that is not finite")
        if not np.isin(self.heads, list(Operator)).all():
            raise ProblemError("map.heads", "has a number that is not an operator")
        if any(not 0 <= index < self.constants.size for index in self.named.values()):
            raise ProblemError("map.named", f"has a place that is none of {self.constants.size} constants")
        numbers = first + np.arange(k)
        binary = self.heads >= Operator.ADD
        for name, bad in (
            ("left", (self.left < 0) | (self.left >= numbers)),
            ("right", np.where(binary, (self.right < 0) | (self.right >= numbers), self.right != -1)),
            ("outputs", (self.outputs < 0) | (self.outputs >= first + k)),
        ):
            if bad.any():
                at = int(np.flatnonzero(bad)[0])
                raise ProblemError(
                    f"map.{name}", f"is {getattr(self, name)[at]} at {at}, which is not an earlier value"
                )

    # ------------------------------------------------------------------------------------ what it is

    @property
    def rows(self) -> int:
        """m."""
        return int(self.outputs.size)

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n), as of its Jacobian."""
        return self.rows, self.inputs

    @property
    def operations(self) -> int:
        """k."""
        return int(self.heads.size)

    def arrays(self) -> dict[str, Vector | Index]:
        """Return the list of operations without `inputs`, in the order in which the constructor takes it, and without
        the names.
        """
        return {name: getattr(self, name) for name in LISTED}

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of the list, the same however the map was built; the names of parameters are not part of it."""
        # the sizes first: arrays of other lengths could be the same bytes one after the other
        h = hashlib.sha256(f"map {self.inputs} {self.constants.size} {self.operations} {self.rows};".encode())
        for array in self.arrays().values():
            h.update(array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes())
        return h.digest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Map) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __reduce__(self) -> Any:
        return (Map, (self.inputs, *self.arrays().values(), dict(self.named)))

    @property
    def parameters(self) -> dict[str, float]:
        """Name -> value."""
        return {name: float(self.constants[index]) for name, index in self.named.items()}

    def with_parameters(self, values: Mapping[str, float]) -> Map:
        """Return the map in which these parameters have other values; names that it has not are passed over."""
        constants = self.constants.copy()
        for name in self.named.keys() & values.keys():
            constants[self.named[name]] = values[name]
        return replace(self, constants=constants)

    # ----------------------------------------------------------------------------------- evaluation

    @cached_property
    def compiled(self) -> Compiled:
        """Evaluator of the map and its derivatives; built at first use."""
        from cpbench.formulations.expressions.evaluation import Compiled

        return Compiled(self)

    def __call__(self, z: Vector) -> Vector:
        """Evaluate F(z), shape (m,); NaN and ∞ where it is not defined."""
        return self.compiled.value(z)

    def jacobian(self, z: Vector) -> Sparse:
        """Evaluate F′(z), (m, n), by algorithmic differentiation. Its pattern is the same for every z."""
        return self.compiled.jacobian(z)

    def hessian(self, z: Vector, weights: Vector) -> Sparse:
        """Evaluate ∇² Σ weightsᵢ Fᵢ (z), (n, n), symmetric."""
        return self.compiled.hessian(z, weights)

    def evaluate(self, z: Vector) -> Vector:
        """Evaluate F(z) one operation after the other by NumPy: slow, and shares nothing with `__call__`."""
        values: list[Any] = [*np.asarray(z, dtype=float), *self.constants]
        with np.errstate(all="ignore"):
            for head, a, b in zip(self.heads.tolist(), self.left.tolist(), self.right.tolist(), strict=True):
                operator = Operator(head)
                values.append(NUMPY[operator](values[a], values[b]) if b >= 0 else NUMPY[operator](values[a]))
        return np.array([values[k] for k in self.outputs], dtype=float)

    # -------------------------------------------------------------------------------------- algebra

    @classmethod
    def empty(cls, inputs: int) -> Map:
        """Return the map to ℝ⁰."""
        none: Any = []
        return cls(inputs, none, none, none, none, none)

    @classmethod
    def from_casadi(cls, variables: Any, outputs: Any, parameters: Mapping[str, float] | None = None) -> Map:
        """Build a map of CasADi SX expressions, or of MX ones that expand to SX; `parameters` are the other symbols by
        name, with their values. Raises ProblemError on an operator or a symbol that a map has not.
        """
        return hook("map_of_casadi")(variables, outputs, parameters or {})

    def only(self, values: Sequence[int]) -> Map:
        """Return the map to the values of these numbers."""
        nodes = list(zip(self.heads.tolist(), self.left.tolist(), self.right.tolist(), strict=True))
        build, first = Builder(self.inputs), self.inputs + self.constants.size
        wanted = np.zeros(first + self.operations, dtype=bool)
        wanted[list(values)] = True
        # backwards once is enough: arguments come before their users
        for k in range(self.operations - 1, -1, -1):
            if wanted[first + k]:
                wanted[[a for a in nodes[k][1:] if a >= 0]] = True
        number = list(range(self.inputs))
        number += [build.constant(c) if w else -1 for c, w in zip(self.constants, wanted[self.inputs :], strict=False)]
        for (head, a, b), w in zip(nodes, wanted[first:], strict=True):
            number.append(build.apply(Operator(head), number[a], number[b] if b >= 0 else -1) if w else -1)
        return build.finish(number[v] for v in values)

    def sx(self, z: Any) -> Any:
        """Return F of a CasADi SX column z, as an SX column: to build further maps from."""
        return hook("map_in_casadi")(self, z)


class Builder:
    """Maker of a map, operation by operation; equal operations get one number. Numbers are of values, as in `Map`, but
    constants count together with operations, in the order in which they came: `finish` puts them in order."""

    def __init__(self, inputs: int) -> None:
        self.inputs = inputs
        self._known: dict[tuple[int, int, int] | bytes | str, int] = {}
        self._nodes: list[tuple[int, int, int] | float] = []
        self._named: dict[str, int] = {}

    def constant(self, value: float) -> int:
        """Raise ProblemError unless it is finite."""
        value = float(value)
        if not np.isfinite(value):
            raise ProblemError("map", f"has the constant {value}, expected a finite number")
        # by its bytes: −0.0 == 0.0, and 1/x tells them apart
        return self._number(np.float64(value).tobytes(), value)

    def parameter(self, name: str, value: float) -> int:
        """Add a named constant; raises ProblemError unless it is finite, or where files give this name to an
        unknown.
        """
        value = float(value)
        if not np.isfinite(value):
            raise ProblemError("map", f"has the parameter {name} = {value}, expected a finite number")
        if name.startswith(("z[", "y[")):
            raise ProblemError("map", f"has the parameter {name}, a name of unknowns in files: give it another")
        self._named[name] = self._number(name, value)
        return self._named[name]

    def apply(self, operator: Operator, left: int, right: int = -1) -> int:
        """Add an operation on values that exist and return its number."""
        node = (int(operator), left, right)
        return self._number(node, node)

    def operation(self, value: int) -> tuple[int, int, int] | None:
        """Return operator and arguments of a value, the second -1 where there is one; None for another kind of
        value.
        """
        node = self._nodes[value - self.inputs] if value >= self.inputs else None
        return node if isinstance(node, tuple) else None

    def number(self, value: int) -> float | None:
        """Return the number that a value is, None where it is a parameter or no constant."""
        node = self._nodes[value - self.inputs] if value >= self.inputs else None
        return node if isinstance(node, float) and value not in self._named.values() else None

    def _number(self, key: tuple[int, int, int] | bytes | str, node: tuple[int, int, int] | float) -> int:
        result = self._known.get(key)
        if result is None:
            result = self._known[key] = self.inputs + len(self._nodes)
            self._nodes.append(node)
            if len(self._nodes) > LARGEST:
                raise ProblemError("map", f"has more than {LARGEST} operations and constants")
        return result

    def finish(self, outputs: Iterable[int]) -> Map:
        """Return the map to the values with these numbers, canonical."""
        ends = list(outputs)
        constants, operations = self._walk(ends)
        renumbered = {old: self.inputs + new for new, old in enumerate((*constants, *operations))}

        def placed(old: int) -> int:
            return old if old < self.inputs else renumbered[old]

        nodes: list[Any] = [self._nodes[old - self.inputs] for old in operations]
        return Map(
            self.inputs,
            np.array([self._nodes[old - self.inputs] for old in constants], dtype=float),
            np.array([node[0] for node in nodes], dtype=np.int64),
            np.array([placed(node[1]) for node in nodes], dtype=np.int64),
            np.array([placed(node[2]) for node in nodes], dtype=np.int64),
            np.array([placed(end) for end in ends], dtype=np.int64),
            {name: renumbered[old] - self.inputs for name, old in self._named.items() if old in renumbered},
        )

    def _walk(self, ends: Sequence[int]) -> tuple[list[int], list[int]]:
        """Return constants and operations that `ends` need, arguments before their users, left before right."""
        first, nodes = self.inputs, self._nodes
        seen = bytearray(len(nodes))
        constants: list[int] = []
        operations: list[int] = []
        for end in ends:
            stack = [end]
            while stack:
                value = stack[-1]
                if value < first or seen[value - first]:
                    stack.pop()
                    continue
                node = nodes[value - first]
                if not isinstance(node, tuple):
                    constants.append(value)
                    seen[value - first] = 1
                    stack.pop()
                    continue
                _, left, right = node
                # the left one ends on top of the stack, so that it is numbered first; no recursion, which Python ends
                # at a depth of 1,000
                waiting = [a for a in (right, left) if a >= first and not seen[a - first]]
                if waiting:
                    stack.extend(waiting)
                else:
                    operations.append(value)
                    seen[value - first] = 1
                    stack.pop()
        return constants, operations
