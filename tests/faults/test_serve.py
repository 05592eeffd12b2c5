"""Whatever a program does that is served or run, in any language, is a row."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from cpbench.bench.outcome import remembered
from cpbench.bench.results.store import Store

HERE = Path(__file__).parent
PROGRAM = HERE / "served_faults.py"
LIMIT = 1.0  # seconds for those that only the clock can end
AMPLE = 60.0  # for all others, whose end must not depend on how busy the machine is
HANGS = ("hang", "stall", "sh-hang")
FEW = (
    "none", "remember", "hang", "segfault", "noise", "close", "claim", "error", "refuse", "licence", "memory", "odd",
    "nan", "missing", "sh-awk", "sh-hang", "sh-none", "sh-claim", "sh-gone",
)  # fmt: skip
"""Of each kind some."""
SERVED: dict[str, tuple[str, float | None, float | None, str]] = {  # status, signal, exit code, part of the message
    "none": ("solved", None, None, ""),
    "stay": ("solved", None, None, ""),
    "remember": ("solved", None, None, ""),
    "hang": ("timeout", None, None, "killed after 1 s"),
    "stall": ("timeout", None, None, "killed after 1 s"),
    "segfault": ("crash", 11, None, "last words of a program"),
    "exit": ("crash", None, 3, "exited with code 3"),
    "exit-0": ("crash", None, 0, "exited with code 0"),  # a death is no success, whatever its code
    "late": ("crash", 6, None, "SIGABRT"),
    "noise": ("error", None, None, "answered solve with 'iteration 1: 0.5'"),
    "json": ("error", None, None, "answered solve with '{\"ok\": true'"),
    "list": ("error", None, None, "answered solve with '[1, 2]'"),
    "giant": ("error", None, None, "a line of more than 1048576 bytes"),
    "binary": ("error", None, None, "answered solve with"),
    "deep": ("error", None, None, "answered solve with '[[[["),
    "close": ("error", None, None, "closed its stdin or stdout, and went on without"),
    "twice": ("error", None, None, "before it was asked to write"),
    "claim": ("error", None, None, "claims 'splendid', expected solved"),
    "error": ("error", None, None, "a pivot is 0"),
    "refuse": ("unsupported", None, None, "M is not symmetric"),
    "licence": ("unavailable", None, None, "licence: the licence ended yesterday"),
    "no-licence": ("unavailable", None, None, "licence: no licence file"),
    "broken": ("unavailable", None, None, "ImportError: libmine.so.2"),
    "memory": ("memout", None, None, "over 1073741824 bytes"),
    "eat": ("memout", None, None, "MemoryError"),
    "infeasible": ("failed", None, None, ""),
    "odd": ("solved", None, None, "the counter iterations is no integer from 0 to 2^63, and not kept"),
    "nan": ("wrong", None, None, ""),
    "missing": ("error", None, None, "its answer z is missing, expected 3 numbers"),
    "size": ("error", None, None, "its answer z has shape (2,), expected 3 numbers"),
    "complex": ("error", None, None, "its answer z holds complex128, expected 3 real numbers"),
    "objects": ("error", None, None, "its answer z holds Python objects"),
    "text": ("error", None, None, "its answer z is not an array in NumPy's .npy format"),
}
COMMANDS: dict[str, tuple[str, float | None, float | None, str]] = {
    "sh-awk": ("solved", None, None, ""),
    "sh-hang": ("timeout", None, None, "killed after 1 s"),
    "sh-print": ("solved", None, None, ""),
    "sh-exit": ("crash", None, 1, "no such matrix"),
    "sh-kill": ("crash", 9, None, "SIGKILL"),
    "sh-none": ("error", None, None, "exited with code 0 and wrote no answer"),
    "sh-claim": ("failed", None, None, "gave up"),
    "sh-liar": ("error", None, None, "wrote a claim.json that is not a JSON object"),
    "sh-gone": ("unavailable", None, None, "missing: "),
}
AWK = r"""#!/bin/sh
# Diagonal LCPs, z = max(0, -q/M): the arrays are read with od, and written as .npy by printf, number by number.
set -e
numbers() { tail -c +129 "$1" | od -An -v -t f8 -w8; }
numbers "$1/M.npy" > "$2.M"
numbers "$1/q.npy" > "$2.q"
awk -v n="$(wc -l < "$2.q")" 'FILENAME ~ /M$/ { if ((FNR - 1) % (n + 1) == 0) d[++k] = $1; next }
     { z = -$1 / d[FNR]; print (z > 0 ? z : 0) }' "$2.M" "$2.q" > "$2.z"
PYTHON -c 'import sys, numpy; numpy.save(sys.argv[2], numpy.loadtxt(sys.argv[1], ndmin=1))' "$2.z" "$2/z.npy"
"""
SCRIPTS = {
    "sh-awk": AWK,
    "sh-hang": "#!/bin/sh\nsleep 60\n",
    "sh-print": AWK.replace("set -e", "set -e; echo noise; echo more >&2"),
    "sh-exit": "#!/bin/sh\necho no such matrix >&2\nexit 1\n",
    "sh-kill": "#!/bin/sh\nkill -9 $$\n",
    "sh-none": "#!/bin/sh\n",
    "sh-claim": '#!/bin/sh\necho \'{"claim": "failed", "message": "gave up", "iterations": 7}\' > "$2/claim.json"\n',
    "sh-liar": "#!/bin/sh\necho solved > $2/claim.json\n",
}


@pytest.fixture(scope="module", params=["few", pytest.param("all", marks=pytest.mark.nightly)])
def rows(module_bench, request: pytest.FixtureRequest) -> pd.DataFrame:
    """Of each on one diagonal problem, in two runs: those that only the clock ends, and all others."""
    import numpy as np

    from cpbench import storage
    from cpbench.formulations import LCP

    folder = module_bench.folder
    if not (folder / "p.h5").exists():  # some first, all later
        storage.save(LCP(M=np.diag([2.0, 4.0, 5.0]), q=-np.array([2.0, -4.0, 5.0]), name="p"), folder / "p.h5")
    for name, text in SCRIPTS.items():
        (folder / f"{name}.sh").write_text(text.replace("PYTHON", sys.executable))
        (folder / f"{name}.sh").chmod(0o755)
    tables = [
        f'[solver.{name}]\nnode = "lcp"\nmatrices = "dense"\nserve = "{sys.executable} {PROGRAM} {name}"\n'
        for name in SERVED
    ] + [
        f'[solver.{name}]\nnode = "lcp"\nmatrices = "dense"\ncommand = "./{name}.sh {{problem}} {{answer}}"\n'
        for name in COMMANDS
    ]
    sets = f'[[set]]\nproblems = ["p.h5"]\nsolvers = {json.dumps([*SERVED, *COMMANDS, "lemke"])}\n'
    (folder / "cpbench.toml").write_text("\n".join(['memory = "1G"', sets, *tables]))
    wanted = FEW if request.param == "few" else (*SERVED, *COMMANDS)
    found = []
    for limit, hangs in ((LIMIT, True), (AMPLE, False)):
        chosen = [name for name in wanted if (name in HANGS) == hangs]
        words = [word for name in [*chosen, *([] if hangs else ["lemke"])] for word in ("-s", name)]
        output = f"{request.param}-{limit:g}.sqlite"
        done = _run(folder, *words, "--timeout", f"{limit}s", "-o", output)
        assert done.returncode == any({**SERVED, **COMMANDS}[name][0] == "unavailable" for name in chosen), done.stderr
        assert module_bench.living() == []
        with Store(folder / output) as store:
            table = store.table().set_index("solver")
        assert set(table.index) == set(words[1::2])
        found.append(table)
    return pd.concat(found)


def _run(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "cpbench", "run", "--no-report", "-q", *options]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)


@pytest.mark.needs("cpbench_solvers")
def test_each_is_what_it_is_called(rows: pd.DataFrame) -> None:
    wrong: dict[str, Any] = {}
    for name in set(rows.index) - {"lemke"}:
        status, signal, code, told = {**SERVED, **COMMANDS}[name]
        row = rows.loc[name]
        said = None if pd.isna(row.signal) else row.signal
        right = (row.status, said) == (status, signal) and told in row.message and len(row.message) < 3000
        if not right or (code is not None and row.code != code):
            wrong[name] = (row.status, said, row.code, row.message[:300])
    assert wrong == {}


@pytest.mark.needs("cpbench_solvers")
def test_a_solver_with_a_memory_is_charged_the_first_solve(rows: pd.DataFrame) -> None:
    assert "remembered" in rows.loc["remember"]["flags"]
    assert rows.loc["remember"].solve >= 0.8
    # whether it is flagged is asked of its own times: on a busy machine any first solve may be late
    none = rows.loc["none"]
    assert ("remembered" in none["flags"]) == remembered(json.loads(none.samples))


@pytest.mark.needs("cpbench_solvers")
def test_seconds_of_its_own_are_a_column_beside_ours(rows: pd.DataFrame) -> None:
    assert rows.loc["none"].reported == 0.25
    assert rows.loc["none"].solve != 0.25
    assert json.loads(rows.loc["none"].counters) == {"iterations": 200, "sweeps": 200}
    assert rows.loc["none"].version == "1.2"
    assert pd.isna(rows.loc["odd"].reported)
    assert pd.isna(rows.loc["lemke"].reported)


@pytest.mark.needs("cpbench_solvers")
def test_hangs_are_killed_in_time(rows: pd.DataFrame, module_bench) -> None:
    late = rows.loc[[name for name in HANGS if name in rows.index]]
    assert (late.wall - late.load <= LIMIT + module_bench.grace).all()


@pytest.mark.needs("cpbench_solvers")
def test_what_a_failing_program_says_is_in_its_row(rows: pd.DataFrame) -> None:
    assert json.loads(rows.loc["sh-claim"].counters) == {"iterations": 7}
    assert "no such executable" in rows.loc["sh-gone"].message


@pytest.mark.needs("cpbench_solvers")
def test_no_folder_of_a_killed_run_stays(rows: pd.DataFrame, tmp_path: Path) -> None:
    """What the killed workers left is removed by the next that hands a problem over."""
    from cpbench.solvers.external.folder import Folder

    mine = Folder(1).path.parent
    locks = [p for p in mine.parent.glob("cpbench-handed-*.lock") if p.with_suffix("") != mine]
    assert [p for p in locks if _idle(p)] == []


def _idle(path: Path) -> bool:
    """Whether nobody holds a lock."""
    import fcntl
    import os

    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return True


@pytest.mark.nightly
@pytest.mark.skipif(shutil.which("g++") is None, reason="needs a program: g++")
def test_a_cpp_program_and_two_builds_of_it_in_one_run(bench) -> None:
    """Thirty lines of C++, compiled twice: the solver, and a variant of it by another build."""
    for build, level in (("pgs", "-O2"), ("pgs-debug", "-O0")):
        source = str(HERE / "served_pgs.cpp")
        subprocess.run(["g++", level, "-Wall", "-o", str(bench.folder / build), source], check=True, timeout=600)
    (bench.folder / "cpbench.toml").write_text(
        '[solver.cpp-pgs]\nnode = "lcp"\nserve = "./pgs --serve"\nmatrices = "dense"\nlicence = "MIT"\n'
        '[solver."cpp-pgs@debug"]\nserve = "./pgs-debug --serve"\n'
        f'[solver."lemke@head"]\ninterpreter = "{sys.executable}"\nenv = {{MARK = "1"}}\n'
    )
    paths = [bench.problem(f"p{n}", n) for n in (3, 40)]
    done = _run(
        bench.folder, *paths, *[a for s in ("cpp-pgs*", "lemke", "lemke@head") for a in ("-s", s)], "-o", "r.sqlite"
    )
    assert done.returncode == 0, done.stderr
    table = bench.store().table()
    assert sorted(set(table.solver)) == ["cpp-pgs", "cpp-pgs@debug", "lemke", "lemke@head"]
    assert list(table.status) == ["solved"] * 8, list(table.message)
    lemke = table[table.solver == "lemke"].counters.tolist()
    assert table[table.solver == "lemke@head"].counters.tolist() == lemke


def test_a_program_that_never_greets_is_broken_and_ends(bench) -> None:
    (bench.folder / "cpbench.toml").write_text('[solver.cat]\nnode = "lcp"\nserve = "/bin/cat"\n')
    done = _run(bench.folder, bench.problem("p", 3), "-s", "cat", "-o", "r.sqlite")
    assert done.returncode == 1, done.stderr
    row = bench.store().table().iloc[0]
    assert row.status == "unavailable"
    assert row.message.startswith("broken: cat: answered hello with")
    assert bench.living() == []
