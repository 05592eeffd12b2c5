"""Runs with faulty solvers."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.formulations import LCP

PLUGIN = Path(__file__).with_name("faulty_solvers.py")


@dataclass(frozen=True)
class Bench:
    """A folder with problems, and the runs in it."""

    folder: Path
    opened: ExitStack = field(default_factory=ExitStack)

    def problem(self, name: str, n: int) -> str:
        """Strictly diagonally dominant M with the planted solution z = e: q = -Me."""
        M = np.diag(np.full(n, 4.0)) - np.diag(np.ones(n - 1), 1) - np.diag(np.ones(n - 1), -1)
        path = self.folder / f"{name}.h5"
        if not path.exists():  # several runs of a module are on the same problems
            storage.save(LCP(M=M, q=-(M @ np.ones(n)), name=name), path)
        return str(path)

    def command(self, problems: Sequence[str], solvers: Sequence[str], *options: str) -> list[str]:
        chosen = [a for name in solvers for a in ("-s", name)]
        run = [sys.executable, "-m", "cpbench", "--plugin", str(PLUGIN), "run", *problems, *chosen]
        output = [] if "-o" in options else ["-o", "r.sqlite"]
        return [*run, "--no-report", "-q", *output, *options]

    def run(
        self, problems: Sequence[str], solvers: Sequence[str], *options: str, **environment: str
    ) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            self.command(problems, solvers, *options),
            cwd=self.folder,
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            timeout=600,
        )

    def store(self) -> Store:
        return self.opened.enter_context(Store(self.folder / "r.sqlite"))

    @property
    def grace(self) -> float:
        """Seconds in which a process past its limit is gone: half a one where a core is to spare for it, else what it
        may have to wait for one. The load is an average over a minute, so a second more than it says."""
        load = os.getloadavg()[0]
        return 0.5 if load < 1.0 else 1.0 + load

    def living(self) -> list[str]:
        """Processes that were started in the folder and still live."""
        import psutil

        return [
            f"{p.info['pid']}: {p.info['cmdline']}"
            for p in psutil.process_iter(["pid", "cmdline", "cwd", "status"])
            if p.info["cwd"] == str(self.folder) and p.info["status"] != psutil.STATUS_ZOMBIE
        ]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    bench = Bench(tmp_path)
    with bench.opened:
        yield bench


@pytest.fixture(scope="module")
def module_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    bench = Bench(tmp_path_factory.mktemp("faults"))
    with bench.opened:
        yield bench
