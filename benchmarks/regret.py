"""The regret of the automatic choices on problems that nobody has seen: their time over that of the best solver.

    python benchmarks/regret.py [--seed now|NUMBER] [--minutes 20] [--families GLOB ...] [--solvers GLOB ...]
        [--seconds 2] [--largest 120] [--tolerance 1e-8] [--batch 10] [-o FOLDER]

Draws problems of every family of `tests/truth/unseen.py` at random, the seed from the clock unless it is given, writes
them to files and has every native solver of their formulation and every installed rival run on them as `cpbench run`
does: in a process of its own, each answer judged. Rounds of `--batch` problems a family until the minutes are over;
with `-o` the same command with the same seed goes on where it was cut.

Members are the native solvers of the formulation, rivals all others; those that solve another problem (relaxations,
facets) and those that start a program for every solve take no part. Times are those of `setup` and `solve` together.
Where `auto` solves a problem, others get 20 times its time, in steps from 0.25 s on (`MULTIPLE`, `STEPS`), at most
`--seconds`: whoever is later has lost, and counts as not solved, so that a mean speed against rivals is of those that
came. What is done is printed, and written to `regret.log` in the folder, after each part.

Printed are, a formulation: problems that a member or rival solves and `auto` does not, each by name; the regret (time
of `auto` over that of the best member, known only afterwards): median, 95 % quantile, worst; the speed against the best
rival: geometric mean, share of problems above 10 µs on which `auto` is at least as fast; then the ten worst of all.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Iterator
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pandas as pd

import cpbench
from cpbench.solvers.base import Trait, solvers
from cpbench.verification import VERIFIED

sys.path.append(str(Path(__file__).parents[1] / "tests" / "truth"))
import unseen

SHORTEST = 1e-5
"""Rivals' times below [s] are those of a call rather than of a method."""
MULTIPLE = 20.0
"""Of the time of `auto`, that others get where it solves a problem: who needs more has lost."""
STEPS = (0.25, 1.0)
"""Their limits in steps [s], for a run has one; below the first, more time goes into killing a process and starting
another than into the solve."""


def draw(seed: int, batch: int, many: int, families: list[str], largest: int, folder: Path) -> Iterator[Path]:
    """Write the problems of one round, `many` a family, sizes uniform in their logarithm, and yield their files."""
    for family in families:
        for k in range(batch * many, (batch + 1) * many):
            path = folder / f"{family}-{k}.h5"
            if not path.exists():
                rng = np.random.default_rng([seed, zlib.crc32(family.encode()), k])
                cpbench.save(unseen.FAMILIES[family](rng, int(np.exp(rng.uniform(0, np.log(largest))) + 0.5)), path)
            yield path


def takes_part(name: str, globs: list[str]) -> bool:
    """Whether a solver is asked: by default all but those that start a program a solve, whose time is the start's, and
    those that solve another problem."""
    spec = solvers.get(name).spec
    return (
        any(fnmatch(name, glob) for glob in globs)
        and not name.startswith("gams-")
        and Trait.LAUNCHES not in spec.traits
        and spec.kind.exact
    )


def measured(files: list[Path], options: argparse.Namespace, out: Path, say: Callable[[str], None]) -> pd.DataFrame:
    """Run all solvers of each formulation on its problems and return the rows; `say` what is done after each part.

    `auto` is asked alone first: others get `MULTIPLE` times the time that it took, in steps, and beside them, in random
    order, it is measured again.
    """
    by_node: dict[str, list[Path]] = {}
    for path in files:
        by_node.setdefault(cpbench.load(path).node, []).append(path)
    tables: list[pd.DataFrame] = []
    for node, paths in by_node.items():
        listed = cpbench.list_solvers(node=node, available=True)
        names = [s.name for s in listed if takes_part(s.name, options.solvers)]
        auto = [name for name in names if name.startswith("auto-")]
        alone = _run(paths, auto, options.seconds, options, out / f"{node}-auto.sqlite")
        for limit, some in by_limit(alone, paths, options.seconds).items():
            begun = time.monotonic()
            rows = _run(some, names, limit, options, out / f"{node}-{limit:g}s.sqlite")
            tables.append(rows.assign(seconds=limit))
            late = int((rows["status"] == "timeout").sum())
            say(
                f"{node}: {len(some)} problems x {len(names)} solvers within {limit:g} s: {len(rows)} rows, {late} "
                f"late, {time.monotonic() - begun:.0f} s, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
            )
        own = pd.concat([rows for rows in tables if len(rows) and rows["node"].iloc[0] == node])
        say(report(regrets(own)))
    return pd.concat(tables)


def _run(paths: list[Path], names: list[str], seconds: float, options: argparse.Namespace, out: Path) -> pd.DataFrame:
    texts = [str(path) for path in paths]
    return cpbench.run(texts, names, tolerance=options.tolerance, seconds=seconds, out=out, routes="exact").frame


def by_limit(alone: pd.DataFrame, paths: list[Path], most: float) -> dict[float, list[Path]]:
    """Return the problems by the limit of those who race with `auto`: `most` where it does not solve them."""
    good = alone[alone["status"].isin(VERIFIED)]
    took = {str(address): time for address, time in zip(good["address"], good["setup"] + good["solve"], strict=True)}
    files: dict[float, list[Path]] = {}
    for path in paths:
        wanted = MULTIPLE * took.get(str(path), np.inf)
        limit = next((step for step in STEPS if step >= wanted and step < most), most)
        files.setdefault(limit, []).append(path)
    return dict(sorted(files.items()))


def regrets(rows: pd.DataFrame) -> pd.DataFrame:
    """Return a row a problem: times of `auto`, of the best member and of the best rival [s], NaN where not verified."""
    rows = rows.assign(time=rows["setup"] + rows["solve"])
    rows = rows.assign(verified=rows["status"].isin(VERIFIED), short=rows["solver"].str.partition("[")[0])
    native = {name: solvers.get(name).spec.licence == "Apache-2.0" and _is_native(name) for name in set(rows["short"])}
    rows["native"] = rows["short"].map(native)
    rows["auto"] = rows["short"].str.startswith("auto-")
    table = []
    for problem, group in rows.groupby("problem"):
        good = group[group["verified"]]
        auto = good[good["auto"]]["time"].min()
        members, rivals = good[good["native"] & ~good["auto"]], good[~good["native"]]
        best, rival = _fastest(members), _fastest(rivals)
        asked = group[group["auto"]]
        table.append(
            {
                "problem": Path(str(problem)).stem,
                "node": group["node"].iloc[0],
                "auto": auto,
                "member": best[0],
                "best member": best[1],
                "rival": rival[0],
                "best rival": rival[1],
                "status": asked["status"].iloc[0] if len(asked) else "",
                "spent": asked["time"].iloc[0] if len(asked) else np.nan,
            }
        )
    return pd.DataFrame(table)


def _is_native(name: str) -> bool:
    return type(solvers.get(name)).__module__.startswith("cpbench_solvers.")


def _fastest(rows: pd.DataFrame) -> tuple[float, str]:
    if rows.empty:
        return np.nan, ""
    first = rows.loc[rows["time"].idxmin()]
    return float(first["time"]), str(first["solver"])


def quantiles(both: pd.DataFrame) -> str:
    """Return quantiles of the time of `auto` over that of the best member, in words."""
    q = (both["auto"] / both["member"]).quantile([0.5, 0.95, 1.0]).to_list()
    return f"median {q[0]:.2f}, 95 % {q[1]:.2f}, worst {q[2]:.1f}"


def report(table: pd.DataFrame) -> str:
    """Return what is printed."""
    lines = []
    for node, group in table.groupby("node"):
        solved = group["auto"].notna()
        ever = group["member"].notna() | group["rival"].notna() | solved
        lines.append(f"{node}: {len(group)} problems, {ever.sum()} solved by anybody, {solved.sum()} by auto")
        for _, row in group[ever & ~solved].iterrows():
            ratios = [(row[k], row[f"best {k}"]) for k in ("member", "rival") if row[k] == row[k]]
            others = " and ".join(f"{name} {took:.3g} s" for took, name in ratios)
            lines.append(f"  not by auto: {row['problem']} ({row['status']}, {row['spent']:.3g} s), {others}")
        both = group[solved & group["member"].notna()]
        if len(both):
            lines.append(f"  over the best member: {quantiles(both)}")
        both = group[solved & group["rival"].notna()]
        if len(both):
            speed = both["rival"] / both["auto"]
            above = speed[both["rival"] > SHORTEST]
            share = (above >= 1).mean() if len(above) else np.nan
            lines.append(
                f"  against the best rival: {np.exp(np.log(speed).mean()):.2f} times as fast in geometric mean,"
                f" at least as fast on {share:.0%} of {len(above)} above 10 µs, least {speed.min():.3g}"
            )
    both = table[table["auto"].notna() & table["member"].notna()]
    if len(both):
        lines.append(f"all: {len(table)} problems, over the best member: {quantiles(both)}")
    worst = both.assign(regret=both["auto"] / both["member"]).nlargest(10, "regret")
    lines.append("the ten worst:")
    lines += [
        f"  {r['regret']:6.1f}  {r['problem']}: {r['auto']:.3g} s, {r['best member']} {r['member']:.3g} s"
        for _, r in worst.iterrows()
    ]
    return "\n".join(lines)


def main() -> None:
    """Run rounds until the time is over, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", default="now")
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--families", nargs="*", default=["*"])
    parser.add_argument("--solvers", nargs="*", default=["*"])
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--largest", type=int, default=120)
    parser.add_argument("--tolerance", type=float, default=1e-8)
    parser.add_argument("--batch", type=int, default=10)
    parser.add_argument("-o", "--out")
    options = parser.parse_args()
    seed = time.time_ns() % 2**32 if options.seed == "now" else int(options.seed)
    families = [name for name in unseen.FAMILIES if any(fnmatch(name, glob) for glob in options.families)]
    end = time.monotonic() + 60 * options.minutes
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(options.out or scratch)
        out.mkdir(parents=True, exist_ok=True)

        def say(text: str) -> None:
            print(text, flush=True)
            with (out / "regret.log").open("a") as log:
                log.write(text + "\n")

        say(f"seed {seed}, {len(families)} families, others within {MULTIPLE:g} times auto, {STEPS[0]} s at least")
        rows: list[pd.DataFrame] = []
        batch = 0
        while True:
            files = list(draw(seed, batch, options.batch, families, options.largest, out))
            place = out / f"round-{batch}"
            place.mkdir(exist_ok=True)
            rows.append(measured(files, options, place, say))
            batch += 1
            table = regrets(pd.concat(rows))
            say(f"round {batch}: {len(table)} problems")
            if time.monotonic() > end:
                break
        say(report(table))


if __name__ == "__main__":
    main()
