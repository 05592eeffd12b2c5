"""Modules that the forkserver has loaded before anybody asks: every process forked from it starts with what referee
and workers have in common."""

from __future__ import annotations

import contextlib
import gc
import importlib
import os

from cpbench.foundation.imports import uncollected

MODULES = (
    "numpy",
    "scipy.sparse.linalg",
    "scipy.linalg",
    "scipy.optimize",
    "h5py",
    "cpbench.formulations",
    "cpbench.formulations.expressions.evaluation",
    "cpbench.storage",
    "cpbench.conversions",
    "cpbench.solvers",
    "cpbench.bench.referee",
    "cpbench.bench.worker",
)


def preload() -> None:
    """Import them; a module that cannot be imported is left to the process that needs it, which reports why."""
    with uncollected():
        for module in MODULES:
            with contextlib.suppress(Exception):
                importlib.import_module(module)
        with contextlib.suppress(Exception):
            importlib.import_module("cpbench.solvers").solvers.discover()  # modules of solvers, not their packages
    os.environ.pop("PYTHONSAFEPATH", None)  # was for this process alone (`launch`)
    gc.freeze()  # nor by anybody forked from here


preload()
