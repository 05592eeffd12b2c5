"""Checks of a collection of problems: what it says of them holds, and everybody gets the same ones."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy as np

from cpbench import storage
from cpbench.formulations import formulations
from cpbench.foundation import matrices
from cpbench.generators import Instance
from cpbench.generators.base import Collection
from cpbench.generators.collection import builtin_folder, write_collections
from cpbench.proofs import certified_infeasible, prove
from cpbench.testing import checks_formulation
from cpbench.testing.cases import Case
from cpbench.verification import judge

KNOWN = {"planted": 1e-12, "published": 1e-12, "closed form": 1e-12, "planted to rounding": 1e-9}
"""How a solution may be known, and the largest error it may have then."""
PROVED = ("infeasible", "unbounded")
"""How it may be known that there is none."""


def check_problems_are_of_the_node(collection: Collection, cases: list[Case]) -> None:
    """Check that there are some, each with its own name that a file can carry."""
    instances = collection.instances()
    assert instances, "makes no problem"
    formulations.get(collection.node)
    names = [instance.name for instance in instances]
    for instance in instances:
        node = instance.problem.node
        assert node == collection.node, f"{instance.name}: is {node}, the collection is of {collection.node}"
        assert instance.name, "a problem has no name"
        assert not set(instance.name) & set("/\\:"), f"{instance.name}: such a name cannot stand in a file"
        assert names.count(instance.name) == 1, f"{instance.name}: {names.count(instance.name)} problems of this name"


def check_what_is_known_holds(collection: Collection, cases: list[Case]) -> None:
    """Check that a solution solves, a certificate proves, and nothing is given where nothing is known."""
    for instance in collection.instances():
        name, known, solution = instance.name, instance.known, instance.solution
        if known in KNOWN:
            assert solution is not None, f"{name}: {known}, and there is no solution"
            error = judge(instance.problem, solution, KNOWN[known]).error
            assert error <= KNOWN[known], f"{name}: {known}, and the solution has error {error:.1e}"
            continue
        assert solution is None, f"{name}: known is '{known}', and there is a solution"
        if known in PROVED:
            assert _proved(instance), f"{name}: the certificate does not prove that there is no solution"
        else:
            words = ", ".join((*KNOWN, *PROVED))
            assert known == "nothing", f"{name}: known is '{known}'; say {words} or nothing"


def _proved(instance: Instance) -> bool:
    """Return whether the certificate proves that there is no solution."""
    if instance.known == "infeasible":
        return certified_infeasible(instance.problem, instance.certificate)
    return prove(instance.problem, instance.known, instance.certificate).proof is not None


def check_the_same_twice(collection: Collection, cases: list[Case]) -> None:
    """Check that they are the same whatever the state of NumPy's global generator is."""
    marks: list[list[str]] = []
    before = np.random.get_state()  # noqa: NPY002 - the global one: nothing may depend on it
    try:
        for seed in (1, 2):
            np.random.seed(seed)  # noqa: NPY002
            marks.append(_marks(collection.instances()))
    finally:
        np.random.set_state(before)  # noqa: NPY002
    assert marks[0] == marks[1], f"{_first_difference(*marks)} is another one on the second call"


def check_the_same_in_another_process(collection: Collection, cases: list[Case]) -> None:
    """Check that they are the same whatever the order of sets is there."""
    file = sys.modules[collection.build.__module__].__file__ or ""
    here = _marks(collection.instances())
    for seed in ("1", "2"):
        run = subprocess.run(
            [sys.executable, "-c", _ELSEWHERE, file, collection.name],
            capture_output=True,
            text=True,
            timeout=120,
            env={**os.environ, "PYTHONHASHSEED": seed},
        )
        assert run.returncode == 0, f"cannot be made elsewhere: {(run.stderr.strip().splitlines() or ['?'])[-1]}"
        again = run.stdout.split("\n")[:-1]
        assert here == again, f"{_first_difference(here, again)} is another one in another process"


def check_data_are_read_only(collection: Collection, cases: list[Case]) -> None:
    instances = collection.instances()
    fresh = [
        Case(i.name, i.problem, i.solution if i.solution is not None else i.problem.zero_point()) for i in instances
    ]
    checks_formulation.check_data_are_read_only(formulations.get(collection.node), fresh)


def check_files_keep_them(collection: Collection, cases: list[Case]) -> None:
    """Check that, written as `cpbench collection generate` does, they are read again with the same numbers, and so is
    what is known."""
    with tempfile.TemporaryDirectory() as folder:
        pack, table = write_collections(Path(folder), [collection.name])
        tomllib.loads(table.read_text(encoding="utf-8"))
        for instance in collection.instances():
            address = f"{pack}::{instance.name}"
            same = storage.load(address).fingerprint == instance.problem.fingerprint
            assert same, f"{instance.name}: is another one when it is read again"
            assert (storage.solution(address) is None) == (instance.solution is None), f"{instance.name}: its solution"


def check_its_origin_is_written_down(collection: Collection, cases: list[Case]) -> None:
    assert collection.summary, "there is no summary"
    assert collection.citation, "there is no citation: say where the family was published"
    shipped = (builtin_folder() / collection.node / f"{collection.name}.h5").is_file()
    assert shipped or not collection.builtin, "says that its file is shipped with cpbench, and it is not: builtin=False"


def _marks(instances: list[Instance]) -> list[str]:
    """Return one line a problem, that depends on every bit of it and of its solution."""
    marks: list[str] = []
    for instance in instances:
        parts = instance.solution.arrays() if instance.solution is not None else {}
        solution = " ".join(f"{name}={matrices.digest(value).hex()}" for name, value in parts.items())
        marks.append(f"{instance.name} {instance.problem.fingerprint} {solution}")
    return marks


def _first_difference(one: list[str], other: list[str]) -> str:
    """Return the name of the first problem that is not the same in both."""
    return next((a.split()[0] for a, b in zip(one, other, strict=False) if a != b), "the number of problems")


_ELSEWHERE = """
import importlib.util, sys
from cpbench.generators import generators
from cpbench.testing.checks_problem import _marks
if sys.argv[2] not in generators:
    found = importlib.util.spec_from_file_location("module_under_check", sys.argv[1])
    module = importlib.util.module_from_spec(found)
    sys.modules[found.name] = module
    found.loader.exec_module(module)
print(*_marks(generators.get(sys.argv[2]).instances()), sep="\\n")
"""
