"""cpbench benchmarks solvers of complementarity problems and converts the problems between formulations.

The names below are imported on first use, so that `import cpbench` costs nothing.

>>> import numpy as np, cpbench
>>> lcp = cpbench.LCP(M=np.array([[2.0, 1.0], [1.0, 2.0]]), q=[-5.0, -6.0])
>>> answer = cpbench.solve(lcp, "lemke").point
>>> cpbench.judge(lcp, answer, 1e-9).solved
True
>>> qp = cpbench.arrive(lcp, "qp").problem
>>> qp.node, [step.conversion for step in qp.provenance]
('qp', ['lcp-qp'])
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "LCP": "formulations",
    "LCPPoint": "formulations",
    "MLCP": "formulations",
    "MLCPPoint": "formulations",
    "QP": "formulations",
    "QPPoint": "formulations",
    "FrictionContact": "formulations",
    "FCPoint": "formulations",
    "GlobalFrictionContact": "formulations",
    "GFCPoint": "formulations",
    "MixedFrictionContact": "formulations",
    "FCMPoint": "formulations",
    "RollingFrictionContact": "formulations",
    "GlobalRollingFrictionContact": "formulations",
    "AnisotropicFrictionContact": "formulations",
    "Relay": "formulations",
    "AVI": "formulations",
    "AVIPoint": "formulations",
    "ConeQP": "formulations",
    "ConeQPPoint": "formulations",
    "SOCLCP": "formulations",
    "SOCLCPPoint": "formulations",
    "Cone": "product_cones",
    "ProductCone": "product_cones",
    "load": "storage",
    "save": "storage",
    "Recorder": "storage",
    "arrive": "graph",
    "lift": "graph",
    "push": "graph",
    "make": "conversions",
    "judge": "verification",
    "solve": "solvers.base",
    "Budget": "solvers.base",
    "read_results": "bench.results.store",
}

__all__ = ["__version__", *_HOMES]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f"cpbench.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'cpbench' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
