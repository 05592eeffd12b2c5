"""Public conformance checks: any formulation, conversion, solver, format or collection of problems, ours or another's,
is put through them.

A check is a function `check_<what>(plugin, cases)` that raises AssertionError; `checks(kind)` lists those of a kind.
No check knows a plugin by name: what a plugin cannot do stands in its own spec.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from cpbench.testing.cases import Case, cases

Check = Callable[[Any, list[Case]], None]


def checks(kind: str) -> dict[str, Check]:
    """Return the checks of a kind of plugin: formulation, conversion, solver, format or problem (a collection of
    them)."""
    import importlib

    module = importlib.import_module(f"cpbench.testing.checks_{kind}")
    return {name: getattr(module, name) for name in sorted(vars(module)) if name.startswith("check_")}


__all__ = ["Case", "Check", "cases", "checks"]
