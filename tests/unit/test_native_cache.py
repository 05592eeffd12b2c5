"""Where compiled kernels go, that nothing compiles after the warm-up, and that processes may start at once."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from sources import CORE, SOLVERS
from tiers import some_by_day

from cpbench import storage
from cpbench.formulations import LCP, MLCP, QP, FrictionContact, Problem
from cpbench.foundation import kernel_cache as cache
from cpbench.solvers import Budget, Solver, solvers

MADE: dict[str, Callable[[Any, Any], Problem]] = {
    "lcp": lambda M, q: LCP(M=M, q=q),
    "mlcp": lambda M, q: MLCP(A=M, B=M, C=0.1 * M, D=-0.1 * M, a=q, b=q),
    "qp": lambda M, q: QP.build(0.5 * (M + M.T), q, C=M[:3], d=q[:3] - 1.0, lb=np.full(q.size, -2.0)),
    "fc": lambda M, q: FrictionContact(W=M, q=q, mu=np.full(q.size // 3, 0.4)),
}
"""Node -> a problem of it from a square matrix and a vector of a multiple of three."""
NATIVE = [
    name
    for name in solvers.names()
    if type(solvers.get(name)).__module__.startswith("cpbench_solvers.") and solvers.get(name).spec.node in MADE
]


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch):
    """`ensure_cache_dir` as in a new process, with the environment put back afterwards."""
    monkeypatch.setenv(cache.VARIABLE, "")
    cache.ensure_cache_dir.cache_clear()
    yield monkeypatch
    cache.ensure_cache_dir.cache_clear()


def test_a_setting_of_the_user_is_left_alone(fresh: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fresh.setenv(cache.VARIABLE, str(tmp_path / "mine"))
    assert cache.ensure_cache_dir() == tmp_path / "mine"


def test_beside_the_source_where_that_is_writable(fresh: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fresh.setattr(cache, "_PACKAGE", tmp_path)
    assert cache.ensure_cache_dir() == tmp_path / "__pycache__"
    assert os.environ[cache.VARIABLE] == ""


def test_the_users_cache_where_the_package_is_read_only(fresh: pytest.MonkeyPatch, tmp_path: Path) -> None:
    import numba

    blocked = tmp_path / "a file, so no directory can be made below it"
    blocked.touch()
    fresh.setattr(cache, "_PACKAGE", blocked)
    fresh.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(tmp_path / "home"))
    assert cache.ensure_cache_dir() == tmp_path / "home" / "numba"
    assert os.environ[cache.VARIABLE] == str(tmp_path / "home" / "numba")
    assert str(tmp_path / "home" / "numba") == numba.config.CACHE_DIR


def test_a_private_place_where_nothing_is_writable(fresh: pytest.MonkeyPatch, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.touch()
    fresh.setattr(cache, "_PACKAGE", blocked)
    fresh.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(blocked))
    fresh.setattr("tempfile.tempdir", str(tmp_path))
    chosen = cache.ensure_cache_dir()
    assert chosen.parent == tmp_path
    assert chosen.stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("place", ["package", "home", "nowhere"])
def test_a_setting_that_cannot_be_written_is_left(fresh: pytest.MonkeyPatch, tmp_path: Path, place: str) -> None:
    """And numba looks where the locks and the stamps are: else each process removes what the one before compiled."""
    (tmp_path / "file").touch()
    asked = tmp_path / "file" / "cache"
    home = tmp_path / ("home" if place == "home" else "file")
    fresh.setenv(cache.VARIABLE, str(asked))
    fresh.setattr(cache, "_PACKAGE", tmp_path if place == "package" else tmp_path / "file")
    fresh.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(home))
    chosen = cache.ensure_cache_dir()
    with tempfile.TemporaryFile(dir=chosen):
        assert os.environ[cache.VARIABLE] == ("" if place == "package" else str(chosen))


@pytest.mark.nightly
@pytest.mark.skipif(not Path("/proc/1").is_dir(), reason="does not apply: /proc is Linux's")
def test_a_run_goes_on_where_no_folder_of_the_user_can_be_written(tmp_path: Path) -> None:
    """The second run compiles nothing: the first one's kernels were kept."""
    storage.save(LCP(M=[[4.0, 1.0], [0.0, 3.0]], q=[-2.0, -9.0]), tmp_path / "p.h5")
    blocked = {"HOME": "", "XDG_STATE_HOME": "/s", "XDG_CACHE_HOME": "/c", cache.VARIABLE: "/n"}
    command = [sys.executable, "-m", "cpbench", "run", "p.h5", "-s", "pgs", "--no-report", "--repeats", "1", "-o"]
    for name in ("first", "second"):
        done = subprocess.run(
            [*command, f"{name}.sqlite"],
            cwd=tmp_path,
            env={**os.environ, **{key: f"/proc/1{value}" for key, value in blocked.items()}},
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert "1 pair: 1 solved" in done.stdout
    assert "compiling" not in done.stderr


def test_the_registry_does_not_import_numba() -> None:
    code = "import sys; from cpbench.solvers import solvers; solvers.names(); sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def assert_each_once(place: Path, modules: set[str]) -> None:
    """Assert that a cache holds what kernels of `modules` are compiled to, once for each of their signatures."""
    compiled = Counter(tuple(p.name.split("-")[0].split(".")) for p in place.rglob("*.nbc"))
    assert {module for module, _ in compiled} == modules
    for (module, function), count in compiled.items():
        kernel = getattr(cache.load(f"cpbench_solvers.kernels.{module}"), function)
        assert count == len(kernel.signatures), f"{module}.{function}"


@pytest.mark.nightly
def test_processes_that_start_at_once_share_one_compilation(tmp_path: Path) -> None:
    """Three cold processes: each solves, and the cache holds each kernel once."""
    code = (
        "import numpy as np; from cpbench.solvers import solvers; from cpbench.formulations import LCP;"
        "M = np.array([[2.0, 1.0], [1.0, 2.0]]);"
        "print(solvers.get('pgs').run(LCP(M=M, q=np.array([-1.0, -1.0]))).claim)"
    )
    environment = {**os.environ, cache.VARIABLE: str(tmp_path)}
    started = [
        subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    assert [p.communicate(timeout=600)[0].strip() for p in started] == ["solved"] * 3
    assert_each_once(tmp_path, {"splitting", "lcp_error", "row_errors"})


@pytest.mark.nightly
def test_a_kernel_is_compiled_anew_when_one_that_it_takes_functions_from_has_changed(tmp_path: Path) -> None:
    """numba looks at the file of the kernel alone, and would go on with what it compiled of the other as it was."""
    for package in (CORE, SOLVERS):
        shutil.copytree(package, tmp_path / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    inner, outer = (tmp_path / SOLVERS.name / "kernels" / f"{name}.py" for name in ("inner", "outer"))
    decorated = "import numba\n{}\n@numba.njit('float64(float64)', cache=True)\ndef {}(x):\n    return {}\n"
    outer.write_text(decorated.format("from cpbench_solvers.kernels.inner import half", "twice", "half(4.0 * x)"))
    found = []
    for share in ("0.5", "0.25"):
        inner.write_text(decorated.format("", "half", f"{share} * x"))
        outside = "cpbench_solvers.kernels.outer"
        code = f"from cpbench.foundation.kernel_cache import load; print(load('{outside}').twice(1.0))"
        environment = {**os.environ, "PYTHONPATH": str(tmp_path), cache.VARIABLE: ""}
        command = [sys.executable, "-c", code]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        found.append(float(done.stdout))
    assert found == [2.0, 1.0]


def problems(solver: Solver) -> Iterator[Problem]:
    """Of three sizes, dense by rows and by columns, and sparse."""
    for n in (1, 3, 70):
        M = np.eye(3 * n) * 2 + np.diag(np.full(3 * n - 1, -0.5), 1)
        for matrix in (M, sp.csr_array(M), np.asfortranarray(M)):
            problem = MADE[solver.spec.node](matrix, np.tile([-1.0, 0.5, 0.0], n))
            if solver.obstacle(problem) is None:
                yield problem


@pytest.mark.parametrize("name", some_by_day(NATIVE, 12))
def test_nothing_compiles_after_the_warm_up(name: str) -> None:
    """Read-only data, views and another size meet the signatures that the warm-up has compiled."""
    from numba.core.compiler import CompilerBase

    solver = solvers.get(name)
    solver.warmup()
    compiled: list[str] = []
    before = CompilerBase.compile_extra

    def watched(self, func):
        compiled.append(func.__name__)
        return before(self, func)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(CompilerBase, "compile_extra", watched)
        for problem in problems(solver):
            solver.run(problem, Budget(iterations=50))
    assert compiled == []
