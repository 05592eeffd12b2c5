"""Solvers from tables: what they become, what is refused in one line, and how they reach other processes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import of_others

from cpbench import registry
from cpbench.bench.planning import grids, plan, plan_file
from cpbench.errors import CpbenchError, DuplicateName, UnknownName
from cpbench.formulations import Kind
from cpbench.registry import DECLARED, PLUGIN_FILES
from cpbench.solvers.base import NoOptions, Trait, parse_options, solvers
from cpbench.solvers.external import declared
from cpbench.solvers.external.command import CommandSolver
from cpbench.solvers.external.served import ServedSolver


@pytest.fixture(autouse=True)
def _as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a test declares is forgotten after it, and what earlier tests of this process left is not there."""
    monkeypatch.setenv(DECLARED, "")
    solvers.discover()
    ours = {name: item for name, item in solvers._items.items() if not of_others(item)}
    monkeypatch.setattr(solvers, "_items", ours)
    monkeypatch.setattr(declared, "_declared", {})


def _file(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text)
    return path


def test_a_table_becomes_a_solver(tmp_path: Path) -> None:
    declared.declare_file(
        _file(
            tmp_path,
            """
            [solver.mine]
            node = "mlcp"
            serve = "./bin/mine --serve 'two words'"
            exchange = "npy-dir"
            matrices = "csr"
            summary = "ours"
            licence = "MIT"
            publishing = "ask first"
            kind = "relaxation"
            warm_start = true
            deterministic = true
            env = {MARK = "1"}
            options = {omega = 1.2, steps = 3, shuffle = true, rule = "bland"}

            [solver.plain]
            node = "lcp"
            command = "python3 solve.py {problem} {answer} {tol} {omega}"
            cwd = "inner"
            options = {omega = 1.0}
            """,
        )
    )
    mine, plain = solvers.get("mine"), solvers.get("plain")
    assert isinstance(mine, ServedSolver)
    assert mine.command == (str(tmp_path / "bin/mine"), "--serve", "two words")
    assert (mine.exchange, mine.matrices, mine.env, mine.cwd) == ("npy-dir", "csr", {"MARK": "1"}, str(tmp_path))
    assert (mine.spec.node, mine.spec.summary, mine.spec.licence) == ("mlcp", "ours", "MIT")
    assert (mine.spec.publishing, mine.spec.kind) == ("ask first", Kind.RELAXATION)
    assert mine.spec.traits == {Trait.SPARSE, Trait.WARM_START, Trait.DETERMINISTIC}
    typed = parse_options(mine.spec, {"omega": "1", "steps": "4", "shuffle": "false", "rule": "x"})
    assert (typed.omega, typed.steps, typed.shuffle, typed.rule) == (1.0, 4, False, "x")
    assert isinstance(plain, CommandSolver)
    assert plain.command[:2] == ("python3", "solve.py")  # found in PATH, and by Python in its folder
    assert plain.cwd == str(tmp_path / "inner")
    assert plain.availability().ok


MISTAKES = {
    "node = 'lcp'": "[solver.mine]: has neither command nor serve: say how it is run",
    "serve = './mine'": "[solver.mine]: node is missing, one of afc, avi,",
    "node = 'lcp'\nserve = 'a'\ncommand = 'b'": "[solver.mine]: has command and serve: keep one of them",
    "node = 'lpc'\nserve = 'a'": "[solver.mine]: node = 'lpc': unknown formulation 'lpc': did you mean nlp, lcp",
    "node = 'lcp'\nserve = 'a'\nexchange = 'npy'": "exchange = 'npy': unknown exchange 'npy'",
    "node = 'lcp'\nserve = 'a'\nmatrices = 'full'": "matrices = 'full': expected as-is or dense or csr",
    "node = 'lcp'\nserve = 'a'\nserv = 'b'": "serv = 'b': unknown key, known are node, command, serve",
    "node = 'lcp'\nserve = 3": "serve = 3: expected a text",
    "node = 'lcp'\nserve = \"a 'b\"": "cannot be split into words (No closing quotation)",
    "node = 'lcp'\nserve = 'a'\nwarm_start = 1": "warm_start = 1: expected true or false",
    "node = 'lcp'\nserve = 'a'\nenv = {A = 1}": "env = {'A': 1}: expected a table of texts",
    "node = 'lcp'\nserve = 'a'\nkind = 'exact'": "kind = 'exact': expected equivalent or relaxation",
    "node = 'lcp'\nserve = 'a'\noptions = {o = []}": "the default of o is not a number, text or truth value",
    "node = 'lcp'\nserve = 'a'\noptions = {tol = 1}": "tol is not a name for an option",
    "node = 'lcp'\ncommand = 'a {output}'": "command = 'a {output}': has the placeholder {output}, known are problem,",
    "node = 'lcp'\ncommand = 'a {problem'": "cannot be split into words",
    "node = 'qp'\nserve = 'a'\nexchange = 'fclib'": "the exchange fclib carries",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_a_mistake_is_one_line_with_file_table_and_key(text: str, tmp_path: Path) -> None:
    path = _file(tmp_path, f"[solver.mine]\n{text}\n")
    with pytest.raises(CpbenchError) as raised:
        declared.declare_file(path)
    said = str(raised.value)
    assert said.startswith(f"{path}: [solver.mine]: ")
    assert MISTAKES[text] in said
    assert "\n" not in said
    assert "mine" not in solvers


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[solvers.mine]\nnode = 'lcp'", "has no table [solver.NAME]"),
        ("[solver", "is not valid TOML"),
        ("[solver]\nmine = 1", "[solver.mine]: is not a table"),
        ("[solver.'a b']\nnode = 'lcp'\nserve = 'x'", "[solver.a b]: is not a name of a solver"),
        ("[solver.lemke]\nnode = 'lcp'\nserve = 'x'", "[solver.lemke]: there is a solver of this name already"),
        ("[solver.'nobody@x']\nserve = 'y'", "unknown solver 'nobody'"),
        ("[solver.'lemke@x']", "says nothing that differs: interpreter, command, serve or env"),
        ("[solver.'lemke@x']\nnode = 'qp'\nserve = 'y'", "node = 'qp': unknown key"),
        ("[solver.'lemke@inner8']\nserve = 'y'", "inner8 is the name of a route"),
        ("[solver.m]\nnode = 'lcp'\nserve = 'm'\n[solver.'m@x']\ninterpreter = 'p'", "m is a separate program"),
    ],
)
def test_a_file_is_refused_in_one_line(text: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(CpbenchError) as raised:
        declared.declare_file(_file(tmp_path, text))
    assert told in str(raised.value)
    assert str(raised.value).startswith(str(tmp_path / "mine.toml"))
    assert "\n" not in str(raised.value)


@pytest.mark.needs("cpbench_solvers")
def test_variants_are_their_base_by_another_build(tmp_path: Path) -> None:
    declared.declare_file(
        _file(
            tmp_path,
            """
            [solver."mine@head"]
            serve = "./new/mine"
            [solver."mine@quick"]
            env = {FAST = "1"}
            [solver."psor@head"]
            interpreter = "./venv/bin/python"
            env = {OPENBLAS_CORETYPE = "Haswell"}
            [solver.mine]
            node = "lcp"
            serve = "./mine --serve"
            matrices = "dense"
            licence = "MIT"
            env = {BASE = "1"}
            options = {omega = 1.2}
            """,
        )
    )
    base, head, quick = (solvers.get(name) for name in ("mine", "mine@head", "mine@quick"))
    assert isinstance(head, ServedSolver)
    assert isinstance(quick, ServedSolver)
    assert head.command == (str(tmp_path / "new/mine"),)
    assert quick.command == (str(tmp_path / "mine"), "--serve")
    assert head.matrices == quick.matrices == "dense"
    assert (head.env, quick.env) == ({"BASE": "1"}, {"BASE": "1", "FAST": "1"})
    assert head.spec.options is quick.spec.options is base.spec.options
    assert (head.spec.node, head.spec.licence) == ("lcp", "MIT")
    psor = solvers.get("psor@head")
    assert isinstance(psor, ServedSolver)
    assert psor.command[1:] == ("-m", "cpbench.solvers.external.serve", "psor")
    assert psor.command[0] == str(tmp_path / "venv/bin/python")
    assert psor.spec.options is solvers.get("psor").spec.options
    assert Trait.HISTORY not in psor.spec.traits
    assert psor.availability().state == "missing"


@pytest.mark.needs("cpbench_solvers")
def test_a_variant_has_the_options_of_its_solver() -> None:
    declared.declare("psor@blas", {"env": {"A": "1,2"}}, "here")
    assert plan.parse_entry("psor@blas").label == "psor@blas"
    assert [entry.label for entry in grids.grid("psor@blas[omega=1|1.5]")] == [
        "psor@blas[omega=1.0]",
        "psor@blas[omega=1.5]",
    ]
    with pytest.raises(DuplicateName, match="was declared otherwise in here"):
        declared.declare("psor@blas", {"env": {"A": "2"}}, "there")
    with pytest.raises(CpbenchError, match="unknown solver 'psro'"):
        declared.declare("psro@b", {"env": {"A": "1"}}, "here")
    with pytest.raises(CpbenchError, match="unknown solver 'psor@b="):
        grids.grid('psor@b={env={A="1"}}')


@pytest.mark.needs("cpbench_solvers")
def test_a_plan_declares_its_solvers_before_it_names_them(tmp_path: Path) -> None:
    path = tmp_path / "cpbench.toml"
    path.write_text(
        'solvers = ["mine[omega=1|2]", "psor@x"]\n[solver.mine]\nnode = "lcp"\nserve = "./mine"\n'
        'options = {omega = 1}\n[solver."psor@x"]\nenv = {A = "1"}\n'
    )
    file = plan_file.read(path)
    assert file.top["solvers"] == ("mine[omega=1|2]", "psor@x")
    path.write_text('[solver.other]\nnode = "lcp"\n')
    with pytest.raises(CpbenchError, match=r"cpbench.toml: \[solver.other\]: has neither command nor serve"):
        plan_file.read(path)


@pytest.mark.nightly
def test_other_processes_know_what_was_declared(tmp_path: Path) -> None:
    """By the environment; a file of tables may be given as a plugin too, and both may say the same."""
    path = _file(tmp_path, '[solver.mine]\nnode = "lcp"\nserve = "./mine"\n[solver."mine@x"]\nenv = {A = "1"}\n')
    declared.declare_file(path)
    told = json.loads(os.environ[DECLARED])
    assert told["mine"]["serve"] == str(tmp_path / "mine")
    script = "from cpbench.solvers.base import solvers; print(solvers.get('mine@x').command, solvers.get('mine').env)"
    for environment in ({PLUGIN_FILES: str(path)}, {}, {DECLARED: "", PLUGIN_FILES: str(path)}):
        done = subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == f"('{tmp_path}/mine',) {{}}"
    refused = subprocess.run(
        [sys.executable, "-c", script], env={**os.environ, DECLARED: "{"}, capture_output=True, text=True, check=False
    )
    assert "CPBENCH_SOLVERS: is not valid JSON" in refused.stderr


def test_more_tables_than_a_process_can_be_told_are_refused() -> None:
    """Nothing could be started any more where the variable is too long."""
    told = {"node": "lcp", "command": "true", "summary": "x" * (declared.MOST - 200)}
    assert declared.declare("long", told, "here").spec.name == "long"
    subprocess.run(["true"], check=True)
    with pytest.raises(CpbenchError, match=r"here: \[solver.more\]: with it the tables of .* declare fewer"):
        declared.declare("more", told, "here")
    assert "more" not in solvers


def test_options_of_a_program_without_any() -> None:
    solver = declared.declare("bare", {"node": "lcp", "command": "true"}, "here")
    assert solver.spec.options is NoOptions
    assert solver.version() == ""


@pytest.fixture(autouse=True)
def _nothing_declared(monkeypatch: pytest.MonkeyPatch) -> None:
    solvers.discover()
    monkeypatch.setattr(solvers, "_items", dict(solvers._items))
    monkeypatch.setattr(declared, "_declared", {})
    monkeypatch.delenv(registry.DECLARED, raising=False)


@pytest.mark.needs("cpbench_solvers")
def test_solvers_of_cpbench_need_no_file() -> None:
    assert declared.origin("pgs") == ""


def test_a_declared_solver_comes_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[solver.mine]\nnode = 'lcp'\nserve = 'true'\n[solver.'mine@b']\nserve = 'false'\n")
    declared.declare_file(path)
    assert declared.origin("mine") == declared.origin("mine@b") == str(path)


def test_a_plugin_is_neither_a_native_solver_nor_an_adapter() -> None:
    """Only what comes with cpbench may write compiled loops into its cache, and has its version."""
    registry.load_plugin(Path(__file__).parents[1] / "reference" / "lemke.py")
    assert solvers.get("reference-lemke").origin == "plugin"
    assert {s.origin for s in solvers if "clarabel" in s.spec.requires} == {"adapter"}


def test_an_unknown_solver_may_be_one_of_a_file() -> None:
    with pytest.raises(UnknownName, match="needs --plugin FILE"):
        solvers.get("of-a-plan-file-elsewhere")
