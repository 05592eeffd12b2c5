"""The search for failures: its changes keep solutions, and it finds a solver that lies."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import with_plugins
from generated import instances
from test_reduce import PLUGIN

import cpbench
from cpbench.bench.results.rows import Outcome
from cpbench.errors import CpbenchError
from cpbench_lab.reduction.hunting.hunt import MUTATIONS, failure


@pytest.mark.parametrize("name", MUTATIONS)
def test_a_mutation_is_another_problem_of_its_formulation(name: str) -> None:
    """Other units keep a solution, and so does what is said twice, unless it is an unknown with bounds."""
    made = 0
    for collection in ("lcp-planted", "mlcp-planted", "qp-planted", "contact-planted-3d", "contact-global", "relays"):
        instance = instances(collection)[0]
        for seed in range(3):
            try:
                other = MUTATIONS[name](instance.problem, instance.solution, np.random.default_rng(seed))
            except CpbenchError:
                continue
            assert other.node == instance.problem.node
            made += other.fingerprint != instance.problem.fingerprint
            if name == "units" or (name == "repeated" and not hasattr(other, "lb")):
                assert cpbench.solve(other, seconds=5.0), (collection, seed)
    assert made >= 2


def test_a_solution_stays_where_a_pair_is_made_degenerate() -> None:
    instance = instances("lcp-planted")[0]
    changed = MUTATIONS["degenerate"](instance.problem, instance.solution, np.random.default_rng(0))
    assert cpbench.verify(changed, instance.solution).solved


@pytest.mark.parametrize(
    ("outcome", "reference", "expected"),
    [
        ({"status": "wrong"}, {}, "wrong"),
        ({"status": "crash"}, {}, "crash"),
        ({"status": "failed"}, {}, ""),
        ({"status": "unsupported"}, {}, ""),
        ({"status": "solved", "solve": 0.5}, {"solve": 0.004}, "slower"),
        ({"status": "solved", "solve": 0.5}, {"solve": 0.006}, ""),
        ({"status": "solved", "solve": 0.005}, {"solve": 1e-6}, ""),
        ({"status": "timeout", "solve": 2.0}, {"solve": 0.1}, ""),
        ({"status": "timeout", "solve": 2.0}, {"solve": 0.01}, "timeout"),
    ],
)
def test_what_counts_as_a_failure(outcome: dict, reference: dict, expected: str) -> None:
    assert failure(Outcome(**outcome), Outcome(**{"status": "solved", "solve": 1e-4, **reference})) == expected


def test_a_liar_is_found(tmp_path: Path) -> None:
    """Its first problem is one on which it lies; then the time is over, so that nothing here hangs on the clock."""
    (tmp_path / "plugin.py").write_text(PLUGIN)
    options = ("--minutes", "0.001", "--seed", "0", "-q", "-o", "h")
    done = with_plugins(
        tmp_path, "--plugin", "plugin.py", "hunt", "-s", "half-liar", "--against", "lemke", *options
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    first = json.loads((tmp_path / "h/tried.jsonl").read_text().splitlines()[0])
    assert (first["status"], first["failure"]) == (["wrong", "solved"], "wrong")
    assert cpbench.load(tmp_path / "h/wrong-1.h5").node == "lcp"
    rows = done.stdout.splitlines()
    assert rows[1].split()[:2] == ["failure", "found"]
    assert rows[2].startswith("wrong")
    assert rows[-1].startswith("next: cpbench reduce h/wrong-1.h5 -s half-liar --while wrong -o h/wrong-1")
