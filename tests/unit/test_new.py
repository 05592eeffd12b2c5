"""`cpbench new` writes plugins that pass `cpbench check`, and `cpbench check` finds what is wrong with others."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from command_line import with_plugins
from tiers import by_night

from cpbench.errors import CpbenchError, FormatError, UnknownName
from cpbench.formulations import LCP
from cpbench.formulations.exchange import exchanges
from cpbench.registry import DECLARED
from cpbench.solvers import Budget, Claim
from cpbench.solvers.external import declared, served
from cpbench.testing import conduct
from cpbench.testing.cases import cases

BROKEN = Path(__file__).resolve().parents[1] / "broken" / "plugins.py"
COMPILER = shutil.which("c++") or shutil.which("g++")


def cpbench(folder: Path, *arguments: str, rc: int = 0) -> subprocess.CompletedProcess[str]:
    done = with_plugins(folder, *arguments)
    assert done.returncode == rc, done.stdout + done.stderr
    return done


def one_line(folder: Path, *arguments: str) -> str:
    """What is said of bad input: one line, and exit code 2."""
    said = cpbench(folder, *arguments, rc=2)
    assert said.stderr.count("\n") == 1, said.stderr
    assert said.stdout == ""
    return said.stderr


def needs(program: str | None, what: str) -> None:
    if program is None:
        pytest.skip(f"needs a program: {what}")


def failed(output: str) -> dict[str, str]:
    """Checks that did not pass, and why."""
    return dict(re.findall(r"^  (?:failed|missing|broken) +(\w+) *(.*)$", output, re.MULTILINE))


@pytest.fixture
def registries(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever is registered in a test is forgotten after it."""
    for registry in conduct.REGISTRIES.values():
        registry.discover()
        monkeypatch.setattr(registry, "_items", dict(registry._items))
    monkeypatch.setattr(declared, "_declared", {})
    monkeypatch.setenv(DECLARED, "")


# ------------------------------------------------------------------------------------------------ templates


@pytest.mark.parametrize("kind", ["solver", *by_night(["conversion", "problem"])])
def test_python_passes_its_checks(tmp_path: Path, kind: str) -> None:
    said = cpbench(tmp_path, "new", kind, "demo-2").stdout
    assert said.splitlines() == ["wrote demo-2/demo_2.py", "next: cpbench check demo-2/demo_2.py"]
    told = cpbench(tmp_path, "check", "demo-2/demo_2.py").stdout
    assert told.startswith(f"{kind} {'lcp-lcp-' if kind == 'conversion' else ''}demo-2 (lcp")
    assert "passed" in told


@pytest.fixture(scope="module")
def cpp(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the solver in C++, compiled by the line that its declaration tells when it is missing."""
    needs(COMPILER, "C++ compiler")
    folder = tmp_path_factory.mktemp("cpp")
    cpbench(folder, "new", "solver", "demo", "--lang", "cpp")
    told = failed(cpbench(folder, "check", "demo/demo.toml", rc=1).stdout)["availability"]
    assert "no such executable" in told
    line = told.partition("compile it, in its folder: ")[2]
    assert line == "c++ -std=c++17 -O2 -o demo demo.cpp"
    strict = [str(COMPILER), *line.split()[1:], "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
    subprocess.run(strict, cwd=folder / "demo", check=True, timeout=600)
    return folder / "demo"


@pytest.mark.nightly
def test_cpp_passes_its_checks(cpp: Path) -> None:
    cpbench(cpp, "check", "demo.toml")


STRICT = ("-std=c++17", "-O2", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")


@pytest.mark.nightly
@pytest.mark.usefixtures("registries")
@pytest.mark.parametrize("node", ["fc", "lcp", "mlcp", "ncp", "qp"])
def test_a_formulation_has_the_same_method_in_both_languages(tmp_path: Path, node: str) -> None:
    """Each passes its checks as it is written, and both need as many iterations: in C++ everything, the error that it
    stops by too, is written a second time."""
    needs(COMPILER, "C++ compiler")
    cpbench(tmp_path, "new", "solver", "slow", "--node", node)
    cpbench(tmp_path, "new", "solver", "quick", "--node", node, "--lang", "cpp")
    subprocess.run(
        [str(COMPILER), *STRICT, "-o", "quick", "quick.cpp"], cwd=tmp_path / "quick", check=True, timeout=120
    )
    plugins = [tmp_path / "slow" / "slow.py", tmp_path / "quick" / "quick.toml"]
    for plugin in plugins:
        assert re.search(r"\b\d+ passed$", cpbench(tmp_path, "check", str(plugin), "-q").stdout, re.MULTILINE)
    python, cpp = (conduct.registered_by(plugin)[0].plugin for plugin in plugins)
    solved = 0
    for case in cases(node):
        if python.obstacle(case.problem) is None:
            one, two = (solver.run(case.problem, Budget(tolerance=1e-6, iterations=500)) for solver in (python, cpp))
            assert one.claim == two.claim, case.name
            if one.claim is Claim.SOLVED:
                solved += 1
                apart = abs(one.counters["iterations"] - two.counters["iterations"])
                assert apart <= 1 + one.counters["iterations"] // 50, case.name
    cpp.close()
    assert solved >= 5


@pytest.mark.nightly
def test_the_makefile_compiles(cpp: Path, tmp_path: Path) -> None:
    needs(shutil.which("make"), "make")
    for file in ("demo.cpp", "cpbench.hpp", "Makefile"):
        shutil.copy(cpp / file, tmp_path)
    subprocess.run(["make", f"CXX={COMPILER}"], cwd=tmp_path, check=True, timeout=600, capture_output=True)
    assert (tmp_path / "demo").exists()


def test_the_header_speaks_the_protocol(cpp: Path, tmp_path: Path) -> None:
    """By hand: paths that are not ASCII, keys that nobody knows, bad requests; a message a request, and no more."""
    folder = tmp_path / 'a "quoted" \\ ä \U0001f600'
    folder.mkdir()
    problem = LCP(M=[[2.0, 1], [1, 2]], q=[-5.0, -6.0], name="deudeu")
    exchange = exchanges.get("npy-dir")
    exchange.write_problem(problem, folder / "problem")
    limits = {"tolerance": 1e-9, "seconds": None, "iterations": None, "seed": 0}
    requests = [
        {"do": "hello", "protocol": 1, "more": [1, {"a": None}, "b\u00df", True, -1.5e-3]},
        {"do": "load", "problem": str(folder / "nowhere"), "node": "lcp"},
        {"do": "load", "problem": str(folder / "problem"), "node": "lcp"},
        {"do": "warmup"},
        {"do": "solve", **limits, "options": {"omega": 1.0, "max_iterations": 100}, "start": None},
        {"do": "write", "answer": str(folder / "answer")},
        {"do": "solve", **limits, "options": {}, "start": str(folder / "answer")},
        {"do": "solve", **{**limits, "iterations": 1}, "options": {}, "start": None},
    ]
    lines = [*(json.dumps(request) for request in requests), '{"do": "hel', json.dumps({"do": "quit"})]
    done = subprocess.run([cpp / "demo"], input="\n".join(lines) + "\n", capture_output=True, text=True, timeout=600)
    assert done.returncode == 0
    assert done.stderr == ""
    hello, nowhere, loaded, warm, solved, written, again, once, broken = map(json.loads, done.stdout.splitlines())
    assert hello == {"ok": True, "name": "demo", "version": "1.0"}
    assert nowhere == {"error": f"{folder / 'nowhere'}/problem.json: cannot be read"}
    assert loaded == warm == written == {"ok": True}
    assert (solved["claim"], once["claim"]) == ("solved", "max_iter")
    assert (again["claim"], again["iterations"]) == ("solved", 0)
    assert "not JSON" in broken["error"]
    answer = exchange.read_answer(folder / "answer", problem)
    assert problem.residuals(answer).error <= 1e-9


def test_the_header_refuses_files_that_are_none(cpp: Path, tmp_path: Path) -> None:
    exchange = exchanges.get("npy-dir")
    problem = LCP(M=[[2.0, 1], [1, 2]], q=[-5.0, -6.0])
    whole = exchange.write_problem(problem, tmp_path / "p") or (tmp_path / "p" / "q.npy").read_bytes()
    load = json.dumps({"do": "load", "problem": str(tmp_path / "p"), "node": "lcp"}) + "\n"
    for content in (b"", b"\x93NUMPY", whole[:-1], whole[:20], whole.replace(b"<f8", b"<f4"), b"text" * 100):
        (tmp_path / "p" / "q.npy").write_bytes(content)
        done = subprocess.run([cpp / "demo"], input=load, capture_output=True, text=True, timeout=600)
        assert "q.npy" in json.loads(done.stdout)["error"], content


def test_julia_passes_its_checks(tmp_path: Path) -> None:
    cpbench(tmp_path, "new", "solver", "demo", "--lang", "julia")
    needs(shutil.which("julia"), "julia")
    packages = 'using Pkg; Pkg.add(["JSON", "NPZ"])'
    subprocess.run(["julia", "--project=.", "-e", packages], cwd=tmp_path / "demo", check=True, timeout=900)
    cpbench(tmp_path, "check", "demo/demo.toml", "--timeout", "300s")


@pytest.mark.usefixtures("registries")
def test_julia_says_what_the_protocol_says(tmp_path: Path) -> None:
    """What can be seen without Julia: requests, replies and claims are those of the protocol, and it is declared."""
    said = cpbench(tmp_path, "new", "solver", "demo", "--lang", "julia").stdout
    assert {line.split("/")[-1] for line in said.splitlines() if line.startswith("wrote")} == {
        "cpbench.jl",
        "demo.jl",
        "demo.toml",
    }
    loop = (tmp_path / "demo" / "cpbench.jl").read_text(encoding="utf-8")
    mine = (tmp_path / "demo" / "demo.jl").read_text(encoding="utf-8")
    asked = set(re.findall(r'"do": "(\w+)"', served.__doc__ or "")) - {"hello"} | {"hello"}
    assert asked == {"hello", "warmup", "load", "solve", "write", "quit"}
    assert asked == set(re.findall(r'what == "(\w+)"', loop))
    replies = {"ok", "unsupported", "unavailable", "state", "memory", "error", "name", "version"}
    assert replies == set(re.findall(r'"(\w+)" =>', loop)) - {"z"}
    assert {"tolerance", "seconds", "iterations", "seed", "options", "start", "problem", "answer", "do"} == set(
        re.findall(r'asked\["(\w+)"\]', loop)
    )
    claims = re.findall(r'(?:claim =|=>|\?|:) "(\w+)"', mine)
    assert {"solved", "max_iter", "failed"} <= set(claims) <= {*served.Claim}
    for text in (loop, mine):
        blocks = len(re.findall(r"^\s*(?:reply = )?(?:function|struct|module|if|for|while|try)\b", text, re.MULTILINE))
        assert blocks == len(re.findall(r"^\s*end$", text, re.MULTILINE))
        assert "@" not in text.replace("@__DIR__", "")
    (item,) = conduct.registered_by(tmp_path / "demo" / "demo.toml")
    assert (item.kind, item.name, item.nodes) == ("solver", "demo", ("lcp",))
    assert 'Pkg.add(["JSON", "NPZ"' in item.plugin.spec.install
    if shutil.which("julia") is None:
        assert item.plugin.availability().state == "missing"


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("solver", "1st"), "letters"),
        (("solver", "../x"), "letters"),
        (("solver", "größe"), "letters"),
        (("solver", "class"), "word of Python"),
        (("solver", "lemke"), "exists already"),
        (("problem", "lcp-planted"), "exists already"),
        (("conversion", "demo", "--lang", "cpp"), "Python"),
        (
            ("solver", "demo", "--node", "gfc"),
            "no template of a solver in python for 'gfc', but for fc, lcp, mlcp, ncp, qp",
        ),
        (("solver", "demo", "--node", "fc", "--lang", "julia"), "in julia for 'fc', but for lcp"),
        (("problem", "demo", "--node", "fc"), "no template of a problem for 'fc', but for lcp"),
        (("solver", "demo", "--node", "lpc"), "did you mean nlp, lcp"),
        (("solver", "demo", "-o", "file"), "file"),
        (("solver", "demo", "-o", "file/below"), "file"),
        (("solver", "demo", "--lang", "cobol"), "cobol"),
        (("poem", "demo"), "poem"),
    ],
)
def test_nothing_is_written_for_bad_input(tmp_path: Path, arguments: tuple[str, ...], word: str) -> None:
    (tmp_path / "file").write_text("mine")
    assert word in one_line(tmp_path, "new", *arguments)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "mine"


def test_files_are_replaced_by_force_only(tmp_path: Path) -> None:
    mine = tmp_path / "demo" / "demo.toml"
    mine.parent.mkdir()
    mine.write_text("mine")
    new = ("new", "solver", "demo", "--lang", "cpp")
    assert "demo.toml: exists already" in one_line(tmp_path, *new)
    assert [path.name for path in mine.parent.iterdir()] == ["demo.toml"]
    assert mine.read_text() == "mine"
    cpbench(tmp_path, *new, "--force")
    assert sorted(path.name for path in mine.parent.iterdir()) == ["Makefile", "cpbench.hpp", "demo.cpp", "demo.toml"]
    assert mine.read_text() != "mine"


def test_a_failing_disk_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from cpbench.testing import new_plugin

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(new_plugin.os, "replace", full)
    with pytest.raises(FormatError, match="No space left"):
        new_plugin.write_files(tmp_path, {"a": "1", "b": "2"}, force=False)
    assert list(tmp_path.iterdir()) == []


# --------------------------------------------------------------------------------------------------- check

REGISTERED = f"""
import dataclasses, importlib.util, os, sys, time
import numpy as np
spec = importlib.util.spec_from_file_location("broken_plugins", {str(BROKEN)!r})
broken = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = broken
spec.loader.exec_module(broken)
from cpbench.conversions import conversions
from cpbench.formulations import LCPPoint, formulations
from cpbench.generators.base import Instance, collection
from cpbench.solvers import Claim, SolverOutput, solvers
from cpbench.storage import formats

def solver(cls, name):
    named = {{"spec": dataclasses.replace(cls.spec, name=name), "__doc__": "broken", "__module__": __name__}}
    solvers.add(name, type(cls.__name__, (cls,), named)())
"""
TAKEN = """
from cpbench.generators.base import collection

@collection("qp-planted", "qp", "another one", "nowhere", builtin=False)
def build():
    return []
"""


@pytest.mark.nightly
def test_a_solver_that_hangs_or_dies_fails_that_check_alone(tmp_path: Path) -> None:
    text = (
        REGISTERED
        + """
class Hangs(broken.ClaimsZeros):
    def solve(self, prepared, budget, options, start=None, record=None):
        time.sleep(1e4)

class Dies(broken.ClaimsZeros):
    def solve(self, prepared, budget, options, start=None, record=None):
        print("last words", flush=True)
        os.abort()

class Raises(broken.ClaimsZeros):
    def solve(self, prepared, budget, options, start=None, record=None):
        return 1 / 0

class Leaves(broken.ClaimsZeros):
    def warmup(self):
        os._exit(3)

for cls in (Hangs, Dies, Raises, Leaves):
    solver(cls, cls.__name__)
"""
    )
    (tmp_path / "wild.py").write_text(text)
    only = ("--only", "check_some_case_is_solved", "--only", "check_the_spec_is_complete", "--timeout", "2s")
    told = cpbench(tmp_path, "check", "wild.py", *only, rc=1).stdout
    parts = {part.split()[1]: part for part in re.split(r"^(?=\w)", told, flags=re.MULTILINE) if part}
    assert failed(parts["Hangs"]) == {"check_some_case_is_solved": "still running after 2 s"}
    assert "killed by SIGABRT" in failed(parts["Dies"])["check_some_case_is_solved"]
    assert "last words" in failed(parts["Dies"])["check_some_case_is_solved"]
    assert "ZeroDivisionError" in failed(parts["Raises"])["check_some_case_is_solved"]
    assert "wild.py, line" in failed(parts["Raises"])["check_some_case_is_solved"]
    assert "exited with code 3" in failed(parts["Leaves"])["availability"]
    for name in ("Hangs", "Dies", "Raises"):
        assert re.search(r"^  passed +check_the_spec_is_complete$", parts[name], re.MULTILINE)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.usefixtures("registries")
def test_known_failures_are_strict(tmp_path: Path) -> None:
    """What the spec says to fail may fail, with its reason; what it says to fail and passes is a failure."""
    text = (
        REGISTERED
        + """
from types import MappingProxyType as Fixed
class Honest(broken.ClaimsZeros):
    spec = dataclasses.replace(broken.ClaimsZeros.spec, known_failures=Fixed({"check_claims_are_true": "8 of 8"}))
class Modest(broken.ClaimsZeros):
    spec = dataclasses.replace(broken.ClaimsZeros.spec, known_failures=Fixed({"check_the_same_twice": "it is not"}))
solver(Honest, "honest")
solver(Modest, "modest")
"""
    )
    (tmp_path / "known.py").write_text(text)
    honest, modest = conduct.registered_by(tmp_path / "known.py")
    assert conduct.conduct(honest, "check_claims_are_true") == conduct.Mark("known failure", "8 of 8")
    assert conduct.conduct(modest, "check_claims_are_true").word == "failed"
    told = conduct.conduct(modest, "check_the_same_twice")
    assert (told.word, "take check_the_same_twice out of it" in told.reason) == ("failed", True)


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.usefixtures("registries")
@pytest.mark.parametrize(
    ("file", "text", "word"),
    [
        ("p.py", "import nothing_of_this_name", "p.py: line 1: ModuleNotFoundError"),
        ("p.py", "\n\ndef (", "p.py: line 3: SyntaxError"),
        ("p.py", "raise SystemExit(3)", "p.py: line 1: SystemExit"),
        ("p.py", "x = 1", "registers nothing"),
        ("p.py", REGISTERED + "solver(broken.ClaimsZeros, 'lemke')", "'lemke' is defined twice"),
        ("p.py", TAKEN, "the problem 'qp-planted' exists already"),
        ("p.toml", "[solver.p]\nnode = 'lcp'", "neither command nor serve"),
        ("p.toml", "[solver", "not valid TOML"),
        ("nowhere.py", None, "nowhere.py: no such file"),
        ("nowhere.toml", None, "nowhere.toml"),
    ],
)
def test_a_plugin_that_does_not_load_says_so_in_one_line(
    tmp_path: Path, file: str, text: str | None, word: str
) -> None:
    if text is not None:
        (tmp_path / file).write_text(text)
    with pytest.raises(CpbenchError) as refusal:
        conduct.registered_by(tmp_path / file)
    assert word in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.needs("cpbench_solvers")
def test_an_unknown_name_cannot_be_checked() -> None:
    with pytest.raises(UnknownName, match="did you mean lemke"):
        conduct.named("lemkee")


# -------------------------------------------------------------------------------------------------- --plugin


@pytest.mark.nightly
def test_a_plugin_is_named_before_or_after_the_command(tmp_path: Path) -> None:
    cpbench(tmp_path, "new", "solver", "demo")
    assert "demo" in cpbench(tmp_path, "--plugin", "demo/demo.py", "list", "solvers", "demo").stdout
    assert "demo" in cpbench(tmp_path, "list", "solvers", "--plugin", "demo/demo.py", "demo").stdout
    assert "x.py: --plugin takes" in one_line(tmp_path, "list", "solvers", "--plugin", "x.py")
    (tmp_path / "x.py").write_text("1 / 0")
    assert "x.py: line 1: ZeroDivisionError" in one_line(tmp_path, "list", "solvers", "--plugin", "x.py")
