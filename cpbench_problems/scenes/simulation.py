"""Scenes that move by a solver of the user's choice, and their contact problems as one file."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from cpbench import graph, storage
from cpbench.api.solution import Solution
from cpbench.api.solving import route_to_solver, solve_there
from cpbench.errors import CpbenchError, ProblemError
from cpbench.formulations.base import Contacts, Info, Point, Problem
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.transfer import transfer
from cpbench.foundation.text import counted
from cpbench.generators.base import LICENCE
from cpbench.solvers.base import Trait, warm_up
from cpbench.verification import error_text
from cpbench_problems.recorder import Recorder
from cpbench_problems.scenes import stepper
from cpbench_problems.scenes.bodies import BodyScene, Choices, families
from cpbench_problems.scenes.stepper import ContactProblem, SceneStep

LOCAL = {"gfc": "fc", "grfc": "rfc"}
"""The formulation of the local twin of a problem in global form."""
CITATION = "Jean 1999, The non-smooth contact dynamics method, Comput. Methods Appl. Mech. Engrg. 177:235"


class NotSolved(CpbenchError):
    """A solver gave no answer to a step, so that the bodies cannot move on."""


class Simulation:
    """A scene whose steps are solved by one solver, each from the reactions of the step before.

    Attributes
    ----------
    steps : those that were made. solutions : their answers as they were measured, None where nothing touched.
    """

    def __init__(self, scene: BodyScene, solver: str | None = None, tolerance: float = 1e-6) -> None:
        self.scene, self.solver, self.tolerance = scene, solver, tolerance
        self.steps: list[SceneStep] = []
        self.solutions: list[Solution | None] = []
        self._last: tuple[Contacts | None, Any] | None = None
        self._libraries: ThreadpoolController | None = None

    def run(self, steps: int) -> Iterator[SceneStep]:
        """Yield `steps` steps from the start; raises NotSolved, NoRoute, UnknownName, NotApplicable, Unavailable."""
        self.steps, self.solutions, self._last = [], [], None
        for step in stepper.run(self.scene, steps, self._solve):
            self.steps.append(step)
            if step.problem is None:
                self.solutions.append(None)
            yield step

    @property
    def error(self) -> float:
        """The largest error that was measured of an answer; it has no unit."""
        return max((solution.error for solution in self.solutions if solution is not None), default=0.0)

    @property
    def missed(self) -> int:
        """The number of answers that miss the tolerance."""
        return sum(not solution for solution in self.solutions if solution is not None)

    def _solve(self, problem: ContactProblem) -> Any:
        routed = route_to_solver(problem, self.solver)
        if self._last is None:
            warm_up(routed.solver)
        start = None
        if self._last is not None and Trait.WARM_START in routed.solver.spec.traits:
            start = graph.push(routed.problem, transfer(*self._last, problem).point, routed.steps)
        self._libraries = self._libraries or ThreadpoolController()
        # no time limit, and one thread: neither a busy machine nor another number of threads may make another motion
        with self._libraries.limit(limits=1):
            solution, _ = solve_there(problem, routed, self.tolerance, math.inf, start)
        point = solution.point
        if point is None or not point.finite:
            why = (
                f"{routed.name} gave no answer ({solution.status}{': ' if solution.message else ''}{solution.message})"
            )
            raise NotSolved(f"{self.scene.name}: step {len(self.steps)}: {why}; try another --solver")
        self._last = problem.contacts, point
        self.solutions.append(solution)
        return point


def scene_of(name: str, **chosen: Any) -> BodyScene:
    """Build a scene by its name from values of `Choices`, those that are not given or None being the default ones.

    Raises UnknownName, ProblemError for a value that makes no scene.
    """
    family = families.get(name)
    default = Choices(size=10, mu=family.mu, mass_ratio=1.0, seed=0, dt=0.005)
    choices = dataclasses.replace(default, **{key: value for key, value in chosen.items() if value is not None})
    if choices.size < family.smallest:
        raise ProblemError("size", f"is {choices.size}: a scene {name} has at least {family.smallest} {family.unit}")
    for field, value, least in (("mu", choices.mu, 0.0), ("mass_ratio", choices.mass_ratio, 1.0)):
        if not (least <= value < np.inf):
            raise ProblemError(field, f"is {value:g}, expected a number of at least {least:g}")
    if not 0.0 < choices.dt < np.inf:
        raise ProblemError("dt", f"is {choices.dt:g} s, expected a number of seconds above 0")
    return family.build(choices)


def simulate_scene(name: str, solver: str | None, tolerance: float, **chosen: Any) -> Simulation:
    """Return the scene that `scene_of` builds, ready to run by a solver; raises as `scene_of`."""
    return Simulation(scene_of(name, **chosen), solver, tolerance)


def write_scene(simulation: Simulation, path: Path, source: str, *, force: bool = False) -> list[str]:
    """Write the problems of all steps at which something touched into one file, in global and in local form, with the
    answers by which the bodies moved. `source` : the command that makes the scene.

    Returns what to tell the user; raises FormatError, ProblemError without any contact.
    """
    made: list[tuple[Any, Any]] = [
        (step.problem, step.point) for step in simulation.steps if step.problem is not None and step.problem.nc
    ]
    if not made:
        raise ProblemError(simulation.scene.name, f"nothing touched in {len(simulation.steps)} steps: try more --steps")
    node = made[0][0].node
    info = Info(source=source, licence=LICENCE, family=simulation.scene.name, citation=CITATION)
    problems: dict[str, Problem] = {}
    answers: dict[str, Point] = {}
    for form, suffix in ((LOCAL[node], ""), (node, "-global")):
        recorder = Recorder(simulation.scene.name + suffix, simulation.scene.dt)
        for problem, point in made:
            twin: Any = problem if form == node else graph.arrive(problem, form).problem
            recorder.add(dataclasses.replace(twin, info=info, provenance=()), time=problem.sequence.time)
            name = f"{form}-{len(recorder.steps) - 1:03d}"
            problems[name] = dataclasses.replace(recorder.steps[-1], name=name)
            answers[name] = point if form == node else FCPoint(r=point.r)
    storage.save_pack(problems, path, solutions=answers, force=force)
    return _account(simulation, [problem.contacts for problem, _ in made], path, list(problems))


def _account(simulation: Simulation, contacts: Sequence[Contacts], path: Path, names: Sequence[str]) -> list[str]:
    scene, every = simulation.scene, len(simulation.steps)
    ids = [set(one.id.tolist()) for one in contacts]
    came, went = (sum(len(b - a) for a, b in pairwise(order)) for order in (ids, ids[::-1]))
    counts = sorted(map(len, ids))
    solved = "all steps" if not simulation.missed else f"all but {counted(simulation.missed, 'step')}"
    solver = next(solution.solver for solution in simulation.solutions if solution is not None)
    half, without = len(names) // 2, every - len(ids)
    bodies, error = counted(len(scene.bodies.mass), "body", "bodies"), error_text(simulation.error)
    return [
        f"{scene.name}: {counted(every, 'step')} of {scene.dt:g} s, {bodies}, {counts[0]} to {counts[-1]} contacts; "
        f"{came} came and {went} went",
        f"solved by {solver}: {solved} to {simulation.tolerance:g}; the largest error is {error}",
        *([f"left out: {counted(without, 'step')} at which nothing touched"] if without else []),
        f"{path}: {names[0]} to {names[half - 1]} and {names[half]} to {names[-1]}",
    ]
