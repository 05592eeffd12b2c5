"""Files of every reader for `fuzz_readers`, mutants of named arrays, and what HiGHS reads in an MPS file."""

from __future__ import annotations

import gzip
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import highspy
import numpy as np
import scipy.io
from test_mof_cones import affine, cone, least, model
from test_mps import objective
from test_mutants import GAMS, LP, MPS, SEEDS

import cpbench
from cpbench import storage
from cpbench.errors import CpbenchError
from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.storage.two_sided import INFINITE

READERS = ("arrays", "mps", "lp", "nl", "gams", "mof", "text", "own")
RANGED = MPS.replace("BOUNDS", "RANGES\n    RNG  LOW  2.5  UP  1.5\nBOUNDS").replace(" UP BND", " MI BND  Y\n UP BND")
MAXIMUM = MPS.replace("ROWS", "OBJSENSE\n    MAX\nROWS").replace("RHS  LOW", "RHS  COST  -2.5  LOW")
WHOLE = MPS.replace("QUADOBJ", "QMATRIX").replace("    Y  X  0.5\n", "    Y  X  0.5\n    X  Y  0.5\n")
LPS = (
    LP,
    "maximize\n o: 2 a + 3 b - 0.5 c + 4\nsubject to\n r: a + b + c <= 4\n s: -2 <= a - b <= 3\n e: a + 2 c = 1.5\n"
    "bounds\n -3 <= a <= 2\n b >= -1\n c free\nend\n",
)
NODES = ("ncp", "micp", "nlp", "qp", "lcp")
GENERATOR = np.random.default_rng(34)
HALF = GENERATOR.normal(size=(6, 6))
S, V, B = HALF @ HALF.T + np.eye(6), GENERATOR.normal(size=6), GENERATOR.normal(size=(3, 6))
BOX = {"lb": -np.ones(6), "ub": np.full(6, np.inf)}
ARRAYS: tuple[dict[str, Any], ...] = (
    {"M": HALF, "q": V},
    {"W": S, "q": V, "mu": np.array([0.3, 0.7])},
    {"M": S, "H": HALF, "f": V, "w": V, "mu": np.array([0.3, 0.7])},
    {"A": S[:3, :3], "B": S[3:, 3:], "C": S[:3, 3:], "D": S[3:, :3], "a": V[:3], "b": V[3:]},
    {"Q": S, "p": V, "A": B, "b": V[:3], "C": B[:2] + 1.0, "d": V[:2], **BOX},
    {"P": S, "q": V, "G": B, "h": V[:3], "A": B[:2] + 1.0, "b": V[:2], **BOX},
    {"P": S, "q": V, "A": B, "l": V[:3] - 1.0, "u": V[:3] + 1.0},
    {"H": S, "f": V, "A": B, "b": V[:3], "Aeq": B[:2] + 1.0, "beq": V[:2], **BOX},
    {"A": S, "b": V, "lo": -np.ones(6), "hi": np.full(6, 2.0), "findex": np.full(6, -1.0)},
)
"""Problems in the forms of cpbench, qpsolvers, OSQP, quadprog and physics engines."""
NAMES = sorted({name for arrays in ARRAYS for name in arrays} | {"l", "u", "lower", "upper", "x0", "n", "stick", "P0"})
SIDES = ("h", "b")
"""Right sides: a row of which it is infinite holds everywhere."""
ASIDE = ("x0", "initvals", "lam0", "n", "m")
"""Names that forms have beside the problem."""


def _of_tests(*names: str) -> Callable[[Path], list[tuple[str, bytes]]]:
    def made(folder: Path) -> list[tuple[str, bytes]]:
        files: list[tuple[str, bytes]] = []
        for name in names:
            SEEDS[name](folder / name)
            files.append((name, (folder / name).read_bytes()))
        return files

    return made


def _mps(folder: Path) -> list[tuple[str, bytes]]:
    texts = [text.encode() for text in (MPS, RANGED, MAXIMUM, WHOLE)]
    free = b"\n".join(b" ".join(line.split()) if line[:1] == b" " else line for line in texts[1].split(b"\n"))
    return [*((f"p{k}.mps", text) for k, text in enumerate(texts)), ("p.qps", texts[0]), ("f.mps", free),
            ("p.mps.gz", gzip.compress(texts[1]))]  # fmt: skip


def _nl(folder: Path) -> list[tuple[str, bytes]]:
    files = _of_tests("program.nl", "binary.nl")(folder)
    for node in NODES:
        for k, address in enumerate(
            storage.problem_files([Path(cpbench.__file__).parents[1] / "problems" / node])[:12]
        ):
            for kind, flavour in (("t", "nl"), ("b", "nl-binary")):
                place = folder / f"{node}{k}{kind}.nl"
                try:
                    storage.save(storage.load(address), place, format=flavour)
                except CpbenchError:
                    continue
                files.append((place.name, place.read_bytes()))
    return [(name, whole) for name, whole in files if len(whole) < 20_000]


def _gams(folder: Path) -> list[tuple[str, bytes]]:
    shared = sorted((Path(__file__).resolve().parents[3] / "shared/data/gams").glob("*.gms"))
    small = [(path.name, path.read_bytes()) for path in shared if path.stat().st_size < 3000]
    return [("model.gms", GAMS.encode()), *small]


def _mof(folder: Path) -> list[tuple[str, bytes]]:
    cones = (cone(kind, affine(B[:, :3], V[:3])) for kind in ("SecondOrderCone", "RotatedSecondOrderCone"))
    texts = [model(least(V[:3], S[:3, :3]), [constraint]) for constraint in cones]
    return [*_of_tests("model.mof.json")(folder), *((f"c{k}.mof.json", text.encode()) for k, text in enumerate(texts))]


FILES: dict[str, Callable[[Path], list[tuple[str, bytes]]]] = {
    "arrays": _of_tests("arrays.npz", "packed.npz", "arrays.mat"),
    "mps": _mps,
    "lp": lambda folder: [(f"p{k}.lp", text.encode()) for k, text in enumerate(LPS)],
    "nl": _nl,
    "gams": _gams,
    "mof": _mof,
    "text": _of_tests("matrix.mtx", "triples.txt", "case-M1.txt", "array.npy"),
    "own": _of_tests("own.h5", "contact.h5", "fclib.hdf5", "siconos.dat"),
}
"""Names and contents of the files that are damaged, by reader."""


class ArrayMutant:
    """Named arrays of one problem, changed in names, shapes and types, as one file or a folder."""

    def __init__(self, draw: random.Random) -> None:
        self.draw, self.arrays = draw, dict(draw.choice(ARRAYS))
        self.suffix = draw.choice((".npz", ".mat", ".h5", ""))
        for _ in range(draw.choice((0, 1, 1, 1, 2))):
            self._change()

    def _change(self) -> None:
        draw, arrays = self.draw, self.arrays
        name = draw.choice(list(arrays))
        value = np.asarray(arrays[name])
        match draw.randrange(9):
            case 0:
                arrays[draw.choice(NAMES)] = arrays.pop(name)
            case 1 if len(arrays) > 1:
                del arrays[name]
            case 2:
                arrays[draw.choice(NAMES)] = value.copy()
            case 3 if value.ndim:
                arrays[name] = value.T if value.ndim > 1 else value[:, None] if draw.random() < 0.5 else value[None, :]
            case 4 if value.ndim:
                arrays[name] = value[draw.choice((slice(1, None), slice(0), slice(None, None, 2)))]
            case 5:
                with np.errstate(invalid="ignore"):
                    arrays[name] = np.nan_to_num(value).astype(draw.choice(("i4", "f4", "c16", "?", "U3", ">f8")))
            case 6 if value.size and value.dtype.kind == "f":
                arrays[name] = value.copy()
                arrays[name].flat[draw.randrange(value.size)] = draw.choice(
                    (np.nan, np.inf, -np.inf, 1e308, 5e-324, -1.0)
                )
            case 7 if value.ndim == 2:
                arrays[name] = draw.choice((np.triu, np.tril))(value)
            case _:
                arrays[name] = draw.choice((np.zeros(0), np.float64(2.0), np.zeros((2, 2, 2)), np.zeros((0, 6))))

    def write(self, path: Path, arrays: dict[str, Any] | None = None) -> Path:
        """Write the arrays, in place of what is there."""
        arrays = self.arrays if arrays is None else arrays
        shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
        if self.suffix == ".npz":
            np.savez(path, **arrays)
        elif self.suffix == ".mat":
            scipy.io.savemat(path, arrays)
        elif self.suffix == ".h5":
            with h5py.File(path, "w") as file:
                for name, value in arrays.items():
                    file[name] = value.astype("S") if np.asarray(value).dtype.kind == "U" else value
        else:
            path.mkdir()
            for name, value in arrays.items():
                np.save(path / f"{name}.npy", value)
        return path

    def require_every_array(self, problem: Problem, path: Path) -> None:
        """Raise AssertionError where an array may have another entry and the problem is the same."""
        sides = [np.asarray(value) for name, value in self.arrays.items() if name in SIDES]
        if any((abs(side) >= INFINITE).any() for side in sides if side.dtype.kind == "f"):
            return
        for name, value in self.arrays.items():
            other = np.array(value, copy=True)
            if name in ASIDE or not other.size or other.dtype.kind not in "fiu":
                continue
            at = self.draw.randrange(other.size)
            other.flat[at] = other.flat[at] + 1 if np.isfinite(other.flat[at]) and abs(other.flat[at]) < 1e15 else 0
            self.write(path, {**self.arrays, name: other})
            try:
                changed = storage.load(path)
            except CpbenchError:
                continue
            if (changed.fingerprint, changed.info.properties) == (problem.fingerprint, problem.info.properties):
                raise AssertionError(f"entry {at} of {name} has no effect")


def require_highs(problem: Any, path: Path) -> None:
    """Raise AssertionError where HiGHS reads another problem in the file, and warns of nothing."""
    if "free_rows" in problem.info.properties:  # HiGHS takes the right side of one for a constant of the objective
        return
    log = path.with_name("highs.log")
    log.unlink(missing_ok=True)
    reader = highspy.Highs()
    for option, value in (("log_to_console", False), ("log_file", str(log)), ("small_matrix_value", 1e-12)):
        reader.setOptionValue(option, value)
    if reader.readModel(str(path)) != highspy.HighsStatus.kOk or "WARNING" in log.read_text("latin-1"):
        return
    found = reader.getModel()
    lp, Q = found.lp_, found.hessian_
    if lp.num_col_ != problem.p.size:
        raise AssertionError(f"HiGHS has {lp.num_col_} unknowns")
    A = np.zeros((lp.num_row_, lp.num_col_))
    for i, j, value in _entries(lp.a_matrix_, lp.num_col_):
        A[i, j] += value
    H = np.zeros((lp.num_col_, lp.num_col_))
    for i, j, value in _entries(Q, Q.dim_):
        H[i, j] = H[j, i] = value
    z = np.random.default_rng(0).normal(size=lp.num_col_)
    with np.errstate(all="ignore"):
        theirs, ours = lp.offset_ + lp.col_cost_ @ z + 0.5 * z @ H @ z, objective(problem, z)
    if not np.isclose(theirs, ours, rtol=1e-9, atol=1e-9, equal_nan=True):
        raise AssertionError(f"the objective is {ours}, by HiGHS {theirs}")
    if not (np.array_equal(lp.col_lower_, problem.lb) and np.array_equal(lp.col_upper_, problem.ub)):
        raise AssertionError(f"bounds are {problem.lb}, {problem.ub}, by HiGHS {lp.col_lower_}, {lp.col_upper_}")
    if _rows_of(A, lp.row_lower_, lp.row_upper_) != _rows(problem):
        raise AssertionError(f"rows are {_rows(problem)}, by HiGHS {_rows_of(A, lp.row_lower_, lp.row_upper_)}")


def _entries(M: Any, columns: int) -> list[tuple[int, int, float]]:
    """The entries of a matrix of HiGHS that is kept by columns."""
    start, index, value = M.start_, M.index_, M.value_
    return [(index[at], j, value[at]) for j in range(columns) for at in range(start[j], start[j + 1])]


def _rows_of(A: Any, lower: Any, upper: Any) -> list[list[float]]:
    """Rows between two sides as az >= b (0 first) and az = b (1 first), sorted."""
    rows: list[list[float]] = []
    for a, low, high in zip(A.tolist(), lower, upper, strict=True):
        if low == high:
            rows.append([1.0, *a, low])
        else:
            rows += [[0.0, *a, low]] * bool(np.isfinite(low)) + [[0.0, *(-x for x in a), -high]] * bool(
                np.isfinite(high)
            )
    return sorted([x + 0.0 for x in row] for row in rows)


def _rows(problem: Any) -> list[list[float]]:
    parts = ((0.0, problem.A, problem.b), (1.0, problem.C, problem.d))
    rows = [[k, *a, b] for k, M, side in parts for a, b in zip(matrices.dense(M).tolist(), side.tolist(), strict=True)]
    return sorted([x + 0.0 for x in row] for row in rows)
