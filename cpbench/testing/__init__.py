"""Public conformance checks: any formulation, conversion, solver, format or collection of problems, ours or another's,
is put through them.

A check is a function `check_<what>(plugin, cases)` that raises AssertionError; `checks(kind)` lists those of a kind.
No check knows a plugin by name: what a plugin cannot do stands in its own spec.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any
from unittest import SkipTest

from cpbench.testing.cases import Case, cases

Check = Callable[[Any, list[Case]], None]


def checks(kind: str) -> dict[str, Check]:
    """Return the checks of a kind of plugin: formulation, conversion, solver, format or problem (a collection of
    them)."""
    import importlib

    module = importlib.import_module(f"cpbench.testing.checks_{kind}")
    return {name: getattr(module, name) for name in sorted(vars(module)) if name.startswith("check_")}


@contextmanager
def refused(cause: type[Exception], pattern: str, where: str) -> Generator[None]:
    """Require that the block raises `cause` with a message that matches `pattern`; `where` says what was asked.

    Another exception passes through: a plugin that crashes is not one that refuses.
    """
    try:
        yield
    except cause as refusal:
        if re.search(pattern, str(refusal)) is None:
            raise AssertionError(f"{where}: refused, but '{refusal}' does not say '{pattern}'") from refusal
        return
    raise AssertionError(f"{where}: expected {cause.__name__}, nothing was raised")


def only_for(does: bool, whom: str) -> None:
    """Skip, so that the table of a run tells a check that ran from one that had nothing to say."""
    if not does:
        raise SkipTest(f"does not apply: only for {whom}")


__all__ = ["Case", "Check", "cases", "checks", "only_for", "refused"]
