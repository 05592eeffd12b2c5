"""Pictures of problems for a page: their numbers against the problems, and files that are gone, others' or hostile."""

from __future__ import annotations

import json
import math
import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from synthetic_results import meta, results_file, row, table

from cpbench import storage
from cpbench.analysis.contact_states import contact_states
from cpbench.analysis.thumbnails import CELLS, CONTACTS, LEAST, thumbnail
from cpbench.api import thumbnail_process, thumbnails
from cpbench.bench.results.answers import pack
from cpbench.bench.results.store import Store
from cpbench.errors import PointError
from cpbench.formulations import LCP, FCPoint, FrictionContact
from cpbench.formulations.base import Problem
from cpbench.formulations.mlcp import MLCP
from cpbench.generators import generators


def cells(block: dict[str, Any]) -> np.ndarray:
    """The digits of a block as they stand."""
    width = math.ceil(block["cols"] / block["step"])
    return np.array(list(map(int, block["cells"]))).reshape(-1, width)


def fc(count: int, seed: int = 0, friction: float = 0.5) -> tuple[FrictionContact, FCPoint]:
    """W = 1 and q = w − r: the reactions r of drawn states answer it."""
    rng = np.random.default_rng(seed)
    r, w = np.zeros((count, 3)), np.zeros((count, 3))
    for c in range(count):
        angle, force = rng.uniform(0, 2 * math.pi), rng.uniform(1, 3)
        aside = np.array([math.cos(angle), math.sin(angle)])
        if c % 3 == 0:
            w[c, 0] = 1.0
        elif c % 3 == 1:
            r[c] = force, *(0.4 * friction * force * aside)
        else:
            r[c], w[c, 1:] = (force, *(friction * force * aside)), -aside
    problem = FrictionContact(W=np.eye(3 * count), q=(w - r).ravel(), mu=np.full(count, friction))
    return problem, FCPoint(r=r.ravel())


@pytest.mark.parametrize("n", [5, 48, 49, 200])
def test_a_cell_is_filled_where_entries_are(n: int, rng: np.random.Generator) -> None:
    dense = np.where(rng.uniform(size=(n, n)) < 0.02, rng.uniform(size=(n, n)), 0.0) + np.diag(np.full(n, 3.0))
    block = thumbnail(LCP(M=sp.csr_array(dense), q=np.ones(n)))["blocks"][0][0]
    found, step = cells(block), block["step"]
    assert max(found.shape) <= CELLS
    assert block["nonzeros"] == np.count_nonzero(dense)
    for i, j in np.ndindex(found.shape):
        part = np.abs(dense[i * step : (i + 1) * step, j * step : (j + 1) * step])
        most = part.max()
        wanted = 0 if most == 0 else max(1, 6 - math.floor(-math.log10(most / dense.max())))
        assert found[i, j] == wanted


def test_blocks_stand_as_in_the_equations_and_small_ones_keep_some_cells() -> None:
    problem = MLCP(A=np.eye(300), B=np.eye(2), C=np.ones((300, 2)), D=np.ones((2, 300)), a=np.ones(300), b=np.ones(2))
    rows = thumbnail(problem)["blocks"]
    assert [[block["name"] for block in row] for row in rows] == [["A", "C"], ["D", "B"]]
    assert cells(rows[1][1]).tolist() == [[6, 0], [0, 6]]
    assert max(cells(rows[0][0]).shape) <= CELLS
    assert min(cells(rows[0][1]).shape) <= LEAST


def test_contacts_of_an_answer() -> None:
    problem, point = fc(30)
    told = thumbnail(problem, point)["contacts"]
    states = contact_states(problem, point)
    assert told["counts"] == {"stick": 10, "slip": 10, "open": 10}
    assert told["place"] == [c for c in range(30) if c % 3]
    assert told["slips"] == [int(c % 3 == 2) for c in told["place"]]
    share, normal = states.share[told["place"]], states.r[told["place"], 0]
    assert pytest.approx(share, abs=5.1e-4) == np.array(told["share"]).T / 1000
    assert np.array(told["force"]) / 1000 * told["largest"] == pytest.approx(normal, abs=5.1e-4 * normal.max())


def test_many_contacts_are_cut_to_those_that_push_most_and_counted_all() -> None:
    problem, point = fc(900)
    told = thumbnail(problem, point)["contacts"]
    assert sum(told["counts"].values()) == 900
    assert len(told["place"]) == CONTACTS
    normal = point.r.reshape(-1, 3)[:, 0]
    assert min(normal[told["place"]]) >= np.sort(normal)[-CONTACTS]


def test_a_contact_problem_without_an_answer_says_so_and_a_wrong_one_is_refused() -> None:
    problem, _ = fc(3)
    assert thumbnail(problem)["unanswered"]
    with pytest.raises(PointError):
        thumbnail(problem, FCPoint(r=np.full(9, math.nan)))


def test_cones_of_the_plane() -> None:
    told = thumbnail(LCP(M=np.array([[2.0, 1.0], [1.0, 2.0]]), q=np.array([-5.0, -6.0])))["cones"]
    assert told["p"]
    assert told["solutions"] == [[1.333, 2.333]]  # (4/3, 7/3)
    assert [cone["active"] for cone in told["cones"] if cone["holds"]] == [[0, 1]]
    assert told["cones"][0]["edges"] == [[1000, 0], [0, 1000]]
    none = thumbnail(LCP(M=-np.eye(2), q=-np.ones(2)))["cones"]
    assert (none["p"], none["solutions"]) == (False, [])


# ------------------------------------------------------------------------------------ problems of a results file


def asked(folder: Path, *given: dict[str, Any], answers: dict[str, bytes] | None = None) -> dict[str, Any]:
    """The thumbnails of a results file with these rows."""
    path = results_file(folder / "results.sqlite", table(*given), meta())
    if answers:
        with Store(path, create=True) as store:
            store.add_kept((key, answer, None, None, None) for key, answer in answers.items())
    with Store(path) as store:
        return dict(thumbnails.Thumbnails(store, store.table())())


def line(name: str, problem: Problem, address: object, label: str = "lemke", **given: Any) -> dict[str, Any]:
    told = {"fingerprint": problem.fingerprint, "address": str(address), "node": problem.node, **given}
    return row(name, label, "solved", 0.1, **told)


def saved(problem: Problem, path: Path) -> Path:
    storage.save(problem, path)
    return path


def test_the_best_verified_answer_shows_what_contacts_do(tmp_path: Path) -> None:
    problem, point = fc(6)
    path = saved(problem, tmp_path / "six.h5")
    rows = [line("six", problem, path, label, error=error) for label, error in (("a", 1e-7), ("b", 1e-15), ("c", 1e-9))]
    kept = {"six/a": pack(FCPoint(r=np.zeros(18))), "six/b": pack(point), "six/c": pack(FCPoint(r=np.zeros(18)))}
    found = asked(tmp_path, *rows, answers=kept)[problem.fingerprint]
    assert found["answer"] == {"label": "b", "error": 1e-15}
    assert found["contacts"] == thumbnail(problem, point)["contacts"]


@pytest.mark.nightly
def test_what_is_gone_changed_or_hostile_gets_words_and_the_others_their_pictures(tmp_path: Path) -> None:
    one, other = LCP(M=np.eye(3), q=-np.ones(3)), LCP(M=2 * np.eye(3), q=-np.ones(3))
    good = saved(one, tmp_path / "good.h5")
    saved(other, tmp_path / "changed.h5")
    whole = good.read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "noise.h5").write_bytes(np.random.default_rng(0).bytes(5000))
    (tmp_path / "text.dat").write_text("1 2 3 <script>\n" * 50)
    os.mkfifo(tmp_path / "pipe.h5")
    names = ("gone", "changed", "cut", "noise", "pipe", "text", "zero", "broken")
    problems = {name: LCP(M=np.eye(3) + k, q=-np.ones(3)) for k, name in enumerate(names, 1)}
    files = {name: tmp_path / f"{name}.h5" for name in names} | {
        "text": tmp_path / "text.dat", "zero": Path("/dev/zero"), "broken": "\0::x"
    }  # fmt: skip
    rows = [line(name, problem, files[name]) for name, problem in problems.items()]
    found = asked(tmp_path, line("good", one, "good.h5"), *rows)  # an address beside the results
    assert found[one.fingerprint] == thumbnail(one)
    why = {name: found[problem.fingerprint]["why"] for name, problem in problems.items()}
    assert {why[name] for name in ("gone", "pipe", "zero", "broken")} == {thumbnail_process.ABSENT}
    assert why["changed"] == thumbnail_process.OTHER
    assert {why[name] for name in ("cut", "noise", "text")} == {thumbnail_process.UNREADABLE}


@pytest.mark.nightly
def test_a_problem_of_a_generator_needs_no_file(tmp_path: Path) -> None:
    instance = generators.get("lcp-classics").instances()[0]
    found = asked(tmp_path, line("murty", instance.problem, "nowhere/murty.h5", family="lcp-classics"))
    told = found[instance.problem.fingerprint]
    assert {"source", "licence", "citation"} <= set(told)
    assert told.items() >= thumbnail(instance.problem).items()


@pytest.mark.nightly
def test_a_slow_solver_is_left_and_the_others_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thumbnails, "PATIENCE", 0.02)
    slow = [LCP(M=np.eye(2 + k), q=np.ones(2 + k)) for k in range(3)]
    instance = generators.get("lcp-classics").instances()[0]
    rows = [line(f"slow-{k}", problem, "", family="contact-sequence") for k, problem in enumerate(slow)]
    rows.append(line("murty", instance.problem, "", family="lcp-classics"))
    monkeypatch.setattr(thumbnails, "SECONDS", 60.0)
    found = asked(tmp_path, *rows)
    assert [found[problem.fingerprint]["why"] for problem in slow] == [thumbnails.SLOW] * 3
    assert len(found) == 4


@pytest.mark.nightly
def test_pictures_stay_within_their_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problems = [LCP(M=np.eye(k), q=-np.ones(k)) for k in range(3, 30)]
    rows = [line(f"p-{k}", p, saved(p, tmp_path / f"{k}.h5")) for k, p in enumerate(problems)]
    monkeypatch.setattr(thumbnails, "BYTES", 700)
    found = asked(tmp_path, *rows)
    drawn = [told for told in found.values() if "why" not in told]
    assert 0 < len(drawn) < len(problems)
    assert sum(len(zlib.compress(json.dumps(told).encode())) for told in drawn) <= 700
    assert {told["why"] for told in found.values() if "why" in told} == {thumbnails.SPENT}


def test_where_no_process_starts_the_words_say_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thumbnails, "STARTUP", 0.0)
    problem = LCP(M=np.eye(3), q=-np.ones(3))
    found = asked(tmp_path, line("p", problem, saved(problem, tmp_path / "p.h5")))
    assert found[problem.fingerprint]["why"] in (thumbnails.ALONE, thumbnails.SPENT)
