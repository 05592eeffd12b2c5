"""Contract of the edges: a conversion is a stateless value that applies to a problem and lifts answers back."""

from __future__ import annotations

import dataclasses
import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, TypeVar, dataclass_transform

import numpy as np

from cpbench.errors import NotApplicable, UnknownName
from cpbench.formulations.base import Kind, Point, Problem, Step, Trace, formulations
from cpbench.foundation.matrices import index_dtype
from cpbench.registry import Registry


@dataclasses.dataclass(frozen=True)
class Size:
    """Upper bound of what a conversion will make.

    Attributes
    ----------
    rows : of the target's matrices, exactly. entries : that they store. bytes : that they take.
    """

    rows: int
    entries: int
    bytes: int

    @classmethod
    def dense(cls, rows: int, columns: int) -> Size:
        """Return the size of a dense matrix of float64."""
        return cls(rows, rows * columns, 8 * rows * columns)

    @classmethod
    def sparse(cls, rows: int, columns: int, entries: int) -> Size:
        """Return the size of a CSR matrix, whose indices have 4 bytes as long as they fit."""
        index = np.dtype(index_dtype(rows, columns, entries)).itemsize
        return cls(rows, entries, entries * (8 + index) + (rows + 1) * index)

    def __str__(self) -> str:
        """Format as `1045440 rows, 101020986 entries, 1.2 GB at most`."""
        unit, name = (1e9, "GB") if self.bytes >= 1e9 else (1e6, "MB") if self.bytes >= 1e6 else (1e3, "kB")
        return f"{self.rows} rows, {self.entries} entries, {self.bytes / unit:.3g} {name} at most"


class Conversion(ABC):
    """One edge. Subclasses are frozen dataclasses whose fields are the knobs (facets, angle); their docstring has the
    mathematics under the words Source, Target, Lift, Push, Kind, then the knobs and what the trace holds.

    Attributes
    ----------
    name : registry name, `source-target` or `source-target-how`.
    source, target : node names. equation : where the formula stands. kind : the promise, weakest case; an edge whose
        promise depends on the problem overrides `exactness` and `reservation`, and names its strongest one in
        `best_kind` and others in `between`.
    cost : what Dijkstra adds up; grows with the size of the result, ties go by name.
    """

    name: ClassVar[str]
    source: ClassVar[str]
    target: ClassVar[str]
    equation: ClassVar[str] = ""
    kind: ClassVar[Kind]
    between: ClassVar[tuple[Kind, ...]] = ()
    cost: ClassVar[float]

    def exactness(self, problem: Any) -> Kind:
        """Return the promise for this very problem (stronger than `kind` where a condition holds)."""
        return self.kind

    def reservation(self, problem: Any) -> str:
        """Return why the promise for this problem is weaker than `best_kind`: the condition and its number."""
        return ""

    def obstacle(self, problem: Any) -> str | None:
        """Return why this problem cannot take the edge, with the measured number and what to use instead; else None."""
        return None

    def predict(self, problem: Any) -> Size | None:
        """Return the size of what `apply` will make of a problem that can take the edge, without making it; None: not
        known before.
        """
        return None

    @abstractmethod
    def apply(self, problem: Any) -> tuple[Problem, Trace]:
        """Return the converted problem and what `lift` needs; raises NotApplicable with the obstacle."""

    @abstractmethod
    def lift(self, point: Any, trace: Trace) -> Any:
        """Return the source answer, a point of `source`, that a target answer stands for; `trace` : from `apply`."""

    def push(self, point: Any, trace: Trace) -> Any:
        """Return the target answer of a source answer (warm starts, tests); raises NotApplicable where there is
        none.
        """
        raise NotApplicable(self.label, "has no push: target answers cannot be made from source answers")

    def remark(self, point: Any, trace: Trace) -> str:
        """Return what should be known of this answer to the target before its lift is trusted; mostly nothing."""
        return ""

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Return the tolerance on the target with which the lifted answer meets `tolerance` on the source.

        What depends on the problem, `apply` has put into the trace: `shift` where terms cancel on the way back
        (`bounds.amplification`).
        """
        return tolerance / trace.get("shift", 1.0)

    @property
    def parameters(self) -> dict[str, Any]:
        """The knobs by name."""
        return (
            {f.name: getattr(self, f.name) for f in dataclasses.fields(self)} if dataclasses.is_dataclass(self) else {}
        )

    @property
    def label(self) -> str:
        """Name with the knobs that differ from their defaults: `fc-lcp-inner[facets=16]`."""
        if not dataclasses.is_dataclass(self):
            return self.name
        changed = [
            f"{f.name}={getattr(self, f.name)}" for f in dataclasses.fields(self) if getattr(self, f.name) != f.default
        ]
        return f"{self.name}[{','.join(changed)}]" if changed else self.name

    def require(self, problem: Problem) -> None:
        """Raise NotApplicable when there is an obstacle."""
        why = self.obstacle(problem)
        if why is not None:
            raise NotApplicable(self.label, why)

    def step(self, problem: Problem) -> Problem:
        """Apply the conversion; the result has the step in its provenance, and the name and geometry of the source.

        Raises NotApplicable, as `apply`.
        """
        converted, trace = self.apply(problem)
        done = Step(
            conversion=self.name,
            parameters=self.parameters,
            kind=str(self.exactness(problem)),
            source_node=problem.node,
            source=problem.fingerprint,
            trace=trace,
        )
        extra: dict[str, Any] = {"name": problem.name, "info": problem.info}
        names = {f.name for f in dataclasses.fields(converted)} & {f.name for f in dataclasses.fields(problem)}
        extra |= {k: getattr(problem, k) for k in names & {"sequence", "contacts"}}
        return dataclasses.replace(converted, **extra, provenance=(*problem.provenance, done))


class SameUnknowns(Conversion):
    """Conversion to a problem with the same unknowns: answers are handed over part by part.

    Attributes
    ----------
    renamed : parts of a source's answer that have another name in the target's. A part that only one of the two has
        is empty where it is made.
    """

    renamed: ClassVar[Mapping[str, str]] = {}

    def lift(self, point: Point, trace: Trace) -> Any:
        return _handed_over(point, formulations.get(self.source).point_type, self.renamed)

    def push(self, point: Point, trace: Trace) -> Any:
        back = {theirs: mine for mine, theirs in self.renamed.items()}
        return _handed_over(point, formulations.get(self.target).point_type, back)


def _handed_over(point: Point, point_type: type[Point], renamed: Mapping[str, str]) -> Point:
    parts, names = point.arrays(), [f.name for f in dataclasses.fields(point_type)]
    return point_type(**{name: parts.get(renamed.get(name, name), np.zeros(0)) for name in names})


conversions: Registry[type[Conversion]] = Registry("conversion", "cpbench.conversions")
AnEdge = TypeVar("AnEdge", bound=Conversion)


@dataclass_transform(frozen_default=True)
def edge(
    name: str, *, equation: str | None = None, kind: Kind | None = None, cost: float | None = None
) -> Callable[[type[AnEdge]], type[AnEdge]]:
    """Return a decorator that makes a class a frozen dataclass and registers it as a conversion.

    Parameters
    ----------
    name : begins with the nodes, `source-target`. equation, kind, cost : as the attributes of `Conversion`; what is
        left out is that of the base class.
    """

    def register(cls: type[AnEdge]) -> type[AnEdge]:
        cls.name = name
        cls.source, cls.target = name.split("-")[:2]
        given = {"equation": equation, "kind": kind, "cost": cost}
        for attribute, value in given.items():
            if value is not None:
                setattr(cls, attribute, value)
        conversions.add(name, conversion := dataclasses.dataclass(frozen=True)(cls))
        return conversion

    return register


def make(name: str, parameters: dict[str, Any] | None = None) -> Conversion:
    """Return the registered conversion `name` with its knobs set; raises UnknownName on a knob it does not have."""
    cls = conversions.get(name)
    given = dict(parameters or {})
    accepted = {f.name for f in dataclasses.fields(cls)} if dataclasses.is_dataclass(cls) else set[str]()
    for key in given:
        if key not in accepted:
            raise UnknownName(f"parameter of {name}", key, accepted)
    return cls(**given)


def mathematics(cls: type[Conversion]) -> list[str]:
    """Return the lines of a conversion's docstring: headline, source, target, lift, push, kind, knobs and trace."""
    return inspect.cleandoc(cls.__doc__ or "").splitlines()


def lift_step(step: Step, point: Any) -> Any:
    """Return the answer before one recorded step of a provenance, from the answer `point` after it.

    Raises UnknownName where the conversion of that step is not registered.
    """
    return make(step.conversion, dict(step.parameters)).lift(point, step.trace)


def find_via(text: str) -> list[str]:
    """Return the conversions that `text` names: a full name, or the last part of one (`inner`, `schur`).

    Raises UnknownName with the nearest names.
    """
    names = conversions.names()
    if text in names:
        return [text]
    result = [name for name in names if name.split("-", 2)[2:] == [text]]
    if not result:
        ends = {name.split("-", 2)[2] for name in names if name.count("-") >= 2}
        raise UnknownName("conversion", text, {*names, *ends})
    return result
