"""Steps of a simulation as one file, whose problems know their place: `cpbench run --start previous` follows them."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.base import Contacts, Sequence
from cpbench.formulations.contact import ContactProblem
from cpbench.storage import save_pack


class Recorder:
    """A recording of the contact problems of a simulation, step by step, for one file.

    >>> import cpbench
    >>> recorder = cpbench.Recorder("slide", dt=1e-3)
    >>> for push in (1.0, 1.1):
    ...     recorder.add(cpbench.FrictionContact(W=np.eye(3), q=[-push, 0.1, 0.0], mu=[0.5]), ids=[7])
    >>> [(step.name, step.sequence.step, step.sequence.time) for step in recorder.steps]
    [('step-000', 0, 0.0), ('step-001', 1, 0.001)]

    `recorder.save("slide.h5")` writes them; ids, the same for the same contact in all steps, let a solver start from
    its answer to the step before where contacts come and go.
    """

    def __init__(self, name: str, dt: float) -> None:
        if not 0.0 < dt < math.inf:
            raise ProblemError("sequence.dt", f"is {dt}, expected a number of seconds above 0")
        self.name, self.dt = name, dt
        self.steps: list[ContactProblem] = []

    def add(
        self,
        problem: ContactProblem,
        *,
        ids: Any = None,
        positions: Any = None,
        bodies: Any = None,
        frames: Any = None,
        time: float | None = None,
    ) -> None:
        """Add the next step, at `time` or `dt` after the last; raises ProblemError when it does not fit.

        ids (nc,), positions (nc, 3) [m], bodies (nc, 2) and frames (nc, 3, 3) are of its contacts, in the order of its
        rows; without any, those that the problem has stay.
        """
        k = len(self.steps)
        place = f"step {k}"
        if not isinstance(problem, ContactProblem):
            raise ProblemError(place, f"is of type {problem.node}: a sequence has contact problems")
        last = self.steps[-1] if self.steps else None
        if last is not None and (problem.node, problem.dimension) != (last.node, last.dimension):
            kinds = [f"{p.node} with {p.dimension} rows a contact" for p in (problem, last)]
            raise ProblemError(place, f"is {kinds[0]}, the steps before are {kinds[1]}")
        given = {"id": ids, "position": positions, "bodies": bodies, "frame": frames}
        known = {name: np.asarray(value) for name, value in given.items() if value is not None}
        if ids is not None and len(np.unique(known["id"])) != known["id"].size:
            raise ProblemError(f"{place}: ids", "has one number twice, expected one for each contact")
        if last is not None and last.sequence is not None:
            time = last.sequence.time + self.dt if time is None else time
            if not time > last.sequence.time:
                raise ProblemError(place, f"is at {time:g} s, the step before at {last.sequence.time:g} s")
        previous = last.fingerprint if last is not None else ""
        try:
            contacts = Contacts(**known) if known else problem.contacts
            recorded = dataclasses.replace(
                problem,
                name=f"step-{k:03d}",
                sequence=Sequence(self.name, k, time or 0.0, self.dt, previous),
                contacts=contacts,
            )
        except ProblemError as cause:
            raise ProblemError(f"{place}: {cause.field}", cause.cause) from None
        self.steps.append(recorded)

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write all steps into one HDF5 file; raises FormatError when it exists, ProblemError without any step."""
        if not self.steps:
            raise ProblemError(f"sequence {self.name}", "has no steps")
        save_pack({step.name: step for step in self.steps}, path, force=force)
