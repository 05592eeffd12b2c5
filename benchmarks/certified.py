"""How many verified answers are proved or enclosed, by formulation, with times and what stops the others.

    python benchmarks/certified.py [builtin | FILE | FOLDER ...] [--nodes lcp,mlcp,...] [--largest 500]
        [--contacts 100] [--seconds 60] [--check] [--save problems/proofs.toml]

Every problem is solved in this process, as `cpbench certify` does: by the automatic choice and, where its answer is not
proved, by other solvers of its formulation (`cpbench_lab.certifying.certify_first`). Times are of the solves and the
proof together, of this processor [s]. With --check, every certificate is proved again by the
program without cpbench. With --save, what is proved is written by fingerprint into the file that the catalogue of the
collection reads; what is there of other problems is kept.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np

import cpbench_lab
from cpbench import storage
from cpbench.errors import CpbenchError
from cpbench.generators.collection import builtin_folder
from cpbench_lab.certifying import certify_first, save_certificate

NODES = "lcp,mlcp,relay,avi,qp,fc,fcm,gfc,ncp,micp,equation"
CHECKER = Path(cpbench_lab.__file__).parent / "certificates" / "checker"


def main() -> None:
    """Print a line a problem, then a line a formulation."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="*", default=["builtin"])
    parser.add_argument("--nodes", default=NODES)
    parser.add_argument("--largest", type=int, default=500, help="unknowns of other problems than contact")
    parser.add_argument("--contacts", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--save", type=Path)
    asked = parser.parse_args()
    proofs: dict[str, str] = {}
    rows: dict[str, list[tuple[str, float, str]]] = defaultdict(list)
    for address in storage.problem_files([str(builtin_folder()) if p == "builtin" else p for p in asked.paths]):
        try:
            problem: Any = storage.load(address)
        except CpbenchError:
            continue
        many = problem.nc > asked.contacts if hasattr(problem, "nc") else unknowns(problem) > asked.largest
        if problem.node not in asked.nodes.split(",") or many:
            continue
        began = time.process_time()
        try:
            answer, certificate = certify_first(problem, asked.seconds)
        except CpbenchError as error:
            print(f"{address}: {error}", flush=True)
            continue
        seconds = time.process_time() - began
        if certificate:
            proofs[problem.fingerprint] = certificate.level if answer is not None else f"{certificate.level}, proved"
        if asked.save:
            save(proofs, asked.save)  # now: the rest may be interrupted
        level = certificate.level
        if certificate and asked.check:
            level += "" if checked(certificate, problem) else ", NOT CHECKED"
        kind = problem.node
        if hasattr(problem, "nc"):
            kind += " 2D" if problem.dimension == 2 else " 3D" if problem.mu.any() else " frictionless"
        rows[kind].append((level, seconds, certificate.reason))
        told = certificate.reason or ("" if answer is None else f"within {certificate.distance:.2g}")
        print(f"{address} ({kind}): {level}, {seconds:.2f} s, {told} {certificate.unique}".rstrip(" ,"), flush=True)
    table(rows)
    if asked.save:
        save(proofs, asked.save)


def save(proofs: dict[str, str], path: Path) -> None:
    """Write what is proved, by fingerprint, beside what the file has of other problems."""
    before = tomllib.loads(path.read_text("utf-8")) if path.exists() else {}
    lines = [f'{fingerprint} = "{level}"' for fingerprint, level in sorted({**before, **proofs}.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def unknowns(problem: Any) -> int:
    """Unknowns, without multipliers."""
    sizes = problem.point_sizes
    return sizes["z"] if "z" in sizes else sum(sizes.values())


def checked(certificate: Any, problem: Any) -> bool:
    """Whether the program without cpbench proves it again."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "certificate.h5"
        save_certificate(certificate, problem, path)
        return subprocess.run([sys.executable, CHECKER, path], capture_output=True, check=False).returncode == 0


def table(rows: dict[str, list[tuple[str, float, str]]]) -> None:
    """Print what each formulation has."""
    print(
        f"\n{'formulation':<18}{'verified':>9}{'proved':>8}{'enclosed':>9}{'share':>7}{'median s':>10}{'largest s':>10}"
    )
    for kind, own in sorted(rows.items()):
        levels = Counter(level for level, _, _ in own)
        seconds = [s for _, s, _ in own]
        certain = levels["proved"] + levels["enclosed"]
        print(
            f"{kind:<18}{len(own):>9}{levels['proved']:>8}{levels['enclosed']:>9}{certain / len(own):>7.0%}"
            f"{np.median(seconds):>10.3f}{max(seconds):>10.2f}"
        )


if __name__ == "__main__":
    main()
