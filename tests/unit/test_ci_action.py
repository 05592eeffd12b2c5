"""The action, the script and the workflows for other repositories, on a toy repository with its own solver."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml
from command_line import cpbench
from tiers import some_by_day

from cpbench.bench.planning import plan_file
from cpbench.bench.results.store import Store

ROOT = Path(__file__).resolve().parents[2]
ACTION = ROOT / ".github/actions/compare/action.yml"
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
SCRIPT = ROOT / "cpbench/testing/templates/ci/shell/compare.sh"
TOY = ROOT / "tests/ci_toy"
ENV = {
    "CPBENCH_PLUGINS": "",
    "CPBENCH_SOLVERS": "",
    "PATH": os.pathsep.join([os.path.dirname(sys.executable), os.environ["PATH"]]),
    "GIT_CONFIG_GLOBAL": os.devnull,
    **{f"GIT_{who}_{what}": f"{what}@example.org" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")},
}
VENV = f"""python3 -m venv --without-pip .venv
cd .venv/lib/python3*/site-packages
echo "import site; site.addsitedir('{sysconfig.get_path("purelib")}')" > ours.pth"""
"""The build of an environment that finds what ours has."""
FAST = {"repeats": "1", "problems": "problems/skewed-0.h5 problems/spd-0.h5"}


def run(folder: Path, *words: str, rc: int = 0, **env: str) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        words, cwd=folder, env={**os.environ, **ENV, **env}, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == rc, done.stdout + done.stderr
    return done


def commit(folder: Path, message: str) -> None:
    run(folder, "git", "add", "-A")
    run(folder, "git", "commit", "-q", "--allow-empty", "-m", message)


@pytest.fixture(scope="session")
def origin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Somebody's repository: a solver in Python, and one commit on main."""
    folder = tmp_path_factory.mktemp("toy") / "origin"
    shutil.copytree(TOY / "python", folder, ignore=shutil.ignore_patterns("__pycache__"))
    run(folder, sys.executable, str(TOY / "problems.py"), "problems")
    run(folder, "git", "init", "-q", "-b", "main", ".")
    commit(folder, "base")
    return folder


@pytest.fixture
def toy(origin: Path, tmp_path: Path) -> Path:
    """A clone of it, on a branch."""
    run(tmp_path, "git", "clone", "-q", str(origin), "toy")
    run(tmp_path / "toy", "git", "switch", "-q", "-c", "change")
    return tmp_path / "toy"


def load(path: Path) -> dict[str, Any]:
    """A YAML file; `on`, which YAML 1.1 reads as a truth value, is the text again."""
    found = yaml.safe_load(path.read_text(encoding="utf-8"))
    return {"on" if key is True else key: value for key, value in found.items()}


def expressions(value: Any) -> list[str]:
    """What stands in ${{ }} anywhere in a value."""
    if isinstance(value, dict | list):
        parts = value.values() if isinstance(value, dict) else value
        return [found for item in parts for found in expressions(item)]
    return re.findall(r"\$\{\{(.*?)\}\}", value) if isinstance(value, str) else []


@dataclass
class Done:
    """The step of the action that compares, after its end: exit code, summary, outputs, and what it printed."""

    code: int
    summary: str
    outputs: dict[str, str]
    log: str


def act(toy: Path, **inputs: str) -> Done:
    """Run that step as GitHub's runner does: its inputs in variables, its outputs and the summary in files."""
    action, runner = load(ACTION), toy.parent / "runner"
    step = next(step for step in action["runs"]["steps"] if step.get("id") == "compare")
    given = {name: told.get("default", "") for name, told in action["inputs"].items()}
    given |= {"solver": "mine.py", "problems": "problems", "base": "origin/main"} | inputs
    runner.mkdir()
    output, summary = runner / "output", runner / "summary"
    for file in (output, summary):
        file.touch()
    here = {"GITHUB_ACTIONS": "true", "GITHUB_OUTPUT": str(output), "GITHUB_STEP_SUMMARY": str(summary)}
    here |= {variable: given[name] for name, variable in _variables(step).items()}
    command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]  # what `shell: bash` is
    env = {**os.environ, **ENV, **here, "RUNNER_TEMP": str(runner)}
    ran = subprocess.run(command, cwd=toy, env=env, capture_output=True, text=True, timeout=600)
    outputs = dict(line.split("=", 1) for line in output.read_text().splitlines())
    return Done(ran.returncode, summary.read_text(), outputs, ran.stdout + ran.stderr)


def _variables(step: dict[str, Any]) -> dict[str, str]:
    """Inputs of the action and the variables in which the step has them, each an option of the script."""
    return dict(re.findall(r'--([\w-]+) "\$(\w+)"', step["run"]))


def script(toy: Path, *words: str, rc: int = 0, **env: str) -> subprocess.CompletedProcess[str]:
    return run(toy, "bash", str(SCRIPT), *words, rc=rc, **env)


# ------------------------------------------------------------------------------------------ the form of the files


def _steps_are_whole(steps: list[dict[str, Any]]) -> None:
    for step in steps:
        assert ("run" in step) != ("uses" in step), step
        assert set(step) <= {"name", "id", "if", "uses", "with", "run", "shell", "env", "working-directory"}, step
        assert not expressions(step.get("run", "")), f"a value that strangers write becomes shell: {step['run']}"
        if "uses" in step and step["uses"].startswith("./"):
            assert (ROOT / step["uses"] / "action.yml").is_file()
        elif "uses" in step:
            assert re.fullmatch(r"actions/[\w-]+@v\d+", step["uses"]), step["uses"]


def test_the_action_is_a_composite_one_and_refers_to_what_it_has() -> None:
    action = load(ACTION)
    assert set(action) == {"name", "description", "inputs", "outputs", "runs"}
    assert action["runs"]["using"] == "composite"
    steps = action["runs"]["steps"]
    _steps_are_whole(steps)
    assert all(step["shell"] == "bash" for step in steps if "run" in step)
    assert all(told["description"] and ("default" in told or told["required"]) for told in action["inputs"].values())
    assert all(isinstance(told.get("default", ""), str) for told in action["inputs"].values())
    said = " ".join([*expressions(action), *(step.get("if", "") for step in steps)])
    assert set(re.findall(r"\binputs\.([\w-]+)", said)) == set(action["inputs"])
    ids = [step["id"] for step in steps if "id" in step]
    assert set(re.findall(r"\bsteps\.(\w+)\.outputs", said)) == set(ids)
    (compare,) = (step for step in steps if step.get("id") == "compare")
    for name, variable in _variables(compare).items():
        value = compare["env"][variable]
        assert value == f"${{{{ inputs.{name} }}}}" or value.startswith("${{ inputs.base || (github.base_ref"), name
    written = set(re.findall(r'"(\w+)=\$', SCRIPT.read_text()))
    assert set(re.findall(r"\.outputs\.(\w+)", said)) == set(action["outputs"]) == written


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_has_its_keys_and_no_right_that_it_does_not_need(path: Path) -> None:
    workflow = load(path)
    assert {"name", "on", "permissions", "jobs"} <= set(workflow)
    assert workflow["permissions"] == {"contents": "read"}
    assert "pull_request_target" not in workflow["on"]
    for name, job in workflow["jobs"].items():
        assert {"runs-on", "timeout-minutes", "steps"} <= set(job), name
        assert set([job["needs"]] if isinstance(job.get("needs"), str) else job.get("needs", ())) <= set(
            workflow["jobs"]
        )
        _steps_are_whole(job["steps"])
    assert "secrets." not in path.read_text()


@pytest.mark.needs("cpbench_solvers")
def test_our_workflow_tests_compares_builds_the_pages_and_writes_nothing_back() -> None:
    workflow = load(ROOT / ".github/workflows/ci.yml")
    jobs = workflow["jobs"]
    assert [step["run"] for step in jobs["tests"]["steps"] if "run" in step] == ['.ci/run "$JOB"']
    parts = dict(re.findall(r"^  (\w+)\) (.*?);;$", (ROOT / ".ci/run").read_text(), re.MULTILINE | re.DOTALL))
    assert set(jobs["tests"]["strategy"]["matrix"]["job"]) == set(parts)
    left_out = set(re.findall(r"--ignore=(\S+?)[\s)]", parts["unit"]))
    assert left_out == {name for job in parts if job != "unit" for name in re.findall(r"(tests/\w+)", parts[job])}
    (build,) = (step["run"] for step in jobs["docs"]["steps"] if "docs/generate" in step.get("run", ""))
    assert "unshare" in build
    kept = {name for name, job in jobs.items() for step in job["steps"] if "upload-artifact" in step.get("uses", "")}
    assert kept == {"docs", "compare", "report", "pythons"}
    assert "write" not in {job.get("permissions", {}).get("contents") for job in jobs.values()}
    assert not any("git push" in step.get("run", "") for job in jobs.values() for step in job["steps"])
    assert "github.event_name != 'pull_request'" in jobs["report"]["if"]
    for name in (".ci/run", ".ci/compare"):
        assert os.access(ROOT / name, os.X_OK)
    assert plan_file.read(ROOT / ".ci/compare.toml").top["problems"]


# ---------------------------------------------------------------------------------------------- what is written


def test_new_ci_writes_a_workflow_that_is_whole(tmp_path: Path) -> None:
    said = cpbench(tmp_path, "new", "ci", "my solver/mine.toml", "--build", "make -C 'my solver' all")
    assert said.stdout.splitlines()[0] == "wrote .github/workflows/cpbench.yml"
    workflow = load(tmp_path / ".github/workflows/cpbench.yml")
    steps = workflow["jobs"]["compare"]["steps"]
    _steps_are_whole(steps)
    assert workflow["permissions"] == {"contents": "read"}
    assert steps[0]["with"]["fetch-depth"] == 0
    words = run(tmp_path, "bash", "-c", f"bash() {{ printf '%s\\n' \"$@\"; }}; {steps[3]['run']}", RUNNER_TEMP="/r")
    assert "my solver/mine.toml\n--build\nmake -C 'my solver' all\n" in words.stdout
    assert set(re.findall(r"^(--[\w-]+)$", words.stdout, re.M)) <= set(re.findall(r"--[\w-]+", SCRIPT.read_text()))
    assert len((tmp_path / ".github/workflows/cpbench.yml").read_text().splitlines()) <= 22
    assert "exists already" in cpbench(tmp_path, "new", "ci", "mine.toml").stderr


@pytest.mark.parametrize(
    ("words", "told"),
    some_by_day(
        [
            ((), "the plugin of your solver is missing: cpbench new ci mine.toml"),
            (("/mine.toml",), "cannot be a plugin: say its path in the repository"),
            (("../mine.toml",), "cannot be a plugin"),
            (("mine.cpp",), "of a .toml or .py file"),
            (("mine.toml", "--build", "a\nb"), "more than one line"),
            (("mine.toml", "--host", "jenkins"), "github"),
        ],
        2,
    ),
)
def test_new_ci_refuses_in_one_line(tmp_path: Path, words: tuple[str, ...], told: str) -> None:
    done = cpbench(tmp_path, "new", "ci", *words)
    assert done.returncode == 2
    assert told in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


# --------------------------------------------------------------------------------- builds, and what is said of them


@pytest.mark.nightly
def test_the_same_build_passes(toy: Path) -> None:
    commit(toy, "same")
    done = act(toy)
    assert done.code == 0, done.log
    assert done.outputs["verdict"] in ("same", "inconclusive")
    kept = Path(done.outputs["results"])
    assert {path.name for path in kept.iterdir()} == {
        "summary.md",
        "results.sqlite",
        "variants.toml",
        "mine.json",
    }
    assert (kept / "summary.md").read_text() == done.summary
    assert run(toy, "git", "worktree", "list").stdout.count("\n") == 1
    assert run(toy, "git", "status", "--short").stdout == ""


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("change", "inputs", "told"),
    [
        ("slower", {}, r"Regressed.*1 regressed"),
        ("wrong", FAST, r"solved → wrong"),
        ("crashing", {**FAST, "build": VENV, "python": ".venv/bin/python"}, r"solved → crash"),
    ],
    ids=["slower", "wrong", "crashing, each checkout with its own environment"],
)
def test_a_worse_build_fails_and_says_why(toy: Path, change: str, inputs: dict[str, str], told: str) -> None:
    shutil.copy(TOY / "changes" / f"{change}.py", toy / "sweeps.py")
    (toy / ".gitignore").write_text(".venv\n")
    commit(toy, change)
    done = act(toy, **inputs)
    assert done.code == 1, done.log
    assert done.outputs["verdict"] == "regressed"
    assert re.search(told, done.summary, re.DOTALL), done.summary
    assert "mine" in done.summary
    with Store(Path(done.outputs["results"]) / "results.sqlite") as store:
        base = [row for row in store.rows() if row.solver != "mine@head"]
    assert {row.status for row in base} == {"solved"}  # of its own checkout, whatever head does
    if change == "wrong":  # the commands of the summary run, when the run is over
        command = re.search(r"`(cpbench solve [^`]*)`", done.summary)
        path = re.search(r"`export PYTHONPATH=([^`]*)`", done.summary)
        assert command is not None, done.summary
        assert path is not None, done.summary
        again = subprocess.run(
            shlex.split(command[1]),
            cwd=toy,
            env={**os.environ, **ENV, "PYTHONPATH": path[1]},
            capture_output=True,
            text=True,
            check=False,
        )
        assert (again.returncode, "by mine@head" in again.stdout, "wrong" in again.stdout) == (1, True, True), again


PSOR = f"""[solver.sweeper]
node = "lcp"
command = "{sys.executable} psor.py {{problem}} {{answer}}"
matrices = "dense"
"""
SWEEPS = """import sys
import numpy as np
M, q = (np.load(f"{sys.argv[1]}/{name}.npy") for name in "Mq")
z = np.zeros(q.size)
for _ in range(5000):
    for i in range(q.size):
        z[i] = max(0.0, z[i] - (M[i] @ z + q[i]) / M[i, i])
np.save(f"{sys.argv[2]}/z.npy", z)
"""


@pytest.mark.nightly
def test_a_command_on_gitlab(toy: Path, tmp_path: Path) -> None:
    (toy / "psor.toml").write_text(PSOR)
    (toy / "psor.py").write_text(SWEEPS)
    commit(toy, "a command")
    run(toy, "git", "branch", "before")
    run(toy, "cpbench", "new", "ci", "psor.toml", "--host", "gitlab")
    (toy / "psor.py").write_text("raise SystemExit(3)\n")
    commit(toy, "ends at once")
    job = yaml.safe_load((toy / "cpbench.gitlab-ci.yml").read_text())["cpbench"]
    install, compare = job["script"]
    here = {"CI_BUILDS_DIR": str(tmp_path), "CI_MERGE_REQUEST_DIFF_BASE_SHA": "before"}
    run(toy, "bash", "-c", install.partition("&& ")[2], **here)
    compare = compare.rstrip() + f" --repeats 1 --problems '{FAST['problems']}'\n"
    said = run(toy, "bash", "-c", compare, rc=1, **here)
    assert "solved → crash" in said.stdout
    assert json.loads((toy / job["artifacts"]["paths"][0] / "sweeper.json").read_text())["verdict"] == "regressed"


@pytest.mark.nightly
def test_a_solver_that_the_base_has_not_is_judged_alone(toy: Path) -> None:
    text = (toy / "mine.py").read_text()
    (toy / "second.py").write_text(text.replace('"mine"', '"second"').replace("class Mine", "class Second"))
    commit(toy, "one more")
    done = act(toy, **FAST, solver="second.py")
    assert (done.code, done.outputs["verdict"]) == (0, "new"), done.log
    assert "Only head has second: nothing to compare with." in done.summary
    assert "2 pairs: 2 solved" in done.summary


# -------------------------------------------------------------------------------------------------- bad input


def _refused(done: Done, told: str) -> None:
    assert done.code == 2, done.log
    assert told in done.summary
    assert done.summary.startswith("### cpbench: no verdict\n")
    assert done.outputs == {}


@pytest.mark.nightly
def test_a_shallow_clone_gets_the_command_that_completes_it(origin: Path, tmp_path: Path) -> None:
    run(origin, "git", "commit", "-q", "--allow-empty", "-m", "second", "--no-verify")
    run(tmp_path, "git", "clone", "-q", "--depth", "1", f"file://{origin}", "toy")
    run(tmp_path / "toy", "git", "remote", "remove", "origin")
    _refused(act(tmp_path / "toy"), "no commit 'origin/main' here, the clone is shallow: check out with its whole")


def test_a_build_that_fails_leaves_nothing(toy: Path) -> None:
    commit(toy, "same")
    done = act(toy, build="echo no rule to make it >&2; exit 7")
    _refused(done, "failed with exit code 7: `echo no rule to make it >&2; exit 7`: no rule to make it")
    assert run(toy, "git", "worktree", "list").stdout.count("\n") == 1
    assert not (toy.parent / "runner/cpbench-compare/results").exists()


@pytest.mark.nightly
def test_a_build_that_makes_no_program(toy: Path) -> None:
    (toy / "prog.toml").write_text('[solver.prog]\nnode = "lcp"\nserve = "./prog"\n')
    commit(toy, "same")
    done = act(toy, **FAST, solver="prog.toml", build="true")
    _refused(done, "a build cannot run: prog@head: ")


@pytest.mark.parametrize(
    ("words", "told"),
    some_by_day(
        [
            (("--base", "main"), "say --solver FILE"),
            (("--solver", "mine.py"), "say --base REF"),
            (("--solver", "mine.py", "--base", "nowhere"), "no commit 'nowhere' here: fetch it first"),
            (("--solver", "none.toml", "--base", "main"), "no file 'none.toml' in this checkout"),
            (("--solver",), "--solver needs a value"),
            (("--speed", "3"), "no option '--speed'"),
            (
                ("--solver", "broken.py", "--base", "main"),
                "broken.py: line 1: ModuleNotFoundError: No module named 'lost'",
            ),
            pytest.param(
                ("--solver", "mine.py", "--base", "main", "--problems", "none.h5"), "none.h5", marks=pytest.mark.nightly
            ),
            pytest.param(
                ("--solver", "mine.py", "--base", "main", "--fail-on", "slow"),
                "no outcome 'slow'",
                marks=pytest.mark.nightly,
            ),
        ],
        3,
    ),
)
def test_bad_input_ends_with_2_and_a_reason(toy: Path, words: tuple[str, ...], told: str) -> None:
    (toy / "broken.py").write_text("import lost\n")
    said = script(toy, *words, rc=2)
    assert told in said.stderr.splitlines()[-1]
    assert said.stdout == ""
    assert not (toy / "cpbench-compare").exists()
    assert run(toy, "git", "worktree", "list").stdout.count("\n") == 1
