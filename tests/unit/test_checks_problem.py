"""Checks of collections: ours pass, and each that is wrong in one way is caught by the check that is meant for it."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tiers import by_night, some_by_day

from cpbench.generators import generators
from cpbench.generators.base import Collection
from cpbench.testing import checks

ELSEWHERE = "check_the_same_in_another_process"
WRONG = """
import numpy as np

from cpbench.formulations import LCP, MLCP, LCPPoint
from cpbench.generators.base import Instance, collection

wrong = lambda name, builtin=False: collection(name, "lcp", "wrong", "nowhere", builtin=builtin)


def one(name="one", q=-1.0, z=1.0, known="planted", **more):
    return Instance(LCP(M=np.eye(1), q=[q], name=name), None if z is None else LCPPoint(z=[z]), known, **more)


@wrong("wrong-nothing")
def nothing():
    return []


@wrong("wrong-node")
def node():
    return [Instance(MLCP(A=np.eye(1), B=np.eye(1), C=np.eye(1), D=np.eye(1), a=[0.0], b=[0.0], name="one"))]


@wrong("wrong-twins")
def twins():
    return [one(), one(q=-2.0, z=2.0)]


@wrong("wrong-solution")
def solution():
    return [one(z=1.0 + 1e-10)]


@wrong("wrong-silence")
def silence():
    return [one(known="nothing")]


@wrong("wrong-word")
def word():
    return [one(z=None, known="somehow")]


@wrong("wrong-certificate")
def certificate():
    return [one(z=None, known="infeasible", certificate=np.ones(1))]


@wrong("wrong-dice")
def dice():
    q = -np.random.rand()
    return [one(q=q, z=-q)]


@wrong("wrong-order")
def order():
    return [one(name) for name in {"a", "b", "c", "d", "e", "f"}]


@wrong("wrong-file")
def file():
    return [one("a/b")]


@wrong("wrong-owner", builtin=True)
def owner():
    return [one()]
"""
CAUGHT = [
    ("wrong-nothing", "check_problems_are_of_the_node"),
    ("wrong-node", "check_problems_are_of_the_node"),
    ("wrong-twins", "check_problems_are_of_the_node"),
    ("wrong-file", "check_problems_are_of_the_node"),
    ("wrong-solution", "check_what_is_known_holds"),
    ("wrong-silence", "check_what_is_known_holds"),
    ("wrong-word", "check_what_is_known_holds"),
    ("wrong-certificate", "check_what_is_known_holds"),
    ("wrong-dice", "check_the_same_twice"),
    ("wrong-order", ELSEWHERE),
    ("wrong-owner", "check_its_origin_is_written_down"),
]


@pytest.fixture
def wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Collection]:
    """The collections of WRONG by name, in the registry for one test."""
    path = tmp_path / "wrong.py"
    path.write_text(WRONG, encoding="utf-8")
    spec: Any = importlib.util.spec_from_file_location("wrong_collections", path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    generators.discover()
    monkeypatch.setattr(generators, "_items", dict(generators._items))
    spec.loader.exec_module(module)
    return generators.get


@pytest.mark.parametrize(("name", "check"), some_by_day(CAUGHT, 6))
def test_caught_by_the_named_check(wrong: Callable[[str], Collection], name: str, check: str) -> None:
    with pytest.raises(AssertionError):
        checks("problem")[check](wrong(name), [])


@pytest.mark.parametrize("name", some_by_day(["lcp-classics", "qp-planted", "rolling"], 1))
@pytest.mark.parametrize("check", [*(c for c in checks("problem") if c != ELSEWHERE), *by_night([ELSEWHERE])])
def test_ours_pass(name: str, check: str) -> None:
    checks("problem")[check](generators.get(name), [])
