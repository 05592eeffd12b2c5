"""Nonlinear problems of cpbench's nodes as Siconos' problems, whose functions are called back.

A map comes as its list of operations and that of its Jacobian (exchange npy-dir). They are evaluated, and sets
projected on, by the modules that cpbench itself does it with, which need NumPy alone; the rest of the package is not
imported. Jacobians are dense, which all of Siconos' solvers take. What happens in a function that C calls cannot be
raised there: it is kept, the function gives NaN from then on, and `call` raises it when Siconos returns.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from siconos_memory import DENSE, LIBRARY, NumericsMatrix, copied, structure
from siconos_problems import INT, POINTER, Loaded

PACKAGES = ("cpbench", "cpbench.formulations.expressions")
for _package in PACKAGES:  # empty ones: nothing but the modules below is read
    _module = ModuleType(_package)
    _module.__path__ = [str(Path(__file__).resolve().parents[2] / _package.replace(".", "/"))]
    sys.modules[_package] = _module

from cpbench.formulations.expressions.batches import Batches  # noqa: E402
from cpbench.foundation.cones import ProductCone, project_box  # noqa: E402

F_OF_SELF = ctypes.CFUNCTYPE(None, POINTER, INT, POINTER, POINTER)
"""(env, n, z, F) of NCP, MCP and VI, and (env, n, z, NumericsMatrix*) of their Jacobians."""
F_OLD = ctypes.CFUNCTYPE(None, INT, POINTER, POINTER)
"""(n, z, F) and (n, z, double*) of the old MCP."""
PROJECTION = ctypes.CFUNCTYPE(None, POINTER, POINTER, POINTER)
BOX = 1
"""SICONOS_SET_BOX of SiconosSets.h."""


def _array(address: int, *shape: int) -> Any:
    """Return memory of C as an array by columns."""
    numbers: Any = (ctypes.c_double * int(np.prod(shape))).from_address(address)
    return np.frombuffer(numbers).reshape(shape, order="F")


def _batches(data: Mapping[str, Any], name: str, inputs: int) -> Batches:
    parts = {part: data[f"{name}.{part}"] for part in ("constants", "heads", "left", "right", "outputs")}
    listed: Any = SimpleNamespace(inputs=inputs, operations=len(parts["heads"]), **parts)
    return Batches(listed)


class Smooth:
    """v ↦ sF(z) and its Jacobian for z = shift + sv, unknowns in the order `order`; `failure`: the first exception."""

    def __init__(self, data: Mapping[str, Any], order: Any, sign: Any, shift: Any) -> None:
        n = int(data["F.inputs"][0])
        self.value, self.entries = _batches(data, "F", n), _batches(data, "F.jacobian", n)
        position = np.argsort(order)
        self.order, self.sign, self.shift = order, sign, shift
        rows = np.repeat(np.arange(n), np.diff(data["F.jacobian.indptr"]))
        self.rows, self.columns = position[rows], position[data["F.jacobian.indices"]]
        self.signs = sign[self.rows] * sign[self.columns]
        self.n, self.evaluations, self.jacobians = n, 0, 0
        self.failure: Exception | None = None

    def unknowns(self, v: Any) -> Any:
        """Return z of v, in the order of the problem."""
        z = np.empty(self.n)
        z[self.order] = self.shift + self.sign * v
        return z

    def evaluate(self, v: int, out: int) -> None:
        """Write F(z); both are addresses of n numbers."""
        self._write(_array(out, self.n), lambda: self.sign * self.value(self.unknowns(_array(v, self.n)))[self.order])
        self.evaluations += 1

    def differentiate(self, v: int, out: int) -> None:
        """Write F′(z) to `out`, the address of n² numbers, by columns."""
        J = _array(out, self.n, self.n)
        J[:] = 0.0
        entries = np.empty(len(self.rows))
        self._write(entries, lambda: self.signs * self.entries(self.unknowns(_array(v, self.n))))
        J[self.rows, self.columns] = entries
        self.jacobians += 1

    def _write(self, out: Any, compute: Callable[[], Any]) -> None:
        try:
            if self.failure is None:
                out[:] = compute()
                return
        except Exception as cause:
            self.failure = cause
        out[:] = np.nan


class Called(Loaded):
    """A problem with functions; its structure is made anew for every solve, for some solvers free what they got."""

    def __init__(
        self,
        driver: str,
        smooth: Smooth,
        make: Callable[[Called], int],
        init: str = "",
        without: tuple[str, ...] = (),
    ) -> None:
        none = {name: np.zeros(0) for name in without}  # parts of a point that are empty
        super().__init__(driver, 0, (smooth.n, smooth.n), lambda v, w: {"z": smooth.unknowns(v), **none}, init)
        self.smooth, self._make = smooth, make
        self.held: list[Any] = []

    def start(self, guess: Mapping[str, Any]) -> None:
        smooth = self.smooth
        self.arrays[0][:] = smooth.sign * (guess["z"][smooth.order] - smooth.shift)
        self.arrays[1][:] = 0.0
        smooth.evaluations = smooth.jacobians = 0
        smooth.failure = None

    def call(self, options: int) -> int:
        self.held.clear()
        self.address = self._make(self)
        info = super().call(options)
        if self.smooth.failure is not None:
            raise self.smooth.failure
        return info

    def counters(self) -> dict[str, int]:
        return {"evaluations": self.smooth.evaluations, "jacobians": self.smooth.jacobians}

    def pointer(self, kind: Any, function: Callable[..., None]) -> tuple[Any, Any]:
        """Return a field of a structure: a function of ours, which lives until the next solve."""
        self.held.append(kind(function))
        return POINTER, ctypes.cast(self.held[-1], POINTER).value

    def functions(self) -> tuple[tuple[Any, Any], tuple[Any, Any], tuple[Any, Any]]:
        """Return F, its Jacobian, and the matrix that Siconos holds for it, as fields."""
        smooth = self.smooth
        F = self.pointer(F_OF_SELF, lambda env, n, v, out: smooth.evaluate(v, out))
        J = self.pointer(
            F_OF_SELF, lambda env, n, v, out: smooth.differentiate(v, NumericsMatrix.from_address(out).dense)
        )
        return F, J, (POINTER, LIBRARY.NM_create(DENSE, smooth.n, smooth.n))


def _ncp(data: Mapping[str, Any], solver: str) -> Called:
    """Return NonlinearComplementarityProblem.h."""
    smooth = Smooth(data, *_as_it_is(data))

    def make(called: Called) -> int:
        F, J, matrix = called.functions()
        n = (INT, smooth.n)
        return structure(n=n, compute_F=F, compute_nabla_F=J, nabla_F=matrix, env=(POINTER, None))

    return Called("ncp_driver", smooth, make)


def _mcp(data: Mapping[str, Any], solver: str) -> Called:
    """Return MixedComplementarityProblem.h: free unknowns first, then those with a bound, measured from it."""
    lb, ub = data["lb"], data["ub"]
    free = np.isinf(lb) & np.isinf(ub)
    order = np.concatenate([np.flatnonzero(free), np.flatnonzero(~free)])
    sign = np.where(np.isinf(lb) & np.isfinite(ub), -1.0, 1.0)
    shift = np.where(free, 0.0, np.where(sign < 0, ub, lb))
    smooth = Smooth(data, order, sign[order], shift[order])
    n1 = int(free.sum())
    n2 = smooth.n - n1

    def make(called: Called) -> int:
        F, J, matrix = called.functions()
        return structure(n1=(INT, n1), n2=(INT, n2), F=F, nabla_F=J, matrix=matrix, env=(POINTER, None))

    def make_old(called: Called) -> int:
        F = called.pointer(F_OLD, lambda n, v, out: smooth.evaluate(v, out))
        J = called.pointer(F_OLD, lambda n, v, out: smooth.differentiate(v, out))
        none = (POINTER, None)  # mcp_old_driver_init has its own memory
        return structure(n1=(INT, n1), n2=(INT, n2), F=F, nabla_F=J, values=none, matrix=none)

    if solver == "SICONOS_MCP_OLD_FB":
        return Called("mcp_old_driver", smooth, make_old, init="mcp_old_driver_init")
    return Called("mcp_driver", smooth, make)


def _vi(data: Mapping[str, Any], solver: str) -> Called:
    """Return VariationalInequality.h: a projection, and bounds for the solvers of boxes."""
    smooth = Smooth(data, *_as_it_is(data))
    n, lb, ub = smooth.n, data["lb"], data["ub"]
    parts = [data.get(f"cone_{part}", np.zeros(0)) for part in ("kind", "size", "mu", "mu_r")]
    cone = ProductCone(*parts) if len(parts[0]) else None

    def project(self: int, x: int, out: int) -> None:
        point = _array(x, n)
        _array(out, n)[:] = project_box(point if cone is None else cone.project(point), lb, ub)

    def make(called: Called) -> int:
        F, J, matrix = called.functions()
        box = structure(id=(INT, BOX), lb=(POINTER, copied(lb)), ub=(POINTER, copied(ub)))
        return structure(
            size=(INT, n),
            env=(POINTER, None),
            F=F,
            compute_nabla_F=J,
            ProjectionOnX=called.pointer(PROJECTION, project),
            normVI=(ctypes.c_double, 1.0),  # set: Siconos' errors are absolute
            istheNormVIset=(INT, 1),
            set=(POINTER, box),
            nabla_F=matrix,
        )

    return Called("variationalInequality_driver", smooth, make, without=("lam", "mu", "nu") if "b" in data else ())


def _as_it_is(data: Mapping[str, Any]) -> tuple[Any, Any, Any]:
    n = int(data["F.inputs"][0])
    return np.arange(n), np.ones(n), np.zeros(n)


LOADERS: Mapping[str, Callable[[Mapping[str, Any], str], Called]] = {"NCP": _ncp, "MCP": _mcp, "VI": _vi}


def load(solver: str, data: Mapping[str, Any]) -> Called:
    """Return the structure that a solver takes: its constant says which (SICONOS_MCP_OLD_FB)."""
    return LOADERS[solver.split("_")[1]](data, solver)
