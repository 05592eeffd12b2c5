"""Refusals and exit codes: files that were named, headers that NumPy cannot read, twin keys, plans that write away."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
from command_line import with_plugins

import cpbench as cp
from cpbench import storage
from cpbench.analysis.cautions import clocks
from cpbench.bench.messages import Result, Seconds
from cpbench.bench.outcome import LATE, LATE_SHARE, marks, runners_time
from cpbench.errors import FormatError


def _lcp(path: Path, shift: float = 0.0) -> Path:
    cp.save(cp.LCP(M=[[3.0, 1.0], [0.0, 2.0]], q=[-4.0 - shift, -6.0]), path)
    return path


# damage inside the header's text: brackets, quotes, keywords, numbers
HEADERS = [
    b"{'descr': '<f8', (((",
    b"{'descr': '",
    b"{'descr': 1//0}",
    b"x",
    b"{'shape': (9**",
    b"\\",
    b"'''",
    b"(" * 90,
]


@pytest.mark.parametrize("text", HEADERS)
def test_every_damaged_header_is_refused_in_one_line(text: bytes, tmp_path: Path) -> None:
    header = text + b" " * (117 - len(text)) + b"\n"
    path = tmp_path / "damaged.npz"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("M.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(32))
        file.writestr("q.npy", b"")
    with pytest.raises(FormatError) as refusal:
        cp.load(path)
    assert "\n" not in str(refusal.value)


GONE = '[solver.gone]\nnode = "lcp"\ncommand = "./no-such-program {problem} {answer}"\n'


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("solvers", "code", "line"),
    [
        (["lemke", "nsgs", "gone"], 1, "named and not run: gone (2 rows unavailable), nsgs (no route)"),
        (["lemke", "nsgs*", "gon*"], 0, ""),
        pytest.param(["lemke", "gone"], 1, "named and not run: gone (2 rows unavailable)", marks=pytest.mark.nightly),
        pytest.param(["lemke", "nsgs"], 1, "named and not run: nsgs (no route)", marks=pytest.mark.nightly),
    ],
)
def test_a_solver_that_was_named_and_could_not_run_ends_with_1(
    solvers: list[str], code: int, line: str, tmp_path: Path
) -> None:
    """One that a pattern matches, and that is not installed or has no route, was not asked for by itself."""
    (tmp_path / "gone.toml").write_text(GONE)
    _lcp(tmp_path / "a.h5")
    _lcp(tmp_path / "b.h5", 1.5)
    chosen = [word for name in solvers for word in ("-s", name)]
    options = ["-o", "r.sqlite", "--no-report", "-q", "--repeats", "1"]
    done = with_plugins(tmp_path, "--plugin", "gone.toml", "run", "a.h5", "b.h5", *chosen, *options)
    assert done.returncode == code, done.stderr
    assert "2 solved" in done.stdout
    assert ("named and not run" in done.stderr) == bool(line)
    assert line in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="does not apply: limits of the address space are Linux's")
def test_a_hard_limit_of_the_address_space_is_kept_to() -> None:
    """The limit of a worker is the smaller one; the program has a hard limit of 6 GiB and asks for 9 more."""
    program = (
        "import resource; resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30));"
        "resource.getrlimit(resource.RLIMIT_AS);"
        "from cpbench.bench.processes.isolation import limit_address_space as limit; limit(9 << 30);"
        "print(resource.getrlimit(resource.RLIMIT_AS)[0])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120)
    assert int(done.stdout) == 6 << 30


def test_a_fingerprint_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    path = _lcp(tmp_path / "own.h5")
    with h5py.File(path, "a") as file:
        found: list[str] = []
        file.visit(lambda name: found.append(name) if name.endswith("/q") else None)
        file[found[0]][1] = -6.5
    with pytest.raises(FormatError, match="@fingerprint"):
        cp.load(path)


def test_twin_keys_of_json_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "twin.mof.json"
    path.write_text('{"name": "a", "version": {"major": 1, "minor": 7}, "name": "b"}')
    with pytest.raises(FormatError, match="has the key name twice"):
        cp.load(path)


def test_a_clock_that_is_not_believed_gives_the_runners_time() -> None:
    """From both sides of the flag; the time is what the runner waited, and the last lines count it."""
    own = Seconds(0.02)
    result = Result(
        claim="solved", answered=True, message="", counters={}, setup=Seconds(0.0), solve=own, cpu=Seconds(0.01),
        wrote=False, vectors={}, children=0, threads=1, grown=0, peak=None,
    )  # fmt: skip
    most = LATE + LATE_SHARE * own
    assert marks(result, 0.999 * most, 1) == []
    assert marks(result, 1.001 * most, 1) == ["clock"]
    assert (runners_time(result, 0.7).solve, runners_time(result, 0.7).setup) == (0.7, 0.0)
    [line] = clocks(pd.DataFrame({"label": ["a", "b", "b"], "flags": ["", "clock", None]}))
    assert line.startswith("1 time is the runner's")


@pytest.mark.parametrize(
    ("name", "text", "quoted"),
    [
        ("p.nl", "g3 1 1 0\n 2 1 1 0 \x00\x07 0\n" + " 0 0\n" * 8, r"\x00\x07"),
    ],
)
def test_control_characters_of_a_file_are_spelled_out(tmp_path: Path, name: str, text: str, quoted: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(FormatError) as refusal:
        storage.load(path)
    assert quoted in str(refusal.value)
    assert str(refusal.value).isprintable()


@pytest.mark.parametrize("bounds", [{}, {"lb": np.zeros(3)}])
def test_two_arrays_alone_are_least_squares_where_named(tmp_path: Path, bounds: dict[str, np.ndarray]) -> None:
    path = tmp_path / "fit.npz"
    np.savez(path, A=np.ones((5, 3)), b=np.ones(5), **bounds)
    with pytest.raises(FormatError, match=r"holds a matrix A and b alone: --format least-squares"):
        storage.load(path)
    assert storage.load(path, format="least-squares").sizes() == {"n": 8, "m": 0, "k": 5}


def test_an_objective_beside_pairs_is_called_an_mpcc(tmp_path: Path) -> None:
    variable = {"type": "Variable", "name": "x"}
    model = {
        "version": {"major": 1, "minor": 7},
        "variables": [{"name": "x"}, {"name": "y"}],
        "objective": {"sense": "min", "function": variable},
        "constraints": [
            {
                "function": {
                    "type": "VectorOfVariables",
                    "variables": ["y", "x"],
                },
                "set": {"type": "Complements", "dimension": 2},
            },
            {"function": variable, "set": {"type": "GreaterThan", "lower": 0.0}},
        ],
    }
    path = tmp_path / "m.mof.json"
    path.write_text(json.dumps(model))
    with pytest.raises(FormatError, match=r"objective: is min beside Complements: .*\(MPCC\)"):
        storage.load(path)
