"""How long a first answer takes: of a worker whose kernels lie in the cache, and where the cache is empty.

    python benchmarks/first_solve.py [--solvers nsgs,lemke,...] [--repeats 3]      warm, seconds from request to answer
    python benchmarks/first_solve.py --fresh [--solvers ...]                       seconds to compile, by the clock

Warm is what `cpbench run` does with a solver that it has not started yet: a process forked, the solver warmed up, a
small problem of its node loaded, solved and judged; the least of some, as a busy machine only adds. Before the first of
them the forkserver starts and loads what all have in common; that is printed apart.

Fresh is `warmup` in a process of its own that has an empty cache of its own; importing is not in it. Slowest first.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import one_race

WARM_MOST, FRESH_MOST = 0.8, 15.0
"""Seconds that are allowed."""
COMPILE = """
import sys, time
from cpbench.foundation import kernel_cache
from cpbench.solvers import solvers
solver = solvers.get(sys.argv[1])
kernel_cache.ensure_cache_dir()
import numba
before = time.perf_counter()
solver.warmup()
print(time.perf_counter() - before, " ".join(m.rsplit(".", 1)[1] for m in sys.modules if ".kernels." in m))
"""


def chosen(names: list[str]) -> list[Any]:
    """Native solvers that run by default, or those of these names."""
    from cpbench.solvers import solvers

    if names:
        return [solvers.get(name) for name in names]
    native = "cpbench_solvers."
    return [s for s in solvers if type(s).__module__.startswith(native) and s.spec.by_default]


def small(solver: Any, folder: Path) -> str:
    """The file of a case of its node that the solver takes, the largest one."""
    from cpbench import storage
    from cpbench.testing import cases

    taken = [case.problem for case in cases(solver.spec.node) if solver.obstacle(case.problem) is None]
    problem = max(taken, key=lambda p: sum(p.point_sizes.values()))
    path = folder / f"{solver.spec.node}-{problem.name}.h5"
    if not path.exists():
        storage.save(problem, path)
    return str(path)


def warm(names: list[str], repeats: int) -> Iterator[tuple[str, float, str]]:
    from cpbench.bench.planning import plan
    from cpbench.bench.slot import Slot
    from cpbench.bench.worker_pool import Setting

    solvers = chosen(names)
    with tempfile.TemporaryDirectory() as folder, Slot(Setting()) as slot:
        files = {solver.spec.name: small(solver, Path(folder)) for solver in solvers}
        asked = [plan.exact()]
        before = time.perf_counter()
        surveys = {file: slot.survey(file, asked) for file in dict.fromkeys(files.values())}
        print(f"# forkserver, referee and {len(surveys)} files: {time.perf_counter() - before:.2f} s", flush=True)
        for name, file in files.items():
            (pair,) = plan.pairs(
                [surveys[file]], [plan.parse_entry(name)], asked, 1e-6, plan.Limits(20.0, 4 * 2**30, 1, repeats=1)
            )
            prepared, least = slot.prepare(pair), (float("inf"), "")
            for _ in range(repeats):
                slot.workers.drop(name)
                before = time.perf_counter()
                slot.workers.get(name, pair.limits.memory, pair.limits.seconds)
                ready = time.perf_counter() - before
                row = slot.run(pair, prepared)
                total = time.perf_counter() - before
                told = f"{ready:6.3f} ready, solve {row.solve or 0:9.6f}, {row.status}"
                least = min(least, (total, told))
            slot.workers.drop(name)
            yield name, *least


def fresh(names: list[str]) -> Iterator[tuple[str, float, str]]:
    for solver in chosen(names):
        name = solver.spec.name
        with tempfile.TemporaryDirectory() as cache:
            environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
            command = [sys.executable, "-c", COMPILE, name]
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        seconds, _, kernels = done.stdout.strip().partition(" ")
        yield name, float(seconds), kernels or "no kernels"


def main(names: list[str], repeats: int, path: Path | None, *, empty: bool) -> None:
    found = []
    for name, seconds, told in fresh(names) if empty else warm(names, repeats):
        found.append((seconds, name, told))
        print(f"# {seconds:6.3f} {name}: {told}", flush=True)
    limit = FRESH_MOST if empty else WARM_MOST
    which = "first ever" if empty else "first warm"
    one_race.write(
        path,
        [
            one_race.race(which, name, 0, limit / seconds, f"{limit:g} s", f"{seconds:.2f} s")
            for seconds, name, _ in found
        ],
    )
    for seconds, name, told in sorted(found, reverse=True):
        print(f"{seconds:7.3f} {name}: {told}")
    print(f"{sum(seconds > limit for seconds, *_ in found)} of {len(found)} above {limit:g} s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solvers", default="", help="names; native ones that run by default")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", type=Path, help="write the ratios there, too")
    parser.add_argument("--fresh", action="store_true", help="compile, in an empty cache each")
    arguments = parser.parse_args()
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[variable] = "1"
    main(
        [name for name in arguments.solvers.split(",") if name],
        arguments.repeats,
        arguments.json,
        empty=arguments.fresh,
    )
