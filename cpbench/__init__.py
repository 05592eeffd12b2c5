"""cpbench benchmarks solvers of complementarity problems and converts the problems between formulations.

The names below are imported on first use, so that `import cpbench` costs nothing.

>>> import cpbench
>>> lcp = cpbench.LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-5.0, -6.0])
>>> solution = cpbench.solve(lcp, tolerance=1e-9)  # chooses a solver, measures the answer on the problem itself
>>> solution.solver, bool(solution), solution.x.round(6).tolist()
('auto-lcp', True, [1.333333, 2.333333])
>>> cpbench.solve(lcp, "clarabel").route  # a solver of quadratic programs: there and back by a conversion
'lcp-qp'
"""

from __future__ import annotations

import importlib
import os

TYPE_CHECKING = False  # as of `typing`, whose import takes as long as the start of Python
if TYPE_CHECKING:  # what follows is found on first use, which a type checker does not see
    from types import ModuleType
    from typing import Any

    from cpbench.api.problems import Converted as Converted
    from cpbench.api.problems import Modelled as Modelled
    from cpbench.api.problems import convert as convert
    from cpbench.api.problems import explain as explain
    from cpbench.api.problems import load as load
    from cpbench.api.problems import verify as verify
    from cpbench.api.results import Results as Results
    from cpbench.api.runs import run as run
    from cpbench.api.solution import Solution as Solution
    from cpbench.api.solver_list import list_solvers as list_solvers
    from cpbench.api.solving import solve as solve
    from cpbench.api.solving_many import Solutions as Solutions
    from cpbench.api.solving_many import solve_many as solve_many
    from cpbench.bench.results.store import read_results as read_results
    from cpbench.conversions import make as make
    from cpbench.errors import CpbenchError as CpbenchError
    from cpbench.foundation.cones import Cone as Cone
    from cpbench.foundation.cones import ProductCone as ProductCone
    from cpbench.graph import arrive as arrive
    from cpbench.graph import lift as lift
    from cpbench.graph import push as push
    from cpbench.solvers.base import Budget as Budget
    from cpbench.solvers.base import Claim as Claim
    from cpbench.storage import save as save
    from cpbench.verification import Status as Status
    from cpbench.verification import Verdict as Verdict
    from cpbench.verification import judge as judge

__version__ = "0.1.0"

_HOMES = {
    "Cone": "foundation.cones",
    "ProductCone": "foundation.cones",
    "load": "api.problems",
    "save": "storage",
    "solve": "api.solving",
    "Solution": "api.solution",
    "solve_many": "api.solving_many",
    "Solutions": "api.solving_many",
    "Modelled": "api.problems",
    "convert": "api.problems",
    "Converted": "api.problems",
    "explain": "api.problems",
    "verify": "api.problems",
    "run": "api.runs",
    "Results": "api.results",
    "list_solvers": "api.solver_list",
    "Claim": "solvers.base",
    "Budget": "solvers.base",
    "Status": "verification",
    "Verdict": "verification",
    "CpbenchError": "errors",
    "arrive": "graph",
    "lift": "graph",
    "push": "graph",
    "make": "conversions",
    "judge": "verification",
    "read_results": "bench.results.store",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(_module(_HOMES[name]), name)
    if name == "__all__":
        return ["__version__", *_HOMES, *_added_functions(), *sorted({*_own_formulations(), *_all_formulations()})]
    if name[0].isupper():  # a module that has this name is sought by Python itself
        formulation = _own_formulations().get(name) or _all_formulations().get(name)
        if formulation is not None:
            return formulation
    if not (name.startswith("_") or _is_module(name)) and name in _added_functions():
        return _module("foundation.extensions").function(name)
    raise AttributeError(f"module 'cpbench' has no attribute '{name}'")


def _module(name: str) -> ModuleType:
    from cpbench.foundation.imports import uncollected

    with uncollected():
        return importlib.import_module(f"cpbench.{name}")


def _is_module(name: str) -> bool:
    """Return whether a module of this package has the name: Python asks here first, and then imports it."""
    return any(os.path.exists(f"{folder}/{name}{suffix}") for folder in __path__ for suffix in ("", ".py"))


def _added_functions() -> dict[str, Any]:
    """Return the functions of other installed packages, by name: their entry points."""
    extensions = _module("foundation.extensions")
    functions: dict[str, Any] = extensions.added(extensions.FUNCTIONS)
    return functions


def _own_formulations() -> dict[str, type]:
    """Return the classes of `cpbench.formulations`, by name."""
    _module("api")  # problems show themselves in notebooks
    home = _module("formulations")
    named = {name: getattr(home, name) for name in home.__all__}
    return {name: value for name, value in named.items() if isinstance(value, type)}


def _all_formulations() -> dict[str, type]:
    """Return every registered formulation and its point, by name; plugins among them."""
    known = _module("formulations.base").formulations
    return {cls.__name__: cls for node in known for cls in (node, node.point_type)}


def __dir__() -> list[str]:
    return sorted(__getattr__("__all__"))
