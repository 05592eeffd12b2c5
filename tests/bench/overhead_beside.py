"""The commands of three harnesses on the same QPs: what each takes beside the solves that it tells of."""

from __future__ import annotations

import importlib.util
import itertools
import os
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import overhead_qps
from overhead_qps import BACKENDS, TOLERANCE

from cpbench.bench.results.store import read_results

HERE = Path(__file__).parent
FEW = 10
"""Problems of the smallest run, which tells the start-up."""


@dataclass
class Spent:
    """Seconds of the runs of a harness, by their number of problems: beside its solves, and in them; the least."""

    rest: dict[int, float] = field(default_factory=dict)
    solves: dict[int, float] = field(default_factory=dict)

    def add(self, problems: int, rest: float, solves: float) -> None:
        self.rest[problems] = min(rest, self.rest.get(problems, rest))
        self.solves[problems] = min(solves, self.solves.get(problems, solves))

    def call(self, few: int, many: int) -> float:
        """What each call adds that a run of `many` problems has more than one of `few`."""
        return (self.rest[many] - self.rest[few]) / ((many - few) * len(BACKENDS))

    def startup(self, few: int, many: int) -> float:
        return self.rest[few] - self.call(few, many) * few * len(BACKENDS)

    def solve(self, problems: int) -> float:
        """Mean of a solve, by the harness's own clock."""
        return self.solves[problems] / (problems * len(BACKENDS))


class Harness(ABC):
    """A command that solves every QP of a folder with every backend, and the solve times that it wrote."""

    name: ClassVar[str]
    package: ClassVar[str]
    suffix: ClassVar[str]

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def installed(self) -> bool:
        return importlib.util.find_spec(self.package) is not None

    @abstractmethod
    def command(self, problems: Path, results: Path) -> Sequence[str]: ...

    @abstractmethod
    def solves(self, results: Path) -> list[float]:
        """Seconds of every solve that succeeded."""

    def run(self, count: int) -> tuple[float, float]:
        """Wall time less recorded solves, and the latter's sum [s]; raises SystemExit when a solve is missing."""
        problems = self.folder / f"qps-{count}"
        if not problems.exists():
            overhead_qps.write(problems, count)
        results = self.folder / f"{self.package}-{time.monotonic_ns()}{self.suffix}"
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])]),
            overhead_qps.FOLDER: str(problems),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
        begun = time.perf_counter()
        done = subprocess.run(self.command(problems, results), env=environment, capture_output=True, text=True)
        wall = time.perf_counter() - begun
        solves = self.solves(results) if done.returncode == 0 else []
        if len(solves) != count * len(BACKENDS):
            told = (done.stderr or done.stdout)[-1000:]
            raise SystemExit(f"{self.name}: {len(solves)} of {count * len(BACKENDS)} solves; {told}")
        return wall - sum(solves), sum(solves)


class Ours(Harness):
    name, package, suffix = "cpbench run", "cpbench", ".sqlite"

    def command(self, problems: Path, results: Path) -> Sequence[str]:
        chosen = [word for backend in BACKENDS for word in ("-s", backend)]
        options = ["--repeats", "1", "--tolerance", str(TOLERANCE), "--no-report", "-q", "-o", str(results)]
        return [_script("cpbench"), "run", str(problems), *chosen, *options]

    def solves(self, results: Path) -> list[float]:
        table = read_results(results)
        return (table["setup"] + table["solve"])[table["status"] == "solved"].tolist()


class Benchopt(Harness):
    name, package, suffix = "benchopt run", "benchopt", ".parquet"

    def command(self, problems: Path, results: Path) -> Sequence[str]:
        options = ["--no-cache", "--no-plot", "-r", "1", "-l", "--output", str(results)]
        return [_script("benchopt"), "run", str(HERE / "overhead_benchopt"), *options]

    def solves(self, results: Path) -> list[float]:
        import pandas as pd

        table = pd.read_parquet(results)
        return table["time"][table["objective_value"] == 1].tolist()


class QPBenchmark(Harness):
    name, package, suffix = "qpbenchmark run", "qpbenchmark", ".csv"

    def command(self, problems: Path, results: Path) -> Sequence[str]:
        test_set = HERE / "overhead_qpbenchmark.py"
        return [_script("qpbenchmark"), "--results-path", str(results), str(test_set), "run", "--author", "cpbench"]

    def solves(self, results: Path) -> list[float]:
        import pandas as pd

        table = pd.read_csv(results)
        return table["runtime"][table["found"]].tolist()


def harnesses(folder: Path) -> list[Harness]:
    """Ours first."""
    return [Ours(folder), Benchopt(folder), QPBenchmark(folder)]


def measure(harnesses: Sequence[Harness], counts: Sequence[int], tries: int) -> dict[str, Spent]:
    """Run all harnesses in turns, with each number of problems."""
    spent = {harness.name: Spent() for harness in harnesses}
    for _, count, harness in itertools.product(range(tries), counts, harnesses):
        spent[harness.name].add(count, *harness.run(count))
    return spent


def _script(name: str) -> str:
    """The command as it was installed beside this Python."""
    path = Path(sys.executable).with_name(name)
    return str(path) if path.exists() else name
