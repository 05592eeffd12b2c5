"""Answers as lists of unknowns and rows: what the judge measures of a formulation that is no contact problem.

A `Frame` is what all answers to a problem have in common, made once where the problem is linear; a `System` is one
answer. `Groups` tells which blocks belong to which of several problems side by side.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench.formulations.base import Problem
from cpbench.foundation.matrices import Vector
from cpbench.registry import NodeTable
from cpbench.verification.equilibration import equilibrate_apart
from cpbench.verification.sets import Flags, Sets

EPS = float(np.finfo(np.float64).eps)
ROUNDINGS = 8.0
"""Roundings of the largest term that a sum may carry."""
FAR_BELOW = 2.0**-40
"""A constant that is this share of the largest of its kind stands for 0: files have 1e-17, solvers leave 1e-14."""
ILL_POSED = 1e-2
"""Share of its terms by which the difference of two rows that are nearly the same is missed: two digits are left."""


@dataclass(frozen=True, eq=False)
class Groups:
    """Blocks in groups, with operations over each group; results have the shape (count,).

    Attributes
    ----------
    of : (k,) number of the group of each block, None where there is only one group. count : how many groups there are.
    k : how many blocks there are.
    """

    of: Any
    count: int
    k: int

    @classmethod
    def one(cls, k: int) -> Groups:
        """Return one group of k blocks."""
        return cls(None, 1, k)

    def largest(self, values: Vector) -> Vector:
        """Return the largest of the nonnegative values of each group; 0 for an empty group."""
        if self.of is None:
            return np.maximum.reduce(values, initial=0.0, keepdims=True)
        return largest_of(self.of, values, self.count)

    def sum(self, values: Vector) -> Vector:
        """Return the sum of the values of each group."""
        if self.of is None:
            return np.add.reduce(values, keepdims=True)
        return np.bincount(self.of, values, self.count).astype(np.float64, copy=False)

    def any(self, flags: Flags) -> Flags:
        """Return whether a block of the group is flagged."""
        return self.largest(flags.astype(np.float64)) > 0

    def spread(self, values: Any) -> Any:
        """Return the value of its group, for each block; of one group the value alone, as (1,)."""
        return values if self.of is None else values[self.of]


@dataclass(frozen=True, eq=False)
class AnswerError:
    """Error of an answer.

    Attributes
    ----------
    errors : of each group, block or contact. floors : what rounding may make of them. absolute : whether the data give
    no size, so that the answer is compared as it is. strict : whether an error of 0, too, says nothing where rounding
    may exceed the tolerance. apart : the share by which the difference of
    two rows is missed that are nearly the same.
    """

    errors: Vector
    floors: Vector
    absolute: bool = False
    strict: bool = False
    apart: Vector | None = None

    @property
    def error(self) -> float:
        """The error of the answer; ∞ where one is no number."""
        return _largest(self.errors)

    @property
    def floor(self) -> float:
        """The largest error that rounding may make."""
        return _largest(self.floors)

    @property
    def ill_posed(self) -> Flags:
        """Return whether nothing is known of the difference of two rows that are nearly the same; of each problem."""
        return np.zeros(1, dtype=bool) if self.apart is None else self.apart > ILL_POSED

    def hidden(self, error: Any, floor: Any, tolerance: float) -> Any:
        """Return whether rounding decides of an error at a tolerance."""
        return np.isfinite(error) & (error <= floor) & ((error > tolerance) | (self.strict & (floor >= tolerance)))


def _largest(values: Vector) -> float:
    if not np.isfinite(values).all():  # max() would drop a NaN
        return math.inf
    return float(values.max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Caps:
    """Up to what rows are definite: (n,) by their constants, (nnz,) by the unknown of each of their entries."""

    constants: Vector
    entries: Vector


@dataclass(frozen=True, eq=False)
class Frame:
    """A problem without an answer.

    Attributes
    ----------
    block : (N,) the block of each unknown and of the row paired with it, rising from 0; None where each is its own.
    terms : sizes of the blocks of ∂f/∂x as CSR. constants : (k,) sizes of what else is in a row. signed : (N,) the same
        with signs, component by component; None where only the sizes are known.
    sets : what the unknowns are in.
    multiplier : (k,) whether an unknown is a multiplier. program : (k,) whether the rows of its part are the conditions
        of a program.
    certifying : whether multipliers are asked for as a certificate only: without an objective any will do.
    linear : whether all rows are linear, and the sets stay where they are.
    rows : the rows of a quadratic program, with their signs.
    by : sizes of entries by which units are found, where the terms of one answer do not tell them.
    caps : up to what rows are definite by what vanishes with an unknown that they say is 0.
    """

    terms: Any
    constants: Vector
    sets: Sets
    signed: Vector | None = None
    block: Any = None
    multiplier: Any = False
    program: Any = False
    certifying: bool = False
    rows: Any = None
    linear: bool = True
    by: Any = None
    caps: Caps | None = None

    @property
    def k(self) -> int:
        """Number of blocks."""
        return self.constants.size

    @cached_property
    def units(self) -> tuple[Vector, Vector]:
        """D and C, (k,): rows are compared times D, unknowns over C."""
        return equilibrate_apart(self.terms if self.by is None else self.by)

    @cached_property
    def alike(self) -> AlikeRows | None:
        """Rows that are nearly the same."""
        return None if self.rows is None else AlikeRows.of(self.rows, self.signed, *self.units)

    @cached_property
    def layout(self) -> Layout:
        """Layout of linear rows, the same for all answers."""
        return Layout.of_problems(self, Groups.one(self.k))

    def spread(self, values: Vector) -> Vector:
        """Return the values of blocks, for every unknown of each."""
        return values if self.block is None else values[self.block]

    def norms(self, x: Vector) -> Vector:
        """Return euclidean norm of every block."""
        return block_norms(x, self.block, self.k)

    def largest(self, values: Vector) -> Vector:
        """Return the largest of the values of every block, at least 0."""
        return np.maximum(values, 0.0) if self.block is None else largest_of(self.block, values, self.k)

    def block_sums(self, values: Vector) -> Vector:
        """Return the sum of the values of every block."""
        return values if self.block is None else np.bincount(self.block, values, self.k).astype(np.float64, copy=False)

    def any(self, flags: Flags) -> Flags:
        """Return whether any component of a block is flagged."""
        return flags if self.block is None else np.bincount(self.block, flags, self.k) > 0


@dataclass(frozen=True, eq=False)
class Layout:
    """Groups of linear rows that are measured together, and their units.

    Attributes
    ----------
    of : groups of blocks: the problems of programs; of what is no program each connected part, for units of their rows
        have nothing to do with each other.
    z : (k,) whether an unknown is none of the multipliers of a program. D, C : (k,) units of rows and unknowns.
    program, curved, constrained : (count,) whether rows are those of a program; z is in the gradient; there are
        multipliers.
    """

    of: Groups
    z: Flags
    D: Vector
    C: Vector
    program: Flags
    curved: Flags
    constrained: Flags

    @classmethod
    def of_problems(cls, frame: Frame, problem: Groups) -> Layout:
        """Find it for problems side by side."""
        flags = np.broadcast_to(frame.program, frame.k)
        other, of = problem.any(~flags), problem
        if other.any():
            flags, number = ~problem.spread(other) & np.ones(frame.k, bool), problem.spread(np.arange(problem.count))
            part = connected_components(frame.terms, directed=False)[1]
            label = np.unique(np.where(flags, number, problem.count + part), return_inverse=True)[1]
            of = Groups(label, int(label.max()) + 1, frame.k) if label.any() else Groups.one(frame.k)
        z, (D, C) = ~(frame.multiplier & flags), frame.units
        both = np.sqrt(D) * np.sqrt(C)
        D, C = np.where(flags, both, D), np.where(flags, both, C)
        curved = of.any(z & (frame.terms @ z.astype(np.float64) > 0))
        return cls(of, z, D, C, of.any(flags), curved, of.any(~z))


@dataclass(frozen=True, eq=False)
class System:
    """An answer with the rows of its problem.

    Attributes
    ----------
    frame : the problem. x, f : (N,) the unknowns and the values of the rows paired with them.
    also : residuals that must vanish beside f, each with the blocks of the rows by which they are measured.
    """

    frame: Frame
    x: Vector
    f: Vector
    also: tuple[Vector, Any] | None = None

    @cached_property
    def sizes(self) -> Vector:
        """(k,) sizes of the unknowns that reach the nearest point of the sets."""
        frame = self.frame
        sizes = frame.norms(self.x)
        if frame.sets.has_0:  # the nearest point is no larger
            return sizes
        return np.maximum(sizes, frame.norms(frame.sets.nearest(self.x)))

    @cached_property
    def fixed(self) -> Flags:
        """(k,) whether an unknown is at a bound that is not 0."""
        frame = self.frame
        return frame.any(frame.sets.anchored(self.x)) if frame.sets.moored else np.zeros(frame.k, dtype=bool)

    def distances(self, x_unit: Vector, f_unit: Vector) -> Vector:
        """Return the larger of the distances of x̂ from its set and of f̂ from the dual set, in units, by block."""
        frame = self.frame
        both = frame.sets.conditions(self.x, self.f, frame.spread(x_unit), frame.spread(f_unit))
        return frame.largest(both)

    def defect(self, x_unit: Vector, f_unit: Vector) -> Vector:
        """Return the norms of x̂ − P(x̂ − f̂), in units of the blocks."""
        frame = self.frame
        return frame.norms(frame.sets.defect(self.x, self.f, frame.spread(x_unit), frame.spread(f_unit)))


ROWS: NodeTable[Callable[[Any, Any], Any]] = NodeTable("rows for the judge")
"""Function of a problem and an answer that returns the answer as a `System`, or at its contacts (`contacts`)."""
STACKED: NodeTable[bool] = NodeTable("verdicts as arrays")
"""Nodes of which many answers are judged in one go (`stacked`)."""
_FRAMES: WeakKeyDictionary[Problem, Any] = WeakKeyDictionary()


def kept(problem: Problem, make: Callable[[], Any]) -> Any:
    """Return what is the same for all answers to a problem, made once."""
    if problem not in _FRAMES:
        _FRAMES[problem] = make()
    return _FRAMES[problem]


def term_sizes(matrix: Any) -> Any:
    """Return the sizes of the entries of a matrix as CSR; zeros that are stored are no terms, and join no parts."""
    sizes = sp.csr_array(abs(matrix))
    sizes.eliminate_zeros()
    return sizes


def block_sizes(matrix: Any, block: Any) -> Any:
    """Return the Frobenius norms of the blocks of a square matrix as CSR, those of stored zeros, too; the numbers of
    blocks rise from 0."""
    entries, k = sp.coo_array(matrix), int(block[-1]) + 1 if len(block) else 0
    rows, columns = entries.coords
    return sp.csr_array(sp.coo_array((entries.data**2, (block[rows], block[columns])), shape=(k, k))).sqrt()


def largest_of(group: Any, values: Vector, count: int) -> Vector:
    """Return the largest of the nonnegative values of every group, 0 of an empty one."""
    result = np.zeros(count)
    np.maximum.at(result, group, values)
    return result


def block_norms(x: Vector, block: Any, k: int) -> Vector:
    """Return euclidean norm of every block."""
    if block is None or k == x.size:
        return np.abs(x)
    return np.sqrt(np.bincount(block, x * x, k))


# -------------------------------------------------------------------------------------------------- rows that are alike
# Rows of a program that are nearly the same, and what follows of their difference.
#
# Where aᵀz = b and (a + δd)ᵀz ≥ b + δc, dᵀz ≥ c follows, exactly. An answer that misses the second row by ε of its
# terms may miss this by ε/δ of its own: as a solution of data that are changed by ε it is right, and of the data as
# they are it has no digit. Such an answer is named, not accepted; one that keeps the difference is as good as any.

ALIKE = 1e-2
"""Share of their length by which rows that are nearly the same differ at most."""
BESIDE = 4
"""Rows are compared with so many that follow where they are sorted by their products with one vector."""
ROUNDING, SAME = 8.0 * float(np.finfo(np.float64).eps), 64.0 * float(np.finfo(np.float64).eps)
"""Share of its terms that rounding may make of a row; of their length by which rows differ that are the same."""


@dataclass(frozen=True, eq=False)
class AlikeRows:
    """Pairs of rows, brought to units, to length 1 and to one side.

    Attributes
    ----------
    first, second : (p,) their numbers. by_first, by_second : (p,) times which they are taken. difference : (p, n) sizes
        of the entries of the second less the first, of unknowns as they are. constant : (p,) that of their constants.
    """

    first: Any
    second: Any
    by_first: Vector
    by_second: Vector
    difference: Any
    constant: Vector

    @classmethod
    def of(cls, G: Any, signed: Any, D: Vector, C: Vector) -> AlikeRows | None:
        """Find them among the rows of G; None where there are none.

        Parameters
        ----------
        signed : constants of the gradient and of the rows. D, C : units of rows and of unknowns.
        """
        m, n = G.shape
        scaled = sp.csr_array(sp.diags_array(D[n:]) @ G @ sp.diags_array(C[:n]))
        length = np.sqrt(np.asarray(scaled.multiply(scaled).sum(axis=1)).ravel())
        unit = np.divide(1.0, length, out=np.zeros(m), where=length > 0)
        along = unit * (scaled @ np.random.default_rng(0).standard_normal(n))
        unit, order = np.copysign(unit, along), np.argsort(np.abs(along))
        scaled, along = sp.csr_array(sp.diags_array(unit) @ scaled), np.abs(along)[order]
        near = [np.flatnonzero(along[k:] - along[:-k] <= ALIKE * np.sqrt(n)) for k in range(1, min(BESIDE, m - 1) + 1)]
        i = np.concatenate([order[:0], *(order[at] for at in near)])
        j = np.concatenate([order[:0], *(order[at + k + 1] for k, at in enumerate(near))])
        apart = np.sqrt(np.asarray((scaled[i] - scaled[j]).power(2).sum(axis=1)).ravel())
        some = (apart <= ALIKE) & (apart > SAME) & (unit[i] != 0) & (unit[j] != 0)
        if not some.any():
            return None
        i, j, factor = i[some], j[some], unit * D[n:]
        difference = abs(sp.csr_array((scaled[j] - scaled[i]) @ sp.diags_array(1.0 / C[:n])))
        constant = np.abs(factor[j] * signed[n + j] - factor[i] * signed[n + i])
        return cls(i, j, factor[i], factor[j], difference, constant)

    def missed(self, z: Vector, rows: Vector, sums: Vector, equality: Any) -> Vector:
        """Return the share of its own terms by which each difference is missed, beyond rounding; shape (p,).

        Parameters
        ----------
        z : (n,). rows, sums : (m,) values of the rows, ≥ 0 or where `equality` says so 0, and sizes of their terms.
        """
        one, other = self.by_first * rows[self.first], self.by_second * rows[self.second]
        equal, also_equal = equality[self.first], equality[self.second]
        at_least = (equal | (self.by_first < 0)) & (also_equal | (self.by_second > 0))
        at_most = (equal | (self.by_first > 0)) & (also_equal | (self.by_second < 0))
        missed = np.maximum(np.where(at_least, one - other, 0.0), np.where(at_most, other - one, 0.0))
        noise = np.abs(self.by_first) * sums[self.first] + np.abs(self.by_second) * sums[self.second]
        missed, terms = missed - ROUNDING * noise, self.difference @ np.abs(z) + self.constant
        return np.divide(missed, terms, out=np.zeros_like(terms), where=(terms > 0) & (missed > 0))
