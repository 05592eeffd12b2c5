"""The collection: descriptions, facts, identity, tiers, and how results quote it."""

from __future__ import annotations

import random
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from threadpoolctl import threadpool_limits

import cpbench
from cpbench import storage
from cpbench.api.concluding import quote_collection
from cpbench.bench.results.store import Store
from cpbench.cli import cli
from cpbench.formulations import LCP
from cpbench.generators import generators
from cpbench.generators.base import LARGE, SMALL, STANDARD
from cpbench.generators.collection import PROOFS, TIER_FOLDER, builtin_folder, catalogue, identity, write_collections
from cpbench.generators.descriptions import entries, pattern_of

ENTRIES = catalogue()


def test_every_problem_is_described_and_every_description_is_used() -> None:
    assert not [
        entry.address for entry in ENTRIES if len(entry.description) < 40 or "Difficulty: " not in entry.description
    ]
    large = {pattern_of(c.name, "") for c in generators if c.tier == LARGE}
    used = {pattern_of(entry.family, entry.name) for entry in ENTRIES} | large
    assert {pattern for pattern in entries() if not pattern.startswith("free-boundaries-huge")} <= used


def test_the_licence_of_the_problems_is_that_of_the_data() -> None:
    assert {entry.licence for entry in ENTRIES} == {"CC0-1.0"}
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["license"] == "Apache-2.0 AND CC0-1.0 AND BSD-3-Clause"
    text = (Path(__file__).parents[2] / "LICENSE-DATA").read_text("utf-8")
    assert "CC0 1.0 Universal" in text


def test_a_family_weighs_as_much_as_any_other() -> None:
    weights: dict[tuple[str, str, str], float] = {}
    for entry in ENTRIES:
        key = entry.tier, entry.node, entry.family
        weights[key] = weights.get(key, 0.0) + entry.weight
    assert np.allclose(list(weights.values()), 1.0, atol=1e-12)
    assert min(entry.weight for entry in ENTRIES) < 0.1 < max(entry.weight for entry in ENTRIES)


def test_the_catalogue_is_what_the_files_hold() -> None:
    small = [entry for entry in ENTRIES if entry.tier == SMALL]
    addresses = {f"builtin/{a.removeprefix(f'{builtin_folder()}/')}" for a in storage.problem_files([builtin_folder()])}
    assert {entry.address for entry in small} == addresses
    assert {entry.family for entry in ENTRIES if entry.tier == STANDARD} == {
        c.name for c in generators if c.tier == STANDARD
    }


def test_the_hash_is_of_the_mathematics_of_all_problems_in_any_order() -> None:
    whole = identity(ENTRIES)
    shuffled = list(ENTRIES)
    random.Random(1).shuffle(shuffled)
    assert identity(shuffled) == whole
    assert str(whole) == f"cpbench-collection 2026.12.1 ({len(ENTRIES)} problems, sha256 {whole.digest[:16]})"
    changed = [replace(ENTRIES[0], fingerprint="0" * 32), *ENTRIES[1:]]
    renamed = [replace(ENTRIES[0], name="another"), *ENTRIES[1:]]
    assert identity(changed).digest != whole.digest
    assert identity(renamed).digest == whole.digest
    assert identity(ENTRIES[1:]).digest != whole.digest


def test_what_is_proved_is_of_problems_of_the_collection_and_agrees_with_what_is_known() -> None:
    file = builtin_folder() / PROOFS
    proofs = tomllib.loads(file.read_text("utf-8"))
    assert set(proofs) <= {entry.fingerprint for entry in ENTRIES}
    assert {entry.fingerprint: entry.proof for entry in ENTRIES if entry.proof} == proofs
    assert set(proofs.values()) <= {"proved", "enclosed", "infeasible, proved", "unbounded, proved"}
    for entry in ENTRIES:
        if entry.proof:
            kind = entry.proof.partition(",")[0]
            assert (kind in ("infeasible", "unbounded")) == (entry.known in ("infeasible", "unbounded")), entry.address
            assert kind in ("proved", "enclosed", entry.known)


def test_a_collection_of_the_standard_tier_is_as_published(tmp_path: Path) -> None:
    name = "nash-cournot-large"
    pack, sheet = write_collections(tmp_path, [name])
    assert sheet.read_bytes() == (builtin_folder() / TIER_FOLDER / STANDARD / "ncp" / sheet.name).read_bytes()
    assert storage.load(f"{pack}::nash-cournot-500").info.licence == "CC0-1.0"


def test_a_tier_that_is_not_shipped_needs_a_folder(tmp_path: Path) -> None:
    for arguments in (["--tier", "large"], ["--tier", "standard", str(tmp_path), "--check"]):
        done = CliRunner().invoke(cli, ["collection", "generate", *arguments])
        assert done.exit_code == 2
        assert "needs a FOLDER to write to" in done.output


def test_problems_are_the_same_with_any_number_of_threads() -> None:
    """Those whose matrices come from products that BLAS may split."""
    for name in ("lcp-planted-large", "support-vectors-large"):
        marks: list[list[str]] = []
        for threads in (1, 2):
            with threadpool_limits(threads):
                marks.append([instance.problem.fingerprint for instance in generators.get(name).instances()])
        assert marks[0] == marks[1]


def test_the_list_counts_the_problems_of_the_catalogue() -> None:
    """Sums of columns and rows are those of the catalogue, counted in another way."""
    done = CliRunner().invoke(cli, ["collection", "list"])
    lines = done.stdout.splitlines()
    assert lines[0].startswith(f"{identity(ENTRIES)}: {sum(e.tier == SMALL for e in ENTRIES)} small, installed")
    head, *rows = [line.split() for line in lines[2 : lines.index("", 2)]]
    assert [row[0] for row in rows] == [*sorted({entry.node for entry in ENTRIES}), "all"]
    numbers = np.array([[0 if cell == "·" else int(cell) for cell in row[1:]] for row in rows])
    assert (numbers[:-1].sum(axis=0) == numbers[-1]).all()
    totals = dict(zip(head[1:], numbers[-1].tolist(), strict=True))
    assert totals["problems"] == totals["small"] + totals["standard"] + totals["large"] == len(ENTRIES)
    assert totals["families"] == len({(entry.node, entry.family) for entry in ENTRIES})
    assert totals["proved"] == len(tomllib.loads((builtin_folder() / PROOFS).read_text("utf-8")))


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("name", ["murty-10", "fathi-10", "murty-100"])
def test_pivoting_is_short_where_the_description_has_it(name: str) -> None:
    """What `lcp_classics` and the description of these problems say of Lemke's method and of the least-index rule."""
    problem = cpbench.load(f"{builtin_folder()}/lcp/lcp-classics.h5::{name}")
    (entry,) = [entry for entry in ENTRIES if entry.address.endswith(f"lcp-classics.h5::{name}")]
    assert "with this q pivoting is short" in entry.description.lower()
    assert cpbench.solve(problem, "lemke").counters["pivots"] == 2
    assert cpbench.solve(problem, "murty").counters["iterations"] == 1


@pytest.mark.needs("cpbench_solvers")
def test_results_quote_the_collection_where_their_problems_are_its_own(tmp_path: Path) -> None:
    own = f"{builtin_folder()}/lcp/lcp-classics.h5::munson1"
    other = LCP(M=np.eye(2), q=[-1.0, -2.0], name="mine")
    storage.save(other, tmp_path / "mine.h5")
    quoted = f"1 problem of {identity(ENTRIES)}"
    results = cpbench.run([own, str(tmp_path / "mine.h5")], ["lemke"], seconds=20, out=tmp_path / "r.sqlite")
    results.report(tmp_path / "report")
    assert quoted in (tmp_path / "report" / "report.md").read_text("utf-8")
    said = CliRunner().invoke(cli, ["info", str(tmp_path / "r.sqlite")]).stdout
    assert quoted in " ".join(said.split())
    cpbench.run(str(tmp_path / "mine.h5"), ["lemke"], seconds=20, out=tmp_path / "s.sqlite")
    with Store(tmp_path / "s.sqlite", create=True) as store:
        quote_collection(store)
        assert "collection" not in store.meta()
    assert "cpbench-collection" not in CliRunner().invoke(cli, ["info", str(tmp_path / "s.sqlite")]).stdout
