"""Which cases of a family of tests run on every push, and which at night only."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def by_night(cases: Iterable[Any]) -> list[Any]:
    """The cases, each of them nightly."""
    return [_marked(case) for case in cases]


def some_by_day(cases: Iterable[Any], number: int) -> list[Any]:
    """All cases in their order: `number` of them, evenly spread from the first on, by day, the others nightly."""
    every = list(cases)
    day = {k * len(every) // number for k in range(min(number, len(every)))}
    return [case if k in day else _marked(case) for k, case in enumerate(every)]


def _marked(case: Any) -> Any:
    """A case with its mark; a tuple is the values of several parameters, as in `parametrize`."""
    if isinstance(case, type(pytest.param())):
        return pytest.param(*case.values, id=case.id, marks=[*case.marks, pytest.mark.nightly])
    return pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.nightly)
