"""Solvers in programs of their own, used from a script: sessions, steps, starts, and what becomes of the dead."""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from tiers import some_by_day

from cpbench.errors import Ended, NotApplicable, Unavailable
from cpbench.formulations import LCP
from cpbench.formulations.linear import LCPPoint
from cpbench.solvers.base import Budget, Claim, SolverSpec, solvers
from cpbench.solvers.external import session
from cpbench.solvers.external.command import CommandSolver
from cpbench.solvers.external.served import ServedSolver
from cpbench.solvers.external.session import ProgramError, Session
from cpbench.testing import cases

PROBLEM = LCP(M=np.array([[2.0, 1.0], [0.0, 4.0]]), q=np.array([-4.0, -4.0]), name="two")
ANSWER = np.array([1.5, 1.0])
OTHER = LCP(M=np.eye(2), q=np.array([-5.0, 6.0]))
PROGRAM = """
import json, os, sys
from pathlib import Path
import numpy as np

starts = Path(sys.argv[1])
with starts.open("a") as file:
    file.write("started\\n")
said = []
for line in sys.stdin:
    request = json.loads(line)
    said.append(request)
    reply = {"ok": True}
    match request["do"]:
        case "hello":
            reply["version"] = 3
        case "load":
            folder = Path(request["problem"])
            M, q = np.load(folder / "M.npy"), np.load(folder / "q.npy")
        case "solve":
            z = np.maximum(np.linalg.solve(M, -q), 0.0)
            if request["start"] is not None:
                z = np.load(request["start"] + "/z.npy")
            reply |= {"claim": "solved", "message": json.dumps(request)}
            if request["seconds"] == 0.125:
                reply = {"unsupported": "a limit of an eighth of a second"}
            if request["seconds"] == 0.25:
                import time
                time.sleep(60)
        case "write":
            np.save(request["answer"] + "/z.npy", z)
        case "quit":
            (starts.parent / "quit").touch()
            break
    print(json.dumps(reply), flush=True)
    if request["do"] == "write" and starts.name == "mortal":
        os._exit(4)
"""


@pytest.fixture
def program(tmp_path: Path):
    """Makes a solver served by PROGRAM, which leaves a line in the file `starts` whenever it is started."""
    made: list[ServedSolver] = []
    (tmp_path / "program.py").write_text(PROGRAM)

    def make(starts: str = "starts", name: str = "mine") -> ServedSolver:
        spec = SolverSpec(name=name, node="lcp", summary="a program", method="direct")
        made.append(ServedSolver(spec, [sys.executable, "program.py", starts], matrices="dense", cwd=str(tmp_path)))
        return made[-1]

    yield make
    for solver in made:
        solver.close()


def _starts(folder: Path, name: str = "starts") -> int:
    return len((folder / name).read_text().splitlines())


def _programs() -> list[psutil.Process]:
    """Those of these tests that run; other solvers of this process may have theirs."""
    return [p for p in psutil.Process().children(recursive=True) if "program.py" in p.cmdline()]


def test_all_steps(program, tmp_path: Path) -> None:
    solver = program()
    assert solver.availability().ok
    assert solver.version() == "3"
    output = solver.run(PROBLEM, Budget(tolerance=1e-7, iterations=5, seed=3))
    np.testing.assert_allclose(output.point.z, ANSWER)
    assert output.claim is Claim.SOLVED
    for part in ('"tolerance": 1e-07', '"seconds": null', '"iterations": 5', '"seed": 3', '"options": {}'):
        assert part in output.message
    assert _starts(tmp_path) == 1  # the program that was greeted is the one that solves


def test_a_start_travels_as_an_answer(program) -> None:
    solver = program()
    start = LCPPoint(z=np.array([7.0, 8.0]))
    np.testing.assert_array_equal(solver.run(PROBLEM, start=start).point.z, [7.0, 8.0])


def test_problems_are_solved_in_any_order(program) -> None:
    """A program holds one problem; an older one that was handed over is loaded again."""
    solver, budget = program(), Budget()
    options = solver.spec.options()
    first, second = solver.hand_over(PROBLEM), solver.hand_over(OTHER)
    for handed, expected in ((second, [5.0, 0.0]), (first, ANSWER), (second, [5.0, 0.0])):
        output = solver.collect(solver.solve(handed, budget, options))
        np.testing.assert_allclose(output.point.z, expected)
    stale = solver.solve(first, budget, options)
    solver.hand_over(OTHER)
    with pytest.raises(ProgramError, match="holds another problem"):
        solver.collect(stale)


def test_one_that_died_between_two_problems_is_started_again(program, tmp_path: Path) -> None:
    solver = program("mortal")
    for _ in range(3):
        np.testing.assert_allclose(solver.run(PROBLEM).point.z, ANSWER)
        time.sleep(0.1)
    assert _starts(tmp_path, "mortal") == 3


def test_one_that_died_before_its_answer_has_ended(program) -> None:
    solver = program()
    handed = solver.hand_over(PROBLEM)
    assert solver._session is not None
    os.kill(solver._session._process.pid, 9)
    with pytest.raises(Ended, match="mine was killed by signal 9 before it answered"):
        solver.solve(handed, Budget(), solver.spec.options())


def test_a_refusal_leaves_the_program_running(program, tmp_path: Path) -> None:
    solver = program()
    with pytest.raises(NotApplicable, match="an eighth of a second"):
        solver.run(PROBLEM, Budget(seconds=0.125))
    assert solver.run(PROBLEM).claim is Claim.SOLVED
    assert _starts(tmp_path) == 1


def test_solvers_of_one_program_greet_it_once(program, tmp_path: Path) -> None:
    solver, twin = program(), program(name="twin")
    assert solver.availability() is twin.availability()
    twin.run(PROBLEM)
    assert _starts(tmp_path) == 1
    solver.run(PROBLEM)
    assert _starts(tmp_path) == 2


@pytest.mark.nightly
def test_folders_go_with_the_problem_and_programs_with_the_solver(program, tmp_path: Path) -> None:
    solver = program()
    handed = solver.hand_over(PROBLEM)
    place = handed.place.path
    assert place.is_dir()
    solver.close()
    del handed
    solver._session = None
    gc.collect()
    assert not place.exists()
    assert (tmp_path / "quit").exists()
    assert not _programs()


@pytest.mark.nightly
def test_a_script_that_ends_leaves_nothing(program, tmp_path: Path) -> None:
    program()
    script = (
        "import numpy as np\n"
        "from cpbench.formulations import LCP\n"
        "from cpbench.solvers.base import SolverSpec\n"
        "from cpbench.solvers.external.served import ServedSolver\n"
        "spec = SolverSpec(name='mine', node='lcp', summary='a program', method='direct')\n"
        f"solver = ServedSolver(spec, [{sys.executable!r}, 'program.py', 'starts'])\n"
        "handed = solver.hand_over(LCP(M=np.eye(2), q=np.ones(2)))\n"
        "print(handed.place.path.parent)\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert not Path(done.stdout.strip()).exists()
    assert (tmp_path / "quit").exists()


def _served(*command: str, install: str = "") -> ServedSolver:
    spec = SolverSpec(name="mine", node="lcp", summary="a program", method="direct", install=install)
    return ServedSolver(spec, command)


@pytest.mark.parametrize(
    ("code", "state", "told"),
    some_by_day(
        [
            ("import nobody_has_this", "broken", "ModuleNotFoundError: No module named 'nobody_has_this'"),
            ("print('hello')", "broken", "answered hello with 'hello'"),
            ("pass", "broken", "exited with code 0 before it answered"),
            ('input(); print(\'{"unavailable": "ask for a key", "state": "licence"}\')', "licence", "ask for a key"),
            ('input(); print(\'{"unavailable": "no", "state": "odd"}\')', "broken", "no"),
            ('input(); print(\'{"error": "protocol 2 only"}\')', "broken", "protocol 2 only"),
        ],
        3,
    ),
)
def test_the_greeting_decides_availability(code: str, state: str, told: str) -> None:
    solver = _served(sys.executable, "-c", code)
    found = solver.availability()
    assert (found.state, told in found.detail) == (state, True), found
    assert solver.version() == ""
    with pytest.raises(Unavailable):
        solver.run(PROBLEM)


def test_what_is_missing_says_how_to_get_it(tmp_path: Path) -> None:
    assert _served("./nothing").availability().detail == "./nothing: no such executable; build or install it"
    assert _served("./nothing", install="make mine").availability().detail == "./nothing: no such executable; make mine"
    (tmp_path / "text").write_text("no program")
    assert _served(str(tmp_path / "text")).availability().state == "missing"
    (tmp_path / "other").write_text("no program")
    (tmp_path / "other").chmod(0o755)
    assert _served(str(tmp_path / "other")).availability().state == "broken"


@pytest.mark.nightly
def test_long_requests_and_chatter_on_stderr_get_through() -> None:
    """Lines longer than a pipe; more on stderr than one holds, between the request and the reply."""
    code = (
        "import sys\n"
        "for line in sys.stdin:\n"
        "    sys.stderr.write('x' * 300000)\n"
        '    print(\'{"ok": true, "size": %d}\' % len(line), flush=True)\n'
    )
    program = Session("mine", [sys.executable, "-c", code])
    assert program.ask("hello", 10.0, text="a" * 300_000)["size"] > 300_000
    assert set(program.words) == {"x"}
    program.close()
    program.close()
    assert not program.alive


def test_a_system_without_descriptors_of_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """There the end of a program is found by looking."""
    monkeypatch.setattr(session, "end_descriptor", lambda pid: None)
    code = "import sys, os; input(); print('{\"ok\": true}', flush=True); input(); os.close(1); os._exit(7)"
    program = Session("mine", [sys.executable, "-c", code])
    assert not program.ended()
    assert program.ask("hello", 10.0) == {"ok": True}
    with pytest.raises(Ended, match="exited with code 7"):
        program.ask("solve", 10.0)


@pytest.mark.nightly
def test_any_registered_solver_is_served_and_answers_as_it_does_here() -> None:
    """`psor` in another process: the same answers with the same options, starts and limits of iterations."""
    here = solvers.get("psor")
    command = [sys.executable, "-m", "cpbench.solvers.external.serve", "psor"]
    there = ServedSolver(here.spec, command)
    options = here.spec.options(omega=1.3)
    try:
        for case in (case for case in cases("lcp") if here.obstacle(case.problem) is None):
            for budget, start in ((Budget(), None), (Budget(iterations=2), None), (Budget(), case.point)):
                mine, theirs = (s.run(case.problem, budget, options, start) for s in (here, there))
                assert (mine.claim, mine.counters) == (theirs.claim, theirs.counters), case.name
                np.testing.assert_array_equal(mine.point.z, theirs.point.z)
                assert theirs.reported is not None
        assert there.version() == here.version()
    finally:
        there.close()


def test_the_words_of_a_command(tmp_path: Path) -> None:
    """Words are split without a shell; placeholders stand for values, options among them."""
    (tmp_path / "show.py").write_text(
        "import json, sys\nfrom pathlib import Path\nimport numpy as np\n"
        "Path('told').write_text(json.dumps(sys.argv[1:]))\n"
        "np.save(sys.argv[1] + '/z.npy', np.load(sys.argv[2] + '/q.npy'))\n"
        "Path(sys.argv[1], 'claim.json').write_text(json.dumps({'seconds': 0.5, 'counters': {'a': 1}}))\n"
    )
    words = "{answer} {problem} --tol={tol} {seconds} {iterations} {seed} '{start}' {node} '$HOME; {{x}}'"
    spec = SolverSpec(name="mine", node="lcp", summary="a command", method="direct")
    solver = CommandSolver(spec, f"{sys.executable} show.py {words}", cwd=str(tmp_path))
    output = solver.run(PROBLEM, Budget(tolerance=1e-7, seed=4))
    np.testing.assert_array_equal(output.point.z, PROBLEM.q)
    assert (output.claim, output.reported, output.counters) == (Claim.SOLVED, 0.5, {"a": 1})
    told = json.loads((tmp_path / "told").read_text())
    assert told[2:] == ["--tol=1e-07", "inf", "-1", "4", "", "lcp", "$HOME; {x}"]
    solver.run(PROBLEM, Budget(seconds=2.5, iterations=9), start=LCPPoint(z=ANSWER))
    told = json.loads((tmp_path / "told").read_text())
    assert told[3:5] == ["2.5", "9"]
    assert told[6].endswith("start")


def test_an_answer_of_an_earlier_solve_is_not_taken_again(tmp_path: Path) -> None:
    (tmp_path / "once.sh").write_text('#!/bin/sh\n[ -e done ] || cp q.npy "$1/z.npy"\ntouch done\n')
    (tmp_path / "once.sh").chmod(0o755)
    np.save(tmp_path / "q.npy", ANSWER)
    spec = SolverSpec(name="mine", node="lcp", summary="a command", method="direct")
    solver = CommandSolver(spec, "./once.sh {answer}", cwd=str(tmp_path))
    handed, budget, options = solver.hand_over(PROBLEM), Budget(), spec.options()
    np.testing.assert_array_equal(
        solver.collect(solver.solve(solver.setup(handed, budget, options), budget, options)).point.z, ANSWER
    )
    with pytest.raises(ProgramError, match="exited with code 0 and wrote no answer"):
        solver.collect(solver.solve(solver.setup(handed, budget, options), budget, options))


def test_a_claim_of_an_earlier_solve_is_not_taken_again(tmp_path: Path) -> None:
    """One in the folder of the answer, of a solve that was timed again and not collected."""
    (tmp_path / "once.sh").write_text(
        '#!/bin/sh\n[ -e done ] && cp q.npy "$1/z.npy" || echo \'{"claim": "infeasible"}\' > "$1/claim.json"\n'
    )
    (tmp_path / "once.sh").chmod(0o755)
    np.save(tmp_path / "q.npy", ANSWER)
    spec = SolverSpec(name="mine", node="lcp", summary="a command", method="direct")
    solver = CommandSolver(spec, "./once.sh {answer}", cwd=str(tmp_path))
    handed, budget, options = solver.hand_over(PROBLEM), Budget(), spec.options()
    solver.solve(solver.setup(handed, budget, options), budget, options)
    (tmp_path / "done").touch()
    output = solver.collect(solver.solve(solver.setup(handed, budget, options), budget, options))
    assert output.claim == Claim.SOLVED


@pytest.mark.nightly
def test_folders_of_processes_that_start_together_stay(tmp_path: Path) -> None:
    """What looks for the folders of the dead does not take those that are just being made."""
    code = (
        "import os\nfrom cpbench.solvers.external import folder\n"
        "for _ in range(300):\n"
        "    folder._homes.clear()\n"
        "    mine = folder.Folder(1)\n"
        "    assert mine.path.is_dir()\n"
        "    home = folder._homes[folder.MEMORY][1]\n"
        "    os.close(home._lock._descriptor)\n"
        "    home._lock = None\n"
    )
    together = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(3)]
    assert [process.wait(120) for process in together] == [0, 0, 0]
