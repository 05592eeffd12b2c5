"""What solvers of other packages say that is not so, as the real runner shows it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from one_row import row_of

from cpbench.bench.slot import Slot
from cpbench.formulations import LCP
from cpbench.solvers import solvers


@pytest.fixture(scope="module")
def slot() -> Iterator[Slot]:
    with Slot() as slot:
        yield slot


@pytest.mark.nightly
def test_gams_beside_a_worker_is_no_child_of_a_solve(slot: Slot, tmp_path: Path) -> None:
    """Its process and the threads of gamspy are there since the warm-up."""
    if solvers.get("gams-path").availability().state == "licence":
        pytest.skip("needs a licence: that of GAMS ran out; pip install --upgrade gamspy gamspy_base")
    row = row_of(slot, LCP(M=np.eye(3), q=-np.ones(3)), "gams-path", tmp_path)
    assert (row.status, row.flags) == ("solved", "")
    assert row.reported is None, "GAMS counts the launch of PATH, which is not PATH's own time"


CLOCK = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <sys/time.h>
#include <time.h>

#define YEAR (400L * 24 * 3600)

int clock_gettime(clockid_t clock, struct timespec *t) {
    int (*real)(clockid_t, struct timespec *) = dlsym(RTLD_NEXT, "clock_gettime");
    int failed = real(clock, t);
    if (!failed && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) t->tv_sec += YEAR;
    return failed;
}

int gettimeofday(struct timeval *restrict t, void *restrict zone) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    t->tv_sec = now.tv_sec;
    t->tv_usec = now.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *t) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (t) *t = now.tv_sec;
    return now.tv_sec;
}
"""
"""Preloaded into a process and its children: the day is 400 days later."""

LATER = """
import sys
import numpy as np
from cpbench import storage
from cpbench.bench.slot import Slot
from cpbench.bench.planning import plan
from cpbench.errors import Unavailable
from cpbench.formulations import LCP
from cpbench.solvers import solvers

problem = LCP(M=np.eye(2), q=-np.ones(2))
storage.save(problem, sys.argv[1])
with Slot() as slot:
    asked = [plan.exact()]
    survey = slot.survey(sys.argv[1], asked)
    (pair,) = plan.pairs([survey], [plan.Entry("gams-path")], asked, 1e-6, plan.Limits(seconds=20.0, repeats=1))
    row = slot.run(pair, slot.prepare(pair))
print("row:", row.status, row.message)
try:
    solvers.get("gams-path").hand_over(problem)
except Unavailable as refused:
    print("solve:", refused)
"""


@pytest.mark.nightly
def test_a_licence_that_ran_out(tmp_path: Path) -> None:
    """GAMS' own word on its demo licence (five months) 400 days from now: before the solve, and in the midst of it."""
    found = solvers.get("gams-path").availability()
    if found.state not in ("ok", "licence"):
        pytest.skip(f"needs a package: {found.detail}")
    compiler = shutil.which("gcc")
    if compiler is None or sys.platform != "linux":
        pytest.skip("does not apply: the clock is set forward by a preloaded library, which takes Linux and gcc")
    (tmp_path / "clock.c").write_text(CLOCK)
    library = tmp_path / "clock.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", library, tmp_path / "clock.c", "-ldl"], check=True)
    told = subprocess.run(
        [sys.executable, "-c", LATER, str(tmp_path / "problem.h5")],
        env={**os.environ, "LD_PRELOAD": str(library)},
        capture_output=True,
        text=True,
        timeout=600,
    )
    said = dict(line.split(": ", 1) for line in told.stdout.splitlines() if line.startswith(("row: ", "solve: ")))
    assert said["row"].startswith("unavailable licence: Time-limited license expired"), told.stdout + told.stderr
    assert said["solve"].startswith("licence: Time-limited license expired")
