"""Problems of cpbench's nodes as Siconos' problems: which structure, which driver, which unknowns it fills."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np
from siconos_memory import LIBRARY, copied, matrix, structure

INT, POINTER, DOUBLE = ctypes.c_int, ctypes.c_void_p, ctypes.c_double
SECOND_ORDER = 3.0
"""Number of that factor in the cone_kind of a soclcp."""
ROLLING = 5
"""Rows of a contact of which Siconos finds no diagonal block in block storage (NM_extract_diag_block5 asserts 0)."""


class Loaded:
    """A problem in the memory of C: what a driver of NonSmoothDrivers.h takes beside its options.

    Attributes
    ----------
    driver : name of the C function. address : of the problem. init : C function to call first, if any.
    arrays : the unknowns that the driver fills, in its order.
    """

    def __init__(
        self,
        driver: str,
        address: int,
        sizes: tuple[int, ...],
        answer: Callable[..., Mapping[str, Any]],
        init: str = "",
    ) -> None:
        self.driver, self.address, self.init = driver, address, init
        self.arrays = [np.zeros(size) for size in sizes]
        self._answer = answer

    def start(self, guess: Mapping[str, Any]) -> None:
        """Set all unknowns to 0, or what `guess` has of them."""
        for array in self.arrays:
            array[:] = 0.0
        for name, part in self._answer(*self.arrays).items():  # views into the arrays
            if name in guess:
                part[:] = guess[name]

    def call(self, options: int) -> int:
        """Run the driver; its info."""
        problem, settings = POINTER(self.address), POINTER(options)
        if self.init:
            getattr(LIBRARY, self.init)(problem, settings)
        unknowns = [POINTER(array.ctypes.data) for array in self.arrays]
        return int(getattr(LIBRARY, self.driver)(problem, *unknowns, settings))

    def counters(self) -> dict[str, int]:
        """Return what is counted beside iterations."""
        return {}

    def answer(self) -> Mapping[str, Any]:
        """Return the parts of the node's point."""
        return self._answer(*self.arrays)


LOADERS: dict[str, Callable[[Mapping[str, Any], str, int], Loaded]] = {}
"""Function that brings a problem into the memory of C, by node."""
Loader = TypeVar("Loader", bound=Callable[[Mapping[str, Any], str, int], Loaded])


def loads(*nodes: str) -> Callable[[Loader], Loader]:
    """Return a decorator that enters the loader of some nodes."""

    def enter(loader: Loader) -> Loader:
        LOADERS.update(dict.fromkeys(nodes, loader))
        return loader

    return enter


@loads("lcp")
def _lcp(data: Mapping[str, Any], storage: str, dimension: int) -> Loaded:
    """Return LinearComplementarityProblem.h. Blocks have the most rows, up to 4, that divide n; n tells no better."""
    n = len(data["q"])
    block = max(b for b in (1, 2, 3, 4) if n % b == 0)
    fields = {"size": (INT, n), "M": (POINTER, matrix(data["M"], storage, block)), "q": (POINTER, copied(data["q"]))}
    return Loaded("linearComplementarity_driver", structure(**fields), (n, n), lambda z, w: {"z": z})


@loads("mlcp")
def _mlcp(data: Mapping[str, Any], storage: str, dimension: int) -> Loaded:
    """Return MixedLinearComplementarityProblem.h, in both of its storages (M, q and A, B, C, D, a, b) as Siconos'
    own files have them. One block of equalities and one of complementarities, or one a row where M is stored in
    blocks."""
    A, B, C, D = (
        np.asfortranarray(data[name] if isinstance(data[name], np.ndarray) else data[name].toarray()) for name in "ABCD"
    )
    n, m = A.shape[0], B.shape[0]
    ends, kinds = ([0, n, n + m], [0, 1]) if n and m else ([0, n + m], [int(m > 0)])
    if storage == "blocks":
        ends, kinds = list(range(n + m + 1)), [0] * n + [1] * m
    fields = {
        "isStorageType1": (INT, 1),
        "isStorageType2": (INT, 1),
        "n": (INT, n),
        "m": (INT, m),
        "blocksRows": (POINTER, copied(ends, np.int32)),
        "blocksIsComp": (POINTER, copied(kinds, np.int32)),
        "M": (POINTER, matrix(np.block([[A, C], [D, B]]), storage, 1)),
        "q": (POINTER, copied(np.concatenate([data["a"], data["b"]]))),
        **{name: (POINTER, copied(X.T)) for name, X in zip("ABCD", (A, B, C, D), strict=True)},  # by columns
        **{name: (POINTER, copied(data[name])) for name in "ab"},
    }
    return Loaded(
        "mlcp_driver",
        structure(**fields),
        (n + m, n + m),
        lambda z, w: {"u": z[:n], "v": z[n:]},
        init="mlcp_driver_init",
    )


@loads("relay")
def _relay(data: Mapping[str, Any], storage: str, dimension: int) -> Loaded:
    """Return RelayProblem.h."""
    n = len(data["q"])
    fields = {
        "size": (INT, n),
        "M": (POINTER, matrix(data["M"], storage, 1)),
        **{name: (POINTER, copied(data[name])) for name in ("q", "lb", "ub")},
    }
    return Loaded("relay_driver", structure(**fields), (n, n), lambda z, w: {"z": z})


@loads("soclcp")
def _soclcp(data: Mapping[str, Any], storage: str, dimension: int) -> Loaded:
    """Return SecondOrderConeLinearComplementarityProblem.h: n, nc, M, q, cone ends, tau; second-order cones alone."""
    if (data["cone_kind"] != SECOND_ORDER).any():
        raise ValueError("has a factor that is not a second-order cone")
    n, nc = len(data["q"]), len(data["cone_size"])
    ends = np.concatenate([[0], np.cumsum(data["cone_size"])])
    fields = {
        "n": (INT, n),
        "nc": (INT, nc),
        "M": (POINTER, matrix(data["M"], storage, 1)),
        "q": (POINTER, copied(data["q"])),
        "coneIndex": (POINTER, copied(ends, np.uint32)),
        "tau": (POINTER, copied(data["cone_mu"])),
    }
    return Loaded("soclcp_driver", structure(**fields), (n, n), lambda r, v: {"x": r})


@loads("fc", "rfc")
def _local(data: Mapping[str, Any], storage: str, dimension: int) -> Loaded:
    """Return FrictionContactProblem.h and RollingFrictionContactProblem.h."""
    rolling = "mu_r" in data
    drivers = {
        (2, 0): "fc2d_driver",
        (3, 0): "fc3d_driver",
        (3, 1): "rolling_fc2d_driver",
        (5, 1): "rolling_fc3d_driver",
    }
    m, nc = len(data["q"]), len(data["mu"])
    fields = {
        "dimension": (INT, dimension),
        "numberOfContacts": (INT, nc),
        "M": (POINTER, matrix(data["W"], storage, dimension)),
        "q": (POINTER, copied(data["q"])),
        "mu": (POINTER, copied(data["mu"])),
    }
    if rolling:
        fields["mu_r"] = (POINTER, copied(data["mu_r"]))
    return Loaded(drivers[dimension, rolling], structure(**fields), (m, m), lambda r, u: {"r": r})


@loads("gfc", "grfc")
def _global(data: Mapping[str, Any], storage: str, dimension: int) -> Loaded:
    """Return GlobalFrictionContactProblem.h and GlobalRollingFrictionContactProblem.h: Mv = Hr + q, u = Hᵀv + b."""
    rolling = "mu_r" in data
    n, m, nc = len(data["f"]), len(data["w"]), len(data["mu"])
    f, w = data["f"], data["w"]
    fields = {
        "dimension": (INT, dimension),
        "numberOfContacts": (INT, nc),
        "M": (POINTER, matrix(data["M"], storage, 1)),
        "H": (POINTER, matrix(data["H"], storage, 1)),
        "q": (POINTER, copied(f)),
    }
    if rolling:
        fields |= {
            "b": (POINTER, copied(w)),
            "mu": (POINTER, copied(data["mu"])),
            "mu_r": (POINTER, copied(data["mu_r"])),
        }
    else:
        fields |= {
            "norm_q": (DOUBLE, float(np.linalg.norm(f))),
            "b": (POINTER, copied(w)),
            "norm_b": (DOUBLE, float(np.linalg.norm(w))),
            "mu": (POINTER, copied(data["mu"])),
            "env": (POINTER, None),
        }
    return Loaded(
        "g_rolling_fc3d_driver" if rolling else "gfc3d_driver",
        structure(**fields),
        (m, m, n),
        lambda r, u, v: {"v": v, "r": r, "lam": np.zeros(0)},
    )


def load(node: str, data: Mapping[str, Any], storage: str, dimension: int) -> Loaded:
    """Bring a problem into the memory of C; `given` is dense where the problem is, else in blocks, or sparse."""
    if storage == "given":
        dense = all(isinstance(M, np.ndarray) for M in data.values())
        storage = "dense" if dense else "sparse" if dimension == ROLLING else "blocks"
    return LOADERS[node](data, storage, dimension)
