"""How many problems of a node every available solver of that node solves, each answer judged by us.

    python tests/bench/solved_counts.py NODE ... -o FOLDER [--in builtin FOLDER ...] [--of NODE ...] [--only GLOB ...]
        [--solvers GLOB ...] [--without GLOB ...] [--tolerances 1e-4,1e-8] [--seconds 3] [--again 20] [--best 5]
        [--largest 5000]

All problems of the node, or of other nodes that exact conversions bring there (--of), in the built-in suite or the
given folders, as `cpbench run` runs them: every solve in a process apart, with a time limit. Asked is in this order:

1. everybody, at the finest tolerance, --seconds a problem. An answer in time whose measured error is within a coarser
   tolerance is an answer at that one too, and counts there whatever the solver said of it.
2. who has no answer at a coarser tolerance yet, at that one. Who refused a problem is not asked again.
3. the automatic choice and the --best others, with --again seconds, where they had no answer.

Results are kept in the folder, a file a step: the same command goes on where it was cut. First come the single solvers
that solve more than the automatic choice, then a row a solver: what it solved at each tolerance; of its rows at the
finest how many were proved unsolvable, claimed and wrong, refused or out of time; the seconds of all its solves by the
clock, whoever else was busy. Below, what the automatic choice did not solve, and who did.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path

import pandas as pd

from cpbench import storage
from cpbench.bench.results.store import read_results
from cpbench.errors import CpbenchError
from cpbench.generators.collection import builtin_folder
from cpbench.solvers import solvers
from cpbench.verification import VERIFIED

WORDS = ("infeasible", "wrong", "unsupported", "timeout")
LATE = ("timeout", "memout", "crash", "error")
"""Rows whose answer, if they have any, came too late or is not the solver's."""
NAMED = 6
"""Solvers named of those that solve what the automatic choice does not."""


def problems(nodes: Sequence[str], folders: Sequence[str], only: Sequence[str], largest: int) -> Iterator[str]:
    """Addresses of the problems of these nodes; files that cannot be read, and those of more unknowns, are left out."""
    for address in storage.problem_files(
        [str(builtin_folder()) if f == "builtin" else str(Path(f).resolve()) for f in folders]
    ):
        if not any(fnmatch(Path(address).name, glob) for glob in only):
            continue
        try:
            problem = storage.load(address)
        except CpbenchError:
            continue
        if problem.node in nodes and sum(problem.point_sizes.values()) <= largest:
            yield address


def asked(pairs: Mapping[str, Sequence[str]], tolerance: float, seconds: float, file: Path) -> pd.DataFrame:
    """The rows of these solvers (by address of the problem) in `file`, after what it lacks has been run."""
    pairs = {address: names for address, names in pairs.items() if names}
    if not pairs:
        return pd.DataFrame()
    sets = [
        f"[[set]]\nname = 'p{i}'\nproblems = [{address!r}]\nsolvers = {list(names)}\n"
        for i, (address, names) in enumerate(pairs.items())
    ]
    shared = f"tolerance = {tolerance:g}\ntimeout = {seconds:g}\nrepeats = 1\nhistory = false\nroutes = 'exact'\n"
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "plan.toml"
        plan.write_text(shared + "".join(sets))
        options = ["--keep", "none", "--no-report", "--quiet", "-o", str(file)]
        subprocess.run(
            [sys.executable, "-m", "cpbench", "run", "--plan", str(plan), *options], check=True, stdout=sys.stderr
        )
    rows = read_results(file)
    wanted = {(address, name) for address, names in pairs.items() for name in names}
    return rows[[pair in wanted for pair in zip(rows["address"], rows["solver"], strict=True)]]


def answers(rows: pd.DataFrame, tolerance: float) -> set[tuple[str, str]]:
    """(address, solver) of the answers that are within the tolerance."""
    if rows.empty:
        return set()
    verified = rows["status"].isin(VERIFIED) & (rows["tolerance"] <= tolerance)
    good = rows[verified | (rows["error"] <= tolerance) & ~rows["status"].isin(LATE)]
    return set(zip(good["address"], good["solver"], strict=True))


def rest(rows: pd.DataFrame, names: Sequence[str], tolerance: float) -> dict[str, list[str]]:
    """By address, the solvers that take the problem and have no answer at this tolerance."""
    done = answers(rows, tolerance)
    open_ = rows[(rows["status"] != "unsupported") & rows["solver"].isin(names)]
    pairs = dict.fromkeys(zip(open_["address"], open_["solver"], strict=True))
    found: dict[str, list[str]] = {}
    for address, name in pairs:
        if (address, name) not in done:
            found.setdefault(address, []).append(name)
    return found


def ranking(rows: pd.DataFrame, names: Sequence[str], tolerances: Sequence[float]) -> list[str]:
    """Who solves most of all tolerances first; the name decides between equals."""
    counts = dict.fromkeys(names, 0)
    for tolerance in tolerances:
        for _, name in answers(rows, tolerance):
            counts[name] += 1
    return sorted(names, key=lambda name: (-counts[name], name))


def asked_in_turn(
    addresses: Sequence[str],
    names: Sequence[str],
    tolerances: Sequence[float],
    limits: tuple[float, float],
    best: int,
    stem: Path,
) -> pd.DataFrame:
    """All rows: everybody, finest tolerance first, with the first limit; then a few again with the second, if any."""
    rows = pd.DataFrame()
    for seconds in limits:
        if not seconds:
            continue
        chosen: Sequence[str] = names
        if not rows.empty:
            automatic = [name for name in names if name.startswith("auto-")]
            others = [name for name in ranking(rows, names, tolerances) if name not in automatic]
            chosen = [*automatic, *others[:best]]
        for tolerance in sorted(tolerances):
            pairs = dict.fromkeys(addresses, names) if rows.empty else rest(rows, chosen, tolerance)
            file = stem.with_name(f"{stem.name}-{tolerance:g}-{seconds:g}s.sqlite")
            rows = pd.concat([part for part in (rows, asked(pairs, tolerance, seconds, file)) if not part.empty])
    return rows


def table(title: str, rows: pd.DataFrame, names: Sequence[str], tolerances: Sequence[float]) -> None:
    solved = {t: answers(rows, t) for t in tolerances}
    count = {t: {name: sum(name == who for _, who in solved[t]) for name in names} for t in tolerances}
    addresses = sorted(set(rows["address"]))
    automatic = [name for name in names if name.startswith("auto-")]
    at = ", ".join(f"{t:g}" for t in tolerances)
    print(f"\n{title}: {len(addresses)} different problems, {len(names)} solvers; solved at {at}")
    for auto in automatic:
        ahead = [(t, n) for t in tolerances for n in names if count[t][n] > count[t][auto]]
        for t, name in ahead:
            print(f"  LOSS at {t:g}: {name} solves {count[t][name]}, {auto} {count[t][auto]}")
        if not ahead:
            print(f"  no single solver solves more than {auto}: {' / '.join(str(count[t][auto]) for t in tolerances)}")
    ordered = ranking(rows, names, tolerances)
    for family in ("siconos-", ""):
        best = next((n for n in ordered if n.startswith(family) and n not in automatic), None)
        if best is not None:
            told = " / ".join(str(count[t][best]) for t in tolerances)
            print(f"  best {'of Siconos' if family else 'single solver'}: {best} {told}")
    heads = "".join(f"{t:>8.0e}" for t in tolerances) + "".join(f"{w:>12s}" for w in WORDS)
    print(f"  {'':32s}{heads}  seconds")
    first = rows[rows["tolerance"] == min(tolerances)].drop_duplicates(["address", "solver"], keep="last")
    for name in ordered:
        own = first[first["solver"] == name]
        counts = "".join(f"{count[t][name]:8d}" for t in tolerances)
        statuses = "".join(f"{(own['status'] == word).sum():12d}" for word in WORDS)
        seconds = rows[rows["solver"] == name][["setup", "solve"]].sum().sum()
        print(f"  {name:32s}{counts}{statuses}{seconds:9.2f}")
    print(f"  {'any of them':32s}" + "".join(f"{len({a for a, _ in solved[t]}):8d}" for t in tolerances))
    for t in tolerances:
        for address in addresses:
            who = [name for name in ordered if (address, name) in solved[t]]
            if any(name not in who for name in automatic) or not who:
                told = ", ".join(who[:NAMED]) + (f" and {len(who) - NAMED} more" if len(who) > NAMED else "")
                print(f"  at {t:g}, {Path(address).name}: {told or 'nobody'}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("nodes", nargs="+", metavar="NODE")
    parser.add_argument("-o", dest="output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--in", dest="folders", nargs="+", default=["builtin"], metavar="FOLDER")
    parser.add_argument("--of", nargs="+", default=[], metavar="NODE")
    parser.add_argument("--only", nargs="+", default=["*"], metavar="GLOB", help="names of files")
    parser.add_argument("--solvers", nargs="+", default=["*"], metavar="GLOB")
    parser.add_argument("--without", nargs="+", default=[], metavar="GLOB")
    parser.add_argument("--tolerances", default="1e-4,1e-8")
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--again", type=float, default=20.0)
    parser.add_argument("--best", type=int, default=5)
    parser.add_argument("--largest", type=int, default=5000, help="unknowns")
    given = parser.parse_args()
    tolerances = sorted({float(text) for text in given.tolerances.split(",")}, reverse=True)
    given.output.mkdir(parents=True, exist_ok=True)
    for node in given.nodes:
        names = [
            s.spec.name
            for s in solvers
            if s.spec.node == node
            and any(fnmatch(s.spec.name, glob) for glob in given.solvers)
            and not any(fnmatch(s.spec.name, glob) for glob in given.without)
            and s.availability().ok
        ]
        addresses = list(problems(given.of or [node], given.folders, given.only, given.largest))
        if not names or not addresses:
            print(f"\n{node}: {len(addresses)} problems, {len(names)} solvers, nothing to run")
            continue
        rows = asked_in_turn(
            addresses, names, tolerances, (given.seconds, given.again), given.best, given.output / node
        )
        title = node if not given.of else f"{node}, problems of {', '.join(given.of)}"
        table(title, rows, names, tolerances)


if __name__ == "__main__":
    main()
