"""How often `cpbench compare` alarms on equal code, and finds a fifth more time, in real runs.

    python benchmarks/false_alarms.py --jobs 200                     half an hour on a quiet machine
    python benchmarks/false_alarms.py --jobs 500 --minutes 60 --folder kept/       as many as an hour allows, resumed

A job is a `cpbench run` of 30 LCPs in 6 families (milliseconds each) by one solver in four builds, interleaved: base,
again and third are equal code, slow busy-waits for a fifth of its own time more. Every build is a program of its own,
every job has a seed of its own. Compared are

- in each job: third with base, and slow with base, with and without --noise base,again;
- from job to job: base with the base of the next job, and the slow of the next one, as two results files.

Printed is how often which verdict came, and what the noise was: the standard deviation of log ratios of equal code,
over all jobs, which has the bias of a process in it.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from cpbench import storage
from cpbench.analysis.comparison import Comparison, ComparisonSide, PairVerdict, compare, compare_labels
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench.formulations import LCP
from cpbench.formulations.base import Info

PLUGIN = Path(__file__).with_name("slowed_solver.py")
BUILDS = {"base": "0", "again": "0.0", "third": "0.00", "slow": "0.2"}
SIZES = (20, 26, 32, 38, 44)
FAMILIES = ("wishart", "chain", "obstacle", "decay", "blocks", "shifted")


def problem(family: str, n: int) -> LCP:
    """Symmetric, diagonally dominant or nearly so: a few dozen sweeps."""
    rng = np.random.default_rng([n, FAMILIES.index(family)])
    i = np.arange(n)
    gap = np.abs(i[:, None] - i)
    A = rng.standard_normal((n, n)) / math.sqrt(n)
    M = {
        "wishart": A @ A.T + np.eye(n),
        "chain": 2.2 * np.eye(n) - (gap == 1),
        "obstacle": 4.4 * np.eye(n) - (gap == 1) - (gap == 5),
        "decay": 0.6**gap,
        "blocks": np.kron(np.eye(n // 2), np.array([[2.0, 1.0], [1.0, 2.0]])),
        "shifted": A @ A.T + 0.5 * np.eye(n) + 0.3,
    }[family]
    return LCP(M=M, q=rng.standard_normal(n), name=f"{family}-{n}", info=Info(family=family))


def prepare(folder: Path) -> None:
    (folder / "problems").mkdir(parents=True, exist_ok=True)
    for family in FAMILIES:
        for n in SIZES:
            path = folder / "problems" / f"{family}-{n}.h5"
            if not path.exists():
                storage.save(problem(family, n), path)
    tables = [f'[solver."slowed@{name}"]\nenv = {{CPBENCH_BENCH_SLOWER = "{more}"}}\n' for name, more in BUILDS.items()]
    (folder / "builds.toml").write_text("\n".join(tables))


def job(folder: Path, seed: int, repeats: int) -> ComparisonSide:
    """The results of one job, run unless they are there."""
    path = folder / f"job-{seed}.sqlite"
    words = ["run", str(folder / "problems"), "--plan", "none", "--plugin", str(PLUGIN)]
    words += ["--plugin", str(folder / "builds.toml"), *(w for name in BUILDS for w in ("-s", f"slowed@{name}"))]
    words += ["--seed", str(seed), "--repeats", str(repeats), "-o", str(path), "--no-report", "-q"]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run([sys.executable, "-m", "cpbench", *words], check=True, stdout=subprocess.DEVNULL, env=environment)
    with Store(path) as store:
        return ComparisonSide(path.name, store.table(), store.meta(), store.machines())


def build(side: ComparisonSide, name: str) -> ComparisonSide:
    """One build of a job, called by the name of the solver."""
    own = side.table[side.table["solver"] == f"slowed@{name}"]
    return replace(side, name=f"{side.name} {name}", table=own.assign(solver="slowed", label="slowed"))


@dataclass
class Tally:
    verdicts: Counter[PairVerdict] = field(default_factory=Counter)
    logs: list[float] = field(default_factory=list)
    deltas: list[float] = field(default_factory=list)

    def add(self, comparison: Comparison) -> None:
        self.verdicts[comparison.verdict] += 1
        self.logs.append(math.log(comparison.suites[0].ratio) if comparison.suites[0].timed else math.nan)
        self.deltas.append(comparison.noise.delta)


def compared(jobs: list[ComparisonSide], tallies: dict[str, Tally]) -> None:
    """Add the comparisons of the last job, in itself and with the one before."""
    last = jobs[-1]
    equal = ("slowed@base", "slowed@again")
    for name, what in (("third", "equal"), ("slow", "slower")):
        for noise in (None, equal):
            told = f"one run, {what}" + (", --noise" if noise else "")
            tallies[told].add(compare_labels(last, "slowed@base", f"slowed@{name}", equal=noise))
    if len(jobs) > 1:
        before = build(jobs[-2], "base")
        tallies["two files, equal"].add(compare(before, build(last, "base")))
        tallies["two files, slower"].add(compare(before, build(last, "slow")))


def show(tallies: dict[str, Tally]) -> None:
    order = (PairVerdict.REGRESSED, PairVerdict.IMPROVED, PairVerdict.INCONCLUSIVE, PairVerdict.SAME)
    print(f"{'comparison':<26}{'number':>7}" + "".join(f"{v!s:>14}" for v in order) + f"{'mean':>8}{'sd':>7}{'δ':>7}")
    for name, tally in tallies.items():
        logs = [x for x in tally.logs if math.isfinite(x)]
        if not tally.verdicts:
            continue
        mean = math.exp(statistics.fmean(logs)) if logs else math.nan
        spread = statistics.stdev(logs) if len(logs) > 1 else math.nan
        counts = "".join(f"{tally.verdicts[v]:>14}" for v in order)
        delta = statistics.median(tally.deltas)
        print(f"{name:<26}{tally.verdicts.total():>7}{counts}{mean:>8.3f}{spread:>7.1%}{delta:>7.1%}")
    for kind, alarm in (("equal", "alarms on equal code"), ("slower", "found of a fifth more")):
        own = {name: tally for name, tally in tallies.items() if kind in name and tally.verdicts}
        counted = (PairVerdict.REGRESSED, PairVerdict.IMPROVED) if kind == "equal" else (PairVerdict.REGRESSED,)
        told = [
            f"{name.replace(f', {kind}', '')} {sum(t.verdicts[v] for v in counted) / t.verdicts.total():.1%}"
            for name, t in own.items()
        ]
        print(f"{alarm}: {'; '.join(told)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=200)
    parser.add_argument("--minutes", type=float, default=math.inf)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--folder", type=Path, help="where jobs are kept; those that are there are not run again")
    asked = parser.parse_args()
    tallies = {
        f"{where}, {what}{noise}": Tally()
        for where, noises in (("one run", ("", ", --noise")), ("two files", ("",)))
        for what in ("equal", "slower")
        for noise in noises
    }
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        folder = (asked.folder or Path(scratch)).absolute()
        prepare(folder)
        jobs: list[ComparisonSide] = []
        for seed in range(asked.jobs):
            if time.monotonic() - begun > 60 * asked.minutes:
                break
            try:
                jobs.append(job(folder, seed, asked.repeats))
            except (subprocess.CalledProcessError, CpbenchError) as cause:
                sys.exit(f"job {seed}: {cause}")
            compared(jobs, tallies)
            del jobs[:-1]
            print(f"{seed + 1} jobs, {time.monotonic() - begun:.0f} s", file=sys.stderr, end="\r")
    print(file=sys.stderr)
    show(tallies)


if __name__ == "__main__":
    main()
