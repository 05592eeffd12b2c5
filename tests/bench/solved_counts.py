"""How many problems of a node every available solver of that node solves, each answer judged by us.

    python tests/bench/solved_counts.py NODE ... [--in builtin FOLDER ...] [--solvers 'siconos-*' ...]
        [--of NODE ...] [--seconds 10] [--tolerances 1e-4,1e-8] [--largest 2000]

All problems of the node, or of other nodes that exact conversions bring there (--of), in the built-in suite or the
given folders, as `cpbench run` runs them: every solve in a process apart, with a time limit. A row is a solver: what it
solved at each tolerance, what it claimed and had not, how often it refused a problem or was out of time, and the
processor time of its solves; the last row is all of them together. The problems that nobody solved, and those that
only one did, are named below.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from cpbench import storage
from cpbench.bench.results.store import read_results
from cpbench.errors import CpbenchError
from cpbench.generators.collection import builtin_folder
from cpbench.solvers import solvers
from cpbench.verification import VERIFIED

WORDS = ("wrong", "unsupported", "timeout")


def problems(nodes: list[str], folders: list[str], largest: int) -> Iterator[str]:
    """Addresses of the problems of these nodes; files that cannot be read, and those of more unknowns, are left out."""
    for address in storage.problem_files([str(builtin_folder()) if f == "builtin" else f for f in folders]):
        try:
            problem = storage.load(address)
        except CpbenchError:
            continue
        if problem.node in nodes and sum(problem.point_sizes.values()) <= largest:
            yield address


def solved(addresses: list[str], names: list[str], tolerances: str, seconds: float) -> Any:
    """The rows of a run of these solvers on these problems."""
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "results.sqlite"
        chosen = [part for name in names for part in ("-s", name)]
        limits = ["-t", tolerances, "--timeout", f"{seconds:g}s", "--repeats", "1", "--no-history", "--keep", "none"]
        command = [sys.executable, "-m", "cpbench", "run", *addresses, "--plan", "none", *chosen, *limits]
        command += ["--routes", "exact", "-o", str(results), "--no-report", "--quiet"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return read_results(results)


def table(node: str, rows: Any) -> None:
    tolerances = sorted(set(rows["tolerance"]), reverse=True)
    good = rows[rows["status"].isin(VERIFIED)]
    total = rows["address"].nunique()
    print(f"\n{node}, {total} problems")
    print(f"{'':30s}" + "".join(f"{t:>8.0e}" for t in tolerances) + "".join(f"{w:>13s}" for w in WORDS) + "    cpu s")
    names = sorted(set(rows["solver"]), key=lambda n: (-(good["solver"] == n).sum(), n))
    for name in names:
        own, solved_by = rows[rows["solver"] == name], good[good["solver"] == name]
        counts = "".join(f"{(solved_by['tolerance'] == t).sum():8d}" for t in tolerances)
        statuses = "".join(f"{(own['status'] == word).sum():13d}" for word in WORDS)
        print(f"{name:30s}{counts}{statuses}{own['cpu'].sum():9.2f}")
    print(
        f"{'any of them':30s}" + "".join(f"{good[good['tolerance'] == t]['address'].nunique():8d}" for t in tolerances)
    )
    for t in tolerances:
        by = good[good["tolerance"] == t].groupby("address")["solver"].agg(list)
        for address in sorted(set(rows["address"]) - set(by.index)):
            print(f"    at {t:.0e} nobody solved {address}")
        for address, who in by.items():
            if len(who) == 1 and len(names) > 1:
                print(f"    at {t:.0e} only {who[0]} solved {address}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("nodes", nargs="+", metavar="NODE")
    parser.add_argument("--in", dest="folders", nargs="+", default=["builtin"], metavar="FOLDER")
    parser.add_argument("--of", nargs="+", default=[], metavar="NODE")
    parser.add_argument("--solvers", nargs="+", default=["*"], metavar="GLOB")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--tolerances", default="1e-4,1e-8")
    parser.add_argument("--largest", type=int, default=2000, help="unknowns")
    asked = parser.parse_args()
    for node in asked.nodes:
        names = [
            s.spec.name
            for s in solvers
            if s.spec.node == node and s.availability().ok and any(fnmatch(s.spec.name, g) for g in asked.solvers)
        ]
        addresses = list(problems(asked.of or [node], asked.folders, asked.largest))
        if not names or not addresses:
            print(f"\n{node}: {len(addresses)} problems, {len(names)} solvers, nothing to run")
            continue
        table(node, solved(addresses, names, asked.tolerances, asked.seconds))


if __name__ == "__main__":
    main()
