"""A recorded sequence of contact problems, for tests of runs that follow one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from cpbench import graph, storage
from cpbench_problems.recorder import Recorder
from cpbench_problems.scenes.simulation import simulate_scene

STEPS = 32


def write_sequence(path: Path) -> Path:
    """Write the steps of balls that wedge in a trough, in local form, without those in which they fall together."""
    simulation = simulate_scene("trough", "nsgs", 1e-8, size=12)
    made = [step.problem for step in simulation.run(STEPS + 8)][-STEPS:]
    recorder = Recorder("trough", simulation.scene.dt)
    for problem in made:
        assert problem is not None
        assert problem.sequence is not None
        recorder.add(replace(graph.arrive(problem, "fc").problem, provenance=()), time=problem.sequence.time)
    steps = {f"step-{k:03d}": step for k, step in enumerate(recorder.steps)}
    storage.save_pack({name: replace(step, name=name) for name, step in steps.items()}, path)
    return path
