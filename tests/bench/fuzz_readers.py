"""Mutants of files of every reader: each is refused in one line or is a problem, soon, and none is another problem.

Files of each reader are damaged in their bytes, in pieces of their text, and (named arrays) in their names, shapes and
types. What is read must come back from HDF5 as it is; the problem of named arrays must change when an entry of any of
them does; that of an MPS file must be the one that HiGHS reads, where it reads one without a warning.

    python tests/bench/fuzz_readers.py --minutes 10 [--seed 0] [--only mps]... [--keep FOLDER]
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "unit"))

import fuzz_seeds
from damage import read_or_refused, rearranged, spoiled

from cpbench import storage
from cpbench.formulations.base import Problem
from cpbench.storage.arrays import read_array

BATCH, HANGS = 100, 90.0
"""Mutants of one process; seconds after which one of them hangs, whatever it is in."""
CUTS = (r"(?<=\n)", r"(\s)", r"(?s)(?=.)", r"(?<=[0-9.eE+-])(?=[^0-9.eE+-])")
LETTERS = "0123456789.-+*/=()[]{}\"';:,eExXnNqRGLE \n\t\x00\xff"


def read(path: Path) -> Any:
    """Return the problem of a file, or the array of one that holds only that."""
    if path.suffix in (".npy", ".mtx", ".csv"):
        return read_array(path)
    problem = storage.load(path)
    again = path.parent / "again.h5"
    storage.save(problem, again, force=True)
    if storage.load(again).fingerprint != problem.fingerprint:
        raise AssertionError("comes back from HDF5 as another problem")
    return problem


def mutants(name: str, whole: bytes, binary: bool, draw: random.Random) -> bytes:
    """Return a damaged file."""
    if binary or draw.random() < 0.3:
        return spoiled(whole, draw)
    return rearranged(whole.decode("latin-1"), draw, CUTS, LETTERS).encode("latin-1")


def _nothing(problem: Problem, path: Path) -> None:
    """Check no more."""


def batch(reader: str, seed: str, folder: Path, counts: Counter[str], heartbeat: Path) -> Iterator[tuple[str, Path]]:
    """Try one batch of mutants; yields what is wrong, with the file."""
    draw = random.Random(seed)
    files = fuzz_seeds.FILES[reader](folder) if reader in fuzz_seeds.FILES else []
    for number in range(BATCH):
        heartbeat.write_text(str(number))
        if reader == "arrays" and draw.random() < 0.7:
            case = fuzz_seeds.ArrayMutant(draw)
            path = case.write(folder / f"m{case.suffix}")
            check: Callable[[Problem, Path], None] = case.require_every_array
        else:
            name, whole = draw.choice(files)
            path = folder / name
            binary = path.suffix in (".npz", ".mat", ".h5", ".hdf5", ".npy", ".gz")
            path.write_bytes(mutants(name, whole, binary, draw))
            check = fuzz_seeds.require_highs if reader == "mps" and path.suffix == ".mps" else _nothing
        try:
            found = read_or_refused(lambda path=path: read(path))
            counts["refused" if found is None else "read"] += 1
            if isinstance(found, Problem):
                check(found, path)
        except Exception:
            yield traceback.format_exc(), path


def child(reader: str, seed: str, folder: Path, keep: Path) -> None:
    """Run one batch, in a process of its own; its counts are left in a file."""
    counts: Counter[str] = Counter()
    for what, path in batch(reader, seed, folder, counts, folder / "beat"):
        counts["wrong"] += 1
        print(f"{reader} {seed}: {what}", flush=True)
        kept = keep / f"{reader}-{seed.replace(' ', '-')}-{counts['wrong']}{path.suffix}"
        (shutil.copytree if path.is_dir() else shutil.copy)(path, kept)
    (folder / "counts.json").write_text(json.dumps(counts))


def watched(reader: str, seed: str, keep: Path) -> Counter[str]:
    """Return the counts of a batch, which may die or hang."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "beat").write_text("")
        pid = os.fork()
        if pid == 0:
            try:
                child(reader, seed, folder, keep)
            except BaseException:
                traceback.print_exc()
                os._exit(1)
            os._exit(0)
        while not (ended := os.waitpid(pid, os.WNOHANG))[0]:
            time.sleep(0.05)
            if time.time() - (folder / "beat").stat().st_mtime > HANGS:
                os.kill(pid, signal.SIGKILL)
        if (folder / "counts.json").exists():
            return Counter(json.loads((folder / "counts.json").read_text()))
        last = (folder / "beat").read_text()
        print(f"{reader} {seed}: the process ended by {ended[1]} at mutant {last}", flush=True)
        shutil.copytree(folder, keep / f"{reader}-{seed.replace(' ', '-')}-died", dirs_exist_ok=True)
        return Counter({"wrong": 1})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0, help="of each reader")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", action="append", choices=fuzz_seeds.READERS)
    parser.add_argument("--keep", type=Path, default=None, help="a folder for the files that go wrong")
    asked = parser.parse_args()
    keep = asked.keep or Path(tempfile.mkdtemp())
    keep.mkdir(exist_ok=True)
    wrong = 0
    for reader in asked.only or fuzz_seeds.READERS:
        counts, end, number = Counter[str](), time.monotonic() + 60 * asked.minutes, 0
        while time.monotonic() < end:
            counts += watched(reader, f"{asked.seed} {number}", keep)
            number += 1
        wrong += counts["wrong"]
        outcome = ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))
        print(f"{reader}: {counts.total()} mutants in {asked.minutes:g} min: {outcome}", flush=True)
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
