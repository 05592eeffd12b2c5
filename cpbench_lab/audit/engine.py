"""What the audit knows of an engine: the problem of each step in the engine's own law, and the engine's answer to it.

An engine is a class that is registered, in a module of `engines` or in a plugin (`cpbench --plugin`). Its law is a
formulation of cpbench, so that the verdict on its answer is that of every answer.
"""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cpbench.errors import Unavailable
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.local_contact import FCPoint, FrictionContact
from cpbench.foundation.matrices import Dense, Vector
from cpbench.registry import Registry


@dataclass(frozen=True, eq=False)
class EngineStep:
    """A step of an engine.

    Attributes
    ----------
    problem, answer : in the engine's own law. converged : whether it said so, None where it says nothing.
    iterations : of its solver. contacts, reactions : the same contacts under Coulomb's law with the impulses of the
    engine [N s], such that Wr + q are the velocities after the step [m/s]; None where no fc has them. owners : (n,) of
    each number of the answer its contact, or −1 − b of body b.
    """

    problem: Problem
    answer: Point
    converged: bool | None
    iterations: int
    contacts: FrictionContact | None
    reactions: FCPoint
    owners: NDArray[np.int64]


class Engine(ABC):
    """An engine with one scene, at its state after the steps that were taken.

    Attributes
    ----------
    package : to be imported. law : in words. version : of the package. dt : step [s]. names : of the bodies.
    """

    package: ClassVar[str]
    law: ClassVar[str]
    version: str
    dt: float
    names: list[str]

    @abstractmethod
    def __init__(self, scene: Path, options: Mapping[str, str]) -> None:
        """Load a scene; raises NotApplicable where engine or law do not have it, CpbenchError on an option."""

    @abstractmethod
    def step(self) -> EngineStep:
        """Take a step and return its problem and answer."""


engines: Registry[type[Engine]] = Registry("engine", "cpbench_lab.audit.engines")


def package(name: str, install: str = "") -> Any:
    """Return a package; raises Unavailable where it is not installed. `install` : what pip installs, if not `name`."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise Unavailable("missing", f"{name} is not installed: pip install {install or name}") from None


def under_coulomb(
    M: Dense, J: Dense, v: Vector, r: Vector, mu: Vector, gap_rate: Vector
) -> tuple[FrictionContact, FCPoint]:
    """Return contacts with Wr + q = Jv, W = JM⁻¹Jᵀ, and the reactions.

    Parameters
    ----------
    M : (nv, nv). J : (3 nc, nv), normal first. v : (nv,) after the step. r : (3 nc,) [N s]. mu : (nc,).
    gap_rate : (nc,) by which an open contact may close within the step [m/s].
    """
    W = J @ np.linalg.solve(M, J.T) if J.size else np.zeros((0, 0))
    u = J @ v
    u[::3] += gap_rate
    return FrictionContact(W=0.5 * (W + W.T), q=u - 0.5 * (W + W.T) @ r, mu=mu), FCPoint(r=r)
