"""Contracts of the nodes: a problem is frozen data, a point is an answer, residuals are what we measure.

A point carries the independent unknowns only. Slacks (w of an LCP, u of a contact problem) are always
recomputed from them, so that a stored or claimed slack can never flatter an answer.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import cache, cached_property
from types import MappingProxyType
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np

from cpbench.errors import PointError, ProblemError
from cpbench.formulations.expressions import Map
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.registry import Registry

Trace: TypeAlias = Mapping[str, Any]
"""Data that a conversion keeps for the way back: named matrices, vectors, factorizations, numbers and strings (what
the native storage can write with a converted file)."""


Term: TypeAlias = tuple[str, int, str, str]
"""Vector of the data, sign, matrix (`Aᵀ` for its transpose) and part of the answer: b, -1, A, z says b − Az."""


ANNOTATIONS = frozenset({"name", "info", "provenance", "sequence", "contacts"})
"""Fields that say where a problem is from: no solver looks at them, and they are no part of its mathematics."""


class Kind(StrEnum):
    """Promise of a conversion, or of a solver that drops a term; from the strongest to the weakest."""

    EQUIVALENT = "equivalent"
    """The solution sets correspond, both ways."""
    ONE_WAY = "one-way"
    """Every solution of the target lifts to a solution of the source; the target may have fewer."""
    NECESSARY = "necessary"
    """Source solutions appear among the target's; a lifted answer may still fail on the source."""
    APPROXIMATE = "approximate"
    """The error goes to 0 with a knob (facets)."""
    RELAXATION = "relaxation"
    """The target drops a term of the law."""

    @property
    def rank(self) -> int:
        return list(Kind).index(self)

    @property
    def exact(self) -> bool:
        """Whether default routes may use it."""
        return self in (Kind.EQUIVALENT, Kind.ONE_WAY)


def matrix_field(rows: str, cols: str, *, optional: bool = False) -> Any:
    """Declare a matrix of the problem; the symbols are its dimensions, shared with other fields, or fixed numbers.

    An optional one may be left out: it is zero, and a dimension that no earlier field has is 0.
    """
    metadata = {"shape": (rows, cols)}
    return field(default=None, metadata=metadata) if optional else field(metadata=metadata)


def vector_field(size: str, *, finite: bool = True, fill: float | None = None) -> Any:
    """Declare a vector of the problem; `finite=False` admits infinite bounds (never NaN).

    One with a `fill` may be left out: all its numbers are `fill`, as many as earlier fields say, or none.
    """
    metadata = {"shape": (size,), "finite": finite, "fill": fill}
    return field(metadata=metadata) if fill is None else field(default=None, metadata=metadata)


def map_field(rows: str, cols: str, *, optional: bool = False) -> Any:
    """Declare a nonlinear map of the problem, with its dimensions (`2n`: twice n); an optional one left out has no
    rows."""
    return field(default=None, metadata={"map": (rows, cols)}) if optional else field(metadata={"map": (rows, cols)})


def point_field(size: str, *, optional: bool = False) -> Any:
    """Declare a part of an answer, with the dimension of the problem that is its length; an optional one is empty where
    it is left out."""
    metadata = {"size": size}
    return field(default_factory=lambda: np.zeros(0), metadata=metadata) if optional else field(metadata=metadata)


@dataclass(frozen=True)
class Info:
    """Origin of a problem and facts known of it; not part of its mathematics."""

    title: str = ""
    description: str = ""
    math_info: str = ""
    source: str = ""
    licence: str = ""
    family: str = ""
    citation: str = ""
    properties: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Step:
    """One conversion a problem has gone through: enough to lift an answer, in another process.

    `parameters` are the conversion's fields, `source` is the fingerprint of the problem before it.
    """

    conversion: str
    parameters: Mapping[str, Any]
    kind: str
    source_node: str
    source: str
    trace: Trace


@dataclass(frozen=True)
class Sequence:
    """Place of a problem in a scene: its step, time [s], step size [s], fingerprint of the step before."""

    name: str
    step: int
    time: float
    dt: float
    previous: str = ""


@dataclass(frozen=True, eq=False)
class Contacts:
    """Facts known of nc contacts, in the order of the problem's rows; a part that is not known is empty.

    Attributes
    ----------
    id : (nc,) int64, the same contact keeps its id over the steps of a sequence.
    bodies : (nc, 2) int64. position : (nc, 3) [m]. frame : (nc, 3, 3), rows are normal, tangent, tangent.
    """

    id: np.ndarray[Any, np.dtype[np.int64]] = field(default_factory=lambda: np.zeros(0, np.int64))
    bodies: np.ndarray[Any, np.dtype[np.int64]] = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    position: matrices.Dense = field(default_factory=lambda: np.zeros((0, 3)))
    frame: np.ndarray[Any, np.dtype[np.float64]] = field(default_factory=lambda: np.zeros((0, 3, 3)))

    def __post_init__(self) -> None:
        nc = self.count
        for name, dtype, rest in _CONTACT_PARTS:
            given = np.asarray(getattr(self, name))
            array = np.array(given, dtype=dtype)
            if dtype is np.int64 and not (array == given).all():
                raise ProblemError(f"contacts.{name}", "holds numbers that are not whole")
            if array.shape not in ((nc, *rest), (0, *rest)):
                raise ProblemError(f"contacts.{name}", f"has shape {array.shape}, expected {(nc, *rest)}")
            object.__setattr__(self, name, matrices.freeze(array))

    @property
    def count(self) -> int:
        """nc, by the first part that is known."""
        return next((len(part) for name, _, _ in _CONTACT_PARTS if len(part := getattr(self, name))), 0)

    def knows(self, name: str) -> bool:
        """Return whether the part of this name is known."""
        return len(getattr(self, name)) == self.count


_CONTACT_PARTS: tuple[tuple[str, type[np.int64 | np.float64], tuple[int, ...]], ...] = (
    ("id", np.int64, ()),
    ("bodies", np.int64, (2,)),
    ("position", np.float64, (3,)),
    ("frame", np.float64, (3, 3)),
)


_FLOAT = np.dtype(np.float64)


@cache
def _parts(point: type) -> tuple[str, ...]:
    """Return the names of the vectors of an answer, in order."""
    return tuple(f.name for f in fields(point))


@dataclass(frozen=True, eq=False)
class Point:
    """Base of the answers: a dataclass of vectors. Values may be non-finite: a bad answer is still an answer."""

    def __post_init__(self) -> None:
        for name in _parts(type(self)):
            value = getattr(self, name)
            # written out, for small problems spend as long on their answer as on solving
            plain = type(value) is np.ndarray and value.ndim == 1 and value.dtype is _FLOAT
            vector = matrices.freeze(value.copy()) if plain else self._vector(name, value)
            object.__setattr__(self, name, vector)

    def _vector(self, name: str, value: Any) -> Vector:
        label = f"{type(self).__name__}.{name}"
        try:
            return matrices.vector(np.ravel(value), label, finite=False)
        except (ProblemError, ValueError) as cause:
            raise PointError(f"{label}: {cause}") from None

    def arrays(self) -> dict[str, Vector]:
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def vector(self) -> Vector:
        """All numbers, part by part, shape (N,): what `Problem.point_from_vector` splits."""
        return np.concatenate([np.zeros(0), *self.arrays().values()])

    @property
    def finite(self) -> bool:
        return all(bool(np.isfinite(v).all()) for v in self.arrays().values())


@dataclass(frozen=True)
class Residuals:
    """Measurements of an answer.

    Attributes
    ----------
    measured : scaled numbers by which solvers stop: all at most their tolerance (NaN counts as infinity). The verdict
    of a run is another number, by its own code (`cpbench.verification`).
    parts : further numbers for the reader, units in the name where they have any.
    flags : remarks such as ``absolute`` (a scale was 0).
    """

    measured: Mapping[str, float]
    parts: Mapping[str, float] = field(default_factory=dict)
    flags: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("measured", "parts"):
            clean = {k: math.inf if math.isnan(v) else float(v) for k, v in getattr(self, name).items()}
            object.__setattr__(self, name, MappingProxyType(clean))

    def __reduce__(self) -> Any:
        return (Residuals, (dict(self.measured), dict(self.parts), self.flags))

    @property
    def error(self) -> float:
        """The largest measured number: a solver that is asked for ε may stop when this is at most ε."""
        return max(self.measured.values(), default=0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Problem(ABC):
    """A node of the graph. Subclasses declare their data with `matrix_field` and `vector_field`.

    Raises ProblemError when shapes disagree, an entry is NaN or infinite, or a condition of the node fails.
    """

    node: ClassVar[str]
    core: ClassVar[bool] = False
    """Whether a newcomer meets it first: the core of the lecture, and contact, local and global."""
    title: ClassVar[str]
    equation: ClassVar[str]
    relations: ClassVar[tuple[str, ...]]
    """The problem in formulas, one relation a line."""
    point_type: ClassVar[type[Point]]
    primal: ClassVar[str] = ""
    """The unknowns among the parts of a point whose other parts are multipliers; "" where there are no multipliers."""
    terms: ClassVar[tuple[Term, ...]] = ()
    """The products of its affine rows; () where rows are nonlinear."""

    notebook_view: ClassVar[Callable[[Any], str] | None] = None
    """Makes the HTML that a notebook shows, where something above has set it: pictures are not made down here."""

    name: str = ""
    info: Info = field(default_factory=Info)
    provenance: tuple[Step, ...] = ()

    def __init_subclass__(cls) -> None:
        if "__repr__" not in vars(cls):
            cls.__repr__ = Problem.__repr__  # else each dataclass makes one that prints all of its matrices

    def __repr__(self) -> str:
        about = [repr(self.name)] if self.name else []
        about += [f"{symbol} = {size}" for symbol, size in self.sizes().items()]
        return f"<{type(self).__name__} {', '.join(about)}>"

    def _repr_html_(self) -> str | None:
        return None if Problem.notebook_view is None else Problem.notebook_view(self)

    def __post_init__(self) -> None:
        sizes: dict[str, int] = {}
        origin: dict[str, str] = {}
        for f in fields(self):
            if not {"shape", "map"} & f.metadata.keys():
                continue
            label = f"{self.node}.{f.name}"
            shape = f.metadata.get("shape") or f.metadata["map"]
            value: Any = getattr(self, f.name)
            if value is None:
                value = self._left_out(f, sizes)
            if "map" in f.metadata:
                if not isinstance(value, Map):
                    raise ProblemError(label, f"is a {type(value).__name__}, expected a Map")
            elif len(shape) == 2:
                value = matrices.matrix(value, label)
            else:
                value = matrices.vector(value, label, finite=f.metadata["finite"])
                if np.isnan(value).any():
                    raise ProblemError(label, f"is NaN at {int(np.flatnonzero(np.isnan(value))[0])}")
            for symbol, size in zip(shape, value.shape, strict=True):
                if symbol[0].isdigit():
                    if size != counted(symbol, sizes):
                        raise ProblemError(label, f"has shape {value.shape}, expected {' x '.join(shape)}")
                elif sizes.setdefault(symbol, size) != size:
                    raise ProblemError(
                        label,
                        f"has shape {value.shape}, but {symbol} = {sizes[symbol]} from {origin[symbol]}",
                    )
                origin.setdefault(symbol, label)
            object.__setattr__(self, f.name, value)
        values = self.parameters
        for name, F in self.maps().items():
            for key, value in F.parameters.items():
                if value != values[key]:
                    raise ProblemError(f"{self.node}.{name}", f"has {key} = {value:g}, another map {values[key]:g}")
        self.check()

    def _left_out(self, f: dataclasses.Field[Any], sizes: Mapping[str, int]) -> Matrix | Vector | Map:
        """Return what an optional field is when it is not given."""
        if "map" in f.metadata:
            return Map.empty(counted(f.metadata["map"][1], sizes))
        shape = tuple(sizes.get(symbol, 0) for symbol in f.metadata["shape"])
        if len(shape) == 1:
            if f.metadata["fill"] is None:
                raise ProblemError(f"{self.node}.{f.name}", "is missing")
            return np.full(shape, f.metadata["fill"])
        given = (getattr(self, g.name) for g in self._data_fields() if len(g.metadata["shape"]) == 2)
        like = next((value for value in given if value is not None), np.zeros((0, 0)))
        return matrices.zeros(shape[0], shape[1], like)

    def check(self) -> None:
        """Check conditions beyond shapes; raises ProblemError."""

    @classmethod
    def _data_fields(cls) -> list[dataclasses.Field[Any]]:
        return [f for f in fields(cls) if "shape" in f.metadata]

    def data(self) -> dict[str, Matrix | Vector]:
        """Return the matrices and vectors by name, in the order of the definition."""
        return {f.name: getattr(self, f.name) for f in self._data_fields()}

    @classmethod
    @cache
    def shapes(cls) -> Mapping[str, tuple[str, ...]]:
        """Return the dimensions of each matrix, vector and map, as they are declared, by name."""
        return {
            f.name: f.metadata.get("shape") or f.metadata["map"]
            for f in fields(cls)
            if {"shape", "map"} & f.metadata.keys()
        }

    @classmethod
    def has_maps(cls) -> bool:
        """Return whether nonlinear maps belong to its data."""
        return any("map" in f.metadata for f in fields(cls))

    def maps(self) -> dict[str, Map]:
        """Return the nonlinear maps by name, in the order of the definition."""
        return {f.name: getattr(self, f.name) for f in fields(self) if "map" in f.metadata}

    def settings(self) -> dict[str, Any]:
        """Return the fields that are neither numbers, maps nor annotations (dimension), in order of name."""
        names = {f.name for f in fields(self)} - self.data().keys() - self.maps().keys() - ANNOTATIONS
        return {name: getattr(self, name) for name in sorted(names)}

    @property
    def parameters(self) -> dict[str, float]:
        """The named parameters of the maps, with their values."""
        return {name: value for F in self.maps().values() for name, value in F.parameters.items()}

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """Return the problem in which these parameters have other values; what was known of this one is left out, and
        how it was made. Raises ProblemError on a name that is none of them."""
        unknown = sorted(values.keys() - self.parameters.keys())
        if unknown:
            has = ", ".join(self.parameters) or "no parameters"
            raise ProblemError(self.node, f"has no parameter {unknown[0]}: it has {has}")
        for name, value in values.items():
            if not np.isfinite(value):
                raise ProblemError(self.node, f"cannot have {name} = {value}, expected a finite number")
        maps = {name: F.with_parameters(values) for name, F in self.maps().items()}
        info = dataclasses.replace(self.info, properties={})
        return dataclasses.replace(self, info=info, provenance=(), **maps)

    def sizes(self) -> dict[str, int]:
        """Return the dimensions by symbol: n unknowns, m rows, nc contacts, and others that the fields name."""
        return dict(self._sizes)

    @cached_property
    def _sizes(self) -> dict[str, int]:
        sizes: dict[str, int] = {}
        for f in fields(self):
            shape = f.metadata.get("shape") or f.metadata.get("map", ())
            for symbol, size in zip(shape, getattr(self, f.name).shape if shape else (), strict=True):
                if not symbol[0].isdigit():
                    sizes.setdefault(symbol, size)
        return sizes

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the mathematics (32 hex digits): not of the name, nor of how matrices are stored."""
        h = hashlib.sha256(f"cpbench {self.node};".encode())
        for name, value in self.data().items():
            h.update(f"{name}:".encode() + matrices.digest(value))
        for name, value in self.maps().items():
            h.update(f"{name}:".encode() + value.digest)
        return h.hexdigest()[:32]

    @property
    def point_sizes(self) -> dict[str, int]:
        """Length of every part of an answer, in order."""
        return {f.name: self._sizes.get(f.metadata["size"], 0) for f in fields(self.point_type)}

    def residuals(self, point: Any, tolerance: float = 1e-6) -> Residuals:
        """Return `measure` of an answer; raises PointError unless it has this problem's unknowns."""
        self.check_point(point)
        with np.errstate(all="ignore"):
            return self.measure(point, tolerance)

    @abstractmethod
    def measure(self, point: Any, tolerance: float) -> Residuals:
        """Measure `point` on this problem; `tolerance` only tells noise from motion in the readable parts."""

    def slacks(self, point: Any) -> dict[str, Vector]:
        """Return the dependent parts of an answer (w, u, ...), recomputed from `point`."""
        return {}

    def certifies_infeasibility(self, certificate: Vector) -> bool:
        """Return whether `certificate` excludes every solution, to rounding: enough for a solver's claim, and no
        proof."""
        return False

    def check_point(self, point: Any) -> None:
        """Raise PointError unless `point` has this problem's unknowns."""
        if not isinstance(point, self.point_type):
            raise PointError(
                f"{self.node}: the answer is a {type(point).__name__}, expected {self.point_type.__name__}"
            )
        for name, size in self.point_sizes.items():
            got = getattr(point, name).size
            if got != size:
                raise PointError(f"{self.node}: the answer's {name} has {got} numbers, expected {size}")

    def point_from_vector(self, x: Any) -> Any:
        """Split a plain vector (parts one after the other) into a point; raises PointError on its length."""
        try:
            x = matrices.vector(np.ravel(x), "answer", finite=False)
        except (ProblemError, TypeError, ValueError) as cause:
            raise PointError(f"{self.node}: the answer is not a vector of numbers ({cause})") from None
        sizes = self.point_sizes
        if x.size != sum(sizes.values()):
            expected = " + ".join(f"{size} ({name})" for name, size in sizes.items())
            raise PointError(f"{self.node}: the answer has {x.size} numbers, expected {expected}")
        parts: dict[str, Vector] = {}
        at = 0
        for name, size in sizes.items():
            parts[name] = x[at : at + size]
            at += size
        return self.point_type(**parts)

    def zero_point(self) -> Any:
        """Return the point of this problem whose numbers are all 0."""
        return self.point_type(**{name: np.zeros(size) for name, size in self.point_sizes.items()})


def counted(symbol: str, sizes: Mapping[str, int]) -> int:
    """Return what a dimension is: `3`, `n` or `2n`, n being 0 where no earlier field has it."""
    digits = len(symbol) - len(symbol.lstrip("0123456789"))
    unit = sizes.get(symbol[digits:], 0) if digits < len(symbol) else 1
    return int(symbol[:digits] or 1) * unit


formulations: Registry[type[Problem]] = Registry("formulation", "cpbench.formulations")


def scaled(value: float, *scales: float) -> float:
    """Return value / max(scales); the value itself when they are all 0 (the error is then absolute)."""
    scale = max(scales, default=0.0)
    return value / scale if scale > 0 else value


def squared(value: float) -> float:
    """Return value², ∞ where that is not a number any more: Python's own power raises OverflowError."""
    return value * value
