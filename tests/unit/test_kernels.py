"""Kernels: compiled when the package is built, and the same functions in Python where they were not."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cpbench.conversions.kernels import congruence
from cpbench.foundation import kernel_build, kernels
from cpbench.foundation.kernels import DATA, INDEX, float64, int64, read_only, tuple_of
from cpbench.solvers import solvers

ROOT = Path(kernels.__file__).parents[2]
SOLVE = (
    "import numpy as np, cpbench as cp; s = cp.solve(cp.LCP(M=[[2., 1.], [1., 2.]], q=[-1., -1.]), 'pgs'); "
    "import sys; print(bool(s), 'numba' in sys.modules, s.x)"
)


def test_signatures_are_written_as_numba_reads_them() -> None:
    from numba import types
    from numba.core.sigutils import normalize_signature

    signature = tuple_of(int64, float64)(DATA, INDEX, float64[:, ::1])
    arguments, result = normalize_signature(signature.text)
    assert result == types.Tuple((types.int64, types.float64))
    assert arguments[0] == types.Array(types.float64, 1, "C", readonly=True)
    assert arguments[2] == types.Array(types.float64, 2, "C")
    assert read_only(float64, 3).text == "Array(float64, 3, 'C', True)"


@pytest.mark.needs("cpbench_solvers")
def test_kernels_are_compiled_and_need_no_numba() -> None:
    assert list(solvers)
    assert kernels.not_compiled == []
    found = subprocess.run([sys.executable, "-c", SOLVE], capture_output=True, text=True, check=True).stdout
    assert found.startswith("True False [0.33")


def test_a_kernel_of_two_types_of_indices_takes_both() -> None:
    for index in (np.int32, np.int64):
        blocks = np.empty(1, np.int64)
        congruence.count_blocks(np.array([0, 1, 2], index), np.array([0, 3], index), np.empty(2, np.int64), blocks)
        assert blocks[0] == 2


def test_a_package_of_kernels_that_is_not_installed_is_not_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """As `cpbench_solvers`, which the core does without."""
    monkeypatch.setattr(kernels, "PACKAGES", ("absent_package.kernels",))
    assert "NOT" not in kernels.described()


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """Sources without libraries."""
    ignored = shutil.ignore_patterns("__pycache__", "_compiled_*", "problems")
    for package in ("cpbench", "cpbench_solvers"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=ignored)
    return tmp_path


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("changed", [False, True])
def test_without_current_libraries_python_runs_them(elsewhere: Path, changed: bool) -> None:
    """The same answer, and a warning."""
    if changed:
        folder = Path("cpbench_solvers", "kernels")
        for file in (ROOT / folder).glob("_compiled_*"):
            shutil.copy(file, elsewhere / folder)
        with (elsewhere / folder / "vectors.py").open("a") as source:
            source.write("# changed\n")
    environment = {**os.environ, "PYTHONPATH": str(elsewhere)}
    run = {"env": environment, "cwd": elsewhere, "capture_output": True, "text": True, "check": True}
    done = subprocess.run([sys.executable, "-c", SOLVE], **run)
    assert done.stdout.startswith("True False [0.33")
    assert "RuntimeWarning: kernels: NOT compiled" in done.stderr


PRODUCT = """
from cpbench.foundation.kernels import DATA, float64, kernel


@kernel(float64(DATA, DATA))
def product(x, y):
    total = 0.0
    for k in range(x.size):
        total += x[k] * y[k]
    return total
"""


def test_a_package_of_a_stranger_is_compiled_by_its_name(tmp_path: Path) -> None:
    """What stands above its kernels is not imported; Python runs them before, with a warning that names them."""
    folder = tmp_path / "stranger" / "kernels"
    folder.mkdir(parents=True)
    (tmp_path / "stranger" / "__init__.py").write_text("from stranger.kernels.products import product\n")
    (folder / "__init__.py").touch()
    (folder / "products.py").write_text(PRODUCT)
    run = {"env": {**os.environ, "PYTHONPATH": str(ROOT)}, "cwd": tmp_path, "capture_output": True, "text": True}
    use = "import numpy as np, stranger as s; x = np.arange(3.0); print(type(s.product).__name__, s.product(x, x))"
    del run["env"][kernels.CHECKED]
    before = subprocess.run([sys.executable, "-c", use], check=True, **run)
    assert before.stdout == "function 5.0\n"
    assert "kernel_build stranger.kernels" in before.stderr
    command = [sys.executable, "-m", "cpbench.foundation.kernel_build", "stranger.kernels"]
    subprocess.run(command, check=True, **run)
    after = subprocess.run([sys.executable, "-c", use], check=True, **run)
    assert (after.stdout, after.stderr) == ("builtin_function_or_method 5.0\n", "")


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.nightly
def test_a_changed_kernel_is_compiled_anew(elsewhere: Path) -> None:
    script = elsewhere / "cpbench" / "foundation" / "kernel_build.py"
    package, level = "cpbench.formulations.expressions.kernels", kernels.level()
    file = elsewhere.joinpath(*package.split(".")) / "interpreter.py"
    for result in ("c = a + b", "c = a + b + 1.0"):
        file.write_text(file.read_text().replace("c = a + b", result, 1))
        subprocess.run([sys.executable, script, package], check=True)
        code = (
            f"import sys; sys.path.insert(0, {str(elsewhere)!r}); import numpy as np; "
            f"from {package} import interpreter as i; r = np.empty(1); "
            "i.run(np.array([[32, 0, 1]]), np.array([1.0, 2.0]), np.empty(0), np.array([2]), np.empty(3), r); "
            "print(r[0])"
        )
        found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        assert float(found) == (3.0 if result.endswith("b") else 4.0)
    assert kernel_build.MODELS[level] is not None
