"""The pieces of a run: messages, plans, the results file."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiers import some_by_day

from cpbench import storage
from cpbench.bench import messages, shared_problem
from cpbench.bench import slot as slots
from cpbench.bench.messages import RefereeCase, Survey
from cpbench.bench.planning import plan
from cpbench.bench.referee import ProblemCache, Referee
from cpbench.bench.results.store import Store
from cpbench.bench.run import execute
from cpbench.bench.slot import Slot
from cpbench.bench.worker_pool import Setting
from cpbench.errors import UnknownName
from cpbench.formulations import LCP, MLCP, FrictionContact, GlobalFrictionContact
from cpbench.foundation import frames
from cpbench.foundation.factorization import Factorization

LIMITS = plan.Limits(seconds=20.0, repeats=1)


@pytest.fixture(scope="module")
def slot() -> Iterator[Slot]:
    with Slot() as slot:
        yield slot


def _contact(folder: Path) -> Path:
    path = folder / "contact.hdf5"
    q = np.array([-1.0, 3, 4])
    storage.save(FrictionContact(W=np.eye(3), q=q, mu=[0.5], dimension=3, name="contact"), path, force=True)
    return path


def _lcp(folder: Path, name: str = "p", n: int = 3) -> Path:
    path = folder / f"{name}.h5"
    storage.save(LCP(M=2.0 * np.eye(n), q=-np.ones(n), name=name), path)
    return path


def _case(address: str, fingerprint: str, node: str, request: plan.Request) -> RefereeCase:
    return RefereeCase(address, None, fingerprint, node, request, 1e-6)


def _framed(header: bytes) -> bytes:
    return len(header).to_bytes(4, "little") + header


@pytest.mark.parametrize(
    "noise",
    [
        b"",
        b"abc",
        b"\xff" * 40,
        frames.pack({"a": 1}, {"z": np.ones(2)})[:-1],
        _framed(b"[" * 200_000),
        _framed(b"[1]"),
        _framed(b'{"vectors": [["z", 1e999, false]]}'),
    ],
    ids=["empty", "short", "length", "cut", "deep", "list", "infinite"],
)
def test_noise_is_no_message(noise: bytes) -> None:
    with pytest.raises(frames.FrameError):
        frames.unpack(noise)


@pytest.mark.needs("cpbench_solvers")
def test_solver_options_are_typed_and_named() -> None:
    entry = plan.parse_entry("psor[omega=1.3]")
    assert entry.options == {"omega": 1.3}
    assert entry.label == "psor[omega=1.3]"
    with pytest.raises(UnknownName, match="omega"):
        plan.parse_entry("psor[omga=1.3]")
    with pytest.raises(UnknownName, match="float"):
        plan.parse_entry("psor[omega=fast]")


@pytest.mark.needs("cpbench_solvers")
def test_keys_tell_apart_what_must_not_be_mixed(slot: Slot, tmp_path: Path) -> None:
    survey = slot.survey(str(_lcp(tmp_path)), [plan.exact()])

    def key(solver: str = "lemke", tolerance: float = 1e-6, threads: int = 1) -> str:
        entries, limits = [plan.parse_entry(solver)], plan.Limits(threads=threads)
        (pair,) = plan.pairs([survey], entries, [plan.exact()], tolerance, limits)
        return pair.key

    keys = [key(), key("pgs"), key("psor[omega=1.2]"), key(tolerance=1e-8), key(threads=2)]
    assert len(set(keys)) == len(keys)
    assert key() == key()


@pytest.mark.nightly
def test_a_relaxation_runs_on_request_only_and_says_what_it_is(slot: Slot, tmp_path: Path) -> None:
    """A sliding contact: the relaxation's answer dilates, and its row says `relaxation`, never `equivalent`.

    Nobody has the problem that the solver solves, so that nothing is charged to it."""
    asked, entries = [plan.exact()], [plan.parse_entry("clarabel-relaxation")]
    survey = slot.survey(str(_contact(tmp_path)), asked)
    assert plan.pairs([survey], entries, asked, 1e-6, LIMITS) == []
    (pair,) = plan.pairs([survey], entries, asked, 1e-6, LIMITS, relaxations=True)
    row = slot.run(pair, slot.prepare(pair))
    assert row.kind == "relaxation"
    assert (row.claim, row.status, row.target_error) == ("solved", "approximate", None)


@pytest.mark.parametrize("node", some_by_day(["mlcp", "gfc"], 1))
def test_a_factorization_made_to_see_whether_an_edge_applies_is_charged(tmp_path: Path, node: str) -> None:
    """One row, one LU of order 800: nearly all of the conversion's time, whoever asked for the LU before."""
    n = 800
    A = np.random.default_rng(0).standard_normal((n, n)) / n + np.eye(n)
    if node == "mlcp":
        problem = MLCP(A=A, B=np.eye(1), C=np.ones((n, 1)), D=np.ones((1, n)), a=np.ones(n), b=np.ones(1))
    else:
        H = np.eye(n)[:, :3]
        problem = GlobalFrictionContact(M=A + A.T, H=H, f=np.ones(n), w=np.ones(3), mu=[0.5], dimension=3)
    storage.save(problem, tmp_path / "p.h5")
    request = replace(plan.exact(), nodes=({"mlcp": "lcp", "gfc": "fc"}[node],))
    address = str(tmp_path / "p.h5")
    referee = Referee(tmp_path)
    referee.survey(Survey(address, None, (request,)))  # asks for the LU
    reply = referee.prepare(_case(address, problem.fingerprint, request.nodes[0], request))
    assert reply.convert > 0.5 * min(_seconds_of_lu(A) for _ in range(3))


def _seconds_of_lu(A: np.ndarray) -> float:
    begun = time.perf_counter()
    assert not Factorization(A).singular
    return time.perf_counter() - begun


def test_a_conversion_shared_by_two_routes_counts_in_both(tmp_path: Path) -> None:
    """Contact to LCP to MLCP: the first step is done once, and is part of the time of either."""
    address = str(_contact(tmp_path))
    (request,) = plan.facets("inner", 64)
    fingerprint = storage.load(address).fingerprint
    referee = Referee(tmp_path)
    first = referee.prepare(_case(address, fingerprint, "lcp", request))
    second = referee.prepare(_case(address, fingerprint, "mlcp", request))
    assert second.route.startswith(first.route)
    assert second.convert > first.convert > 0


def test_two_ways_to_one_problem_keep_their_own_steps(tmp_path: Path) -> None:
    """Without free unknowns, elimination and splitting make the same LCP: each QP lifts along its own way."""
    problem = MLCP(A=np.zeros((0, 0)), B=np.eye(2), C=np.zeros((0, 2)), D=np.zeros((2, 0)), a=[], b=[-1.0, 1.0])
    storage.save(problem, tmp_path / "p.h5")
    referee = Referee(tmp_path)
    for way in ("mlcp-lcp-schur", "mlcp-lcp-split"):
        request = plan.pinned([way])
        case = _case(str(tmp_path / "p.h5"), problem.fingerprint, "qp", request)
        reply = referee.prepare(case)
        steps = referee._cache.ready(case)[1].problem.provenance
        assert " > ".join(step.conversion for step in steps) == reply.route
        assert steps[0].conversion == way


@pytest.mark.needs("cpbench_solvers")
def test_facet_requests_lead_to_lcp_and_mlcp_solvers_only(slot: Slot, tmp_path: Path) -> None:
    asked = plan.requests("all", (8, 16))
    survey = slot.survey(str(_contact(tmp_path)), asked)
    everything = [plan.Entry(name) for name in ("lemke", "daqp", "nsgs")]
    labels = {p.label for p in plan.pairs([survey], everything, asked, 1e-6, LIMITS)}
    assert "nsgs" in labels
    assert {"lemke@inner8", "lemke@inner16", "lemke@outer8-lcp", "lemke@outer8-mlcp"} <= labels
    assert not any(label.startswith("daqp@") and "necessary" not in label for label in labels)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(("keep", "kept"), [("none", 0), ("wrong", 0), ("all", 1)])
def test_answers_are_kept_as_asked(slot: Slot, tmp_path: Path, keep: str, kept: int) -> None:
    survey = slot.survey(str(_lcp(tmp_path)), [plan.exact()])
    planned = plan.pairs([survey], [plan.Entry("lemke")], [plan.exact()], 1e-6, LIMITS)
    store = Store(tmp_path / "r.sqlite", create=True, keep=keep)
    store.plan(planned)
    execute([slot], store, planned, seed=0)
    assert len(list(store.answers())) == kept
    store.close()


@pytest.mark.needs("cpbench_solvers")
def test_a_referee_that_dies_is_replaced(slot: Slot, tmp_path: Path) -> None:
    """Its process is killed between two pairs; the next pair is judged by a new one."""
    survey = slot.survey(str(_lcp(tmp_path)), [plan.exact()])
    (pair,) = plan.pairs([survey], [plan.Entry("lemke")], [plan.exact()], 1e-6, LIMITS)
    prepared = slot.prepare(pair)
    assert slot.run(pair, prepared).status == "solved"
    assert slot.referee.child is not None
    slot.referee.child.kill()
    assert slot.run(pair, prepared).status == "solved"


@pytest.mark.needs("cpbench_solvers")
def test_a_file_that_changed_after_planning_is_refused(slot: Slot, tmp_path: Path) -> None:
    """Its rows must not be filled with answers to another problem: neither before a solve nor at the verdict."""
    path = _lcp(tmp_path)
    survey = slot.survey(str(path), [plan.exact()])
    (pair,) = plan.pairs([survey], [plan.Entry("lemke")], [plan.exact()], 1e-6, LIMITS)
    prepared = slot.prepare(pair)
    assert slot.referee.child is not None
    slot.referee.child.kill()
    changed = LCP(M=3.0 * np.eye(3), q=-np.ones(3), name="p")
    storage.save(changed, path, force=True)
    late = slot.run(pair, prepared)
    early = slot.run(pair, slot.prepare(pair))
    for row, beginning in ((early, "loading: "), (late, "the answer could not be judged: ")):
        assert row.status == "error"
        assert row.message.startswith(beginning)
        assert pair.fingerprint in row.message
        assert changed.fingerprint in row.message


@pytest.mark.needs("cpbench_solvers")
def test_a_file_that_is_gone_after_planning_is_an_error(slot: Slot, tmp_path: Path) -> None:
    survey = slot.survey(str(_lcp(tmp_path)), [plan.exact()])
    (pair,) = plan.pairs([survey], [plan.Entry("lemke")], [plan.exact()], 1e-6, LIMITS)
    slot.survey(str(_lcp(tmp_path, "other")), [plan.exact()])
    (tmp_path / "p.h5").unlink()
    row = slot.run(pair, slot.prepare(pair))
    assert row.status == "error"
    assert row.message.startswith("loading: ")


@pytest.mark.nightly
def test_a_referee_that_loads_too_slowly_is_no_timeout_of_a_solver(
    slot: Slot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    survey = slot.survey(str(_lcp(tmp_path)), [plan.exact()])
    (pair,) = plan.pairs([survey], [plan.Entry("lemke")], [plan.exact()], 1e-6, LIMITS)
    slot.survey(str(_lcp(tmp_path, "other")), [plan.exact()])  # the referee holds one problem
    address = tmp_path / "p.h5"
    address.unlink()
    _lcp(tmp_path, n=4000)  # 128 MB, for which 20 ms are not enough
    monkeypatch.setattr(slots, "REFEREE", replace(slots.REFEREE, floor=0.02))
    quick = replace(pair, limits=replace(LIMITS, seconds=0.02))
    row = slot.run(quick, slot.prepare(quick))
    assert (row.status, row.message) == ("error", "loading: no reply within 0.02 s")
    monkeypatch.undo()
    address.unlink()
    _lcp(tmp_path)
    assert slot.run(pair, slot.prepare(pair)).status == "solved"


@pytest.mark.needs("cpbench_solvers")
def test_a_conversion_that_is_too_large_is_a_memout(tmp_path: Path) -> None:
    """60 contacts in 400 facets: an LCP of order 24 120, 4.7 GB. The referee that refused it is replaced."""
    n = 180
    path = tmp_path / "contacts.hdf5"
    problem = FrictionContact(W=np.eye(n) + 1.0 / n, q=np.ones(n), mu=np.full(60, 0.5), dimension=3, name="contacts")
    storage.save(problem, path)
    asked = [plan.exact(), *plan.facets("inner", 400)]
    with Slot(Setting(memory=2**29)) as small:
        survey = small.survey(str(path), asked)
        pairs = plan.pairs(
            [survey], [plan.Entry("nsgs"), plan.Entry("lemke")], asked, 1e-6, plan.Limits(20.0, 2**29, repeats=1)
        )
        first, second = sorted(pairs, key=lambda pair: pair.label != "lemke@inner400")
        row = small.run(first, small.prepare(first))
        assert row.status == "memout"
        assert row.message == f"conversion: ran out of memory, limited to {2**31} bytes"
        assert small.referee.child is None
        assert small.run(second, small.prepare(second)).status == "solved"


@pytest.mark.needs("cpbench_solvers")
def test_a_worker_never_meets_a_dead_referees_file(slot: Slot, tmp_path: Path) -> None:
    """Solve A, kill the referee, solve B, then A again: names of converted problems are not used twice."""
    asked, entries = [plan.exact()], [plan.Entry("lemke")]
    pairs = []
    for name, n in (("a", 3), ("b", 5)):
        survey = slot.survey(str(_lcp(tmp_path, name, n)), asked)
        pairs += plan.pairs([survey], entries, asked, 1e-6, LIMITS)
    first = slot.prepare(pairs[0])
    assert slot.run(pairs[0], first).status == "solved"
    assert slot.referee.child is not None
    slot.referee.child.kill()
    second = slot.prepare(pairs[1])
    assert second.path != first.path
    assert slot.run(pairs[1], second).status == "solved"


RESULT = {"claim": "solved", "answered": True, "message": "", "counters": {}, "setup": 0.1}
RESULT |= {"solve": 0.1, "cpu": 0.2, "grown": 0, "peak": 0, "children": 0, "threads": 1, "wrote": False}


def _said(fields: Mapping[str, Any], message: str = "Result") -> messages.Message:
    """What the runner makes of a message."""
    return messages.unpack(frames.pack({"message": message, "fields": fields}))


@pytest.mark.parametrize(
    "forged",
    [
        {"solve": -1.0},
        {"solve": float("nan")},
        {"setup": float("inf")},
        {"cpu": 10**400},
        {"grown": float("inf")},
        {"counters": None},
        {"counters": {"iterations": "many"}},
        {"peak": "much"},
        {"colour": "red"},
    ],
    ids=lambda forged: next(iter(forged)),
)
def test_what_a_worker_says_is_brought_to_its_type_or_refused(forged: dict[str, Any]) -> None:
    assert _said(RESULT).solve == 0.1
    with pytest.raises(frames.FrameError):
        _said(RESULT | forged)


def test_what_a_worker_leaves_out_is_missed() -> None:
    with pytest.raises(frames.FrameError):
        _said(RESULT, "Conclusion")
    for name in RESULT:
        with pytest.raises(frames.FrameError):
            _said({key: value for key, value in RESULT.items() if key != name})


def test_numbers_that_the_results_file_cannot_keep_are_cut() -> None:
    assert _said(RESULT | {"peak": 2**70}).peak == 2**63 - 1


@pytest.mark.parametrize("told", [[[0.0, -7.0, 0.0]], [[1.0]], [[0.0, 1.0]], 5, [["x", 1.0, 1.0]]], ids=str)
def test_repeats_that_are_none_are_refused(told: Any) -> None:
    assert _said({"times": [[0.0, 1.0, 2.0]]}, "Repeats").times == ((0.0, 1.0, 2.0),)
    with pytest.raises(frames.FrameError):
        _said({"times": told}, "Repeats")


def test_messages_arrive_as_they_were_sent() -> None:
    """With all that they are made of: the request of a case, bytes, what is not finite."""
    case = RefereeCase("p.h5", None, "f", "lcp", plan.facets("inner", 64)[0], 1e-6)
    for message in (
        messages.FindStart(case, "previous", case, {"answer": b"\x00\xff"}),
        messages.Judged("wrong", "", float("inf"), None, ["stationary"], {"natural": 0.5}, 0.0, 1.0),
        messages.OutOfMemory(),
    ):
        assert messages.unpack(messages.pack(message)) == message


def test_a_file_is_read_anew_for_another_format(tmp_path: Path) -> None:
    """What is held is known by its address and by how it was read."""
    cache = ProblemCache(tmp_path)
    first = cache.open(str(_lcp(tmp_path)), None)
    assert cache.open(str(tmp_path / "p.h5"), None) is first
    assert cache.open(str(tmp_path / "p.h5"), "native") is not first


@pytest.mark.needs("cpbench_solvers")
def test_a_scratch_file_that_a_solver_changed_is_not_solved(slot: Slot, tmp_path: Path) -> None:
    """The worker compares what it reads with what the referee wrote."""
    survey = slot.survey(str(_lcp(tmp_path)), [plan.exact()])
    (pair,) = plan.pairs([survey], [plan.Entry("bpp")], [plan.exact()], 1e-6, LIMITS)
    prepared = slot.prepare(pair)
    shared_problem.write(LCP(M=3.0 * np.eye(3), q=-np.ones(3), name="p"), prepared.path)
    row = slot.run(pair, prepared)
    assert row.status == "error"
    assert "is not what the referee wrote" in row.message
