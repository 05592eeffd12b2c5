"""Collects answers of many solvers to the real QPs, with references, into a folder that other scripts read.

python tests/truth/collect.py --cache FOLDER [--seconds 3] [--budget 900] [NAME ...]
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import qp_backends
import qp_references
import real_files
from kept_answers import packed, write
from qp_literature import Reference, literature


def collect(problem: Any, seconds: float) -> tuple[list[tuple[str, Any]], Reference | None]:
    """Return the different answers to a QP, labelled, and its reference."""
    answers: list[tuple[str, Any]] = []
    seen: set[bytes] = set()
    for label, point in qp_backends.answers(problem, seconds):
        key = packed(point).tobytes()
        if key not in seen:
            seen.add(key)
            answers.append((label, point))
    numbers = [(label, point, literature(problem, point)) for label, point in answers]
    return answers, qp_references.agreed(problem, numbers)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="problems; all where none is named")
    parser.add_argument("--cache", type=Path, required=True, help="the folder to write")
    parser.add_argument("--seconds", type=float, default=3.0, help="time of each method's iterates on a problem [s]")
    parser.add_argument("--budget", type=float, default=900.0, help="time after which no problem is begun [s]")
    given = parser.parse_args()
    given.cache.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    for name, problem in real_files.convex_qps(given.names):
        file = given.cache / f"{name}.npz"
        if file.exists() and not given.names:
            continue
        if time.perf_counter() - start > given.budget:
            print("time is over at", name)
            break
        begun = time.perf_counter()
        answers, reference = collect(problem, given.seconds)
        if answers:
            write(file, answers, reference)
        source = reference.source if reference else "none"
        print(
            f"{name:24} {len(answers):4} answers, reference: {source}, {time.perf_counter() - begun:.1f} s", flush=True
        )


if __name__ == "__main__":
    main()
