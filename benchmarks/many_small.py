"""How many small problems a second: `cpbench.solve_many` on stacks, and Siconos in a loop over the same problems.

    python benchmarks/many_small.py [--python /usr/bin/python3] [--count 100000] [--sets lcp,contacts,mlcp,qp]

The sets: LCPs of 6 unknowns, boxes that land on their 4 corners (12 reactions of one body, so that W has rank 6), MLCPs
of 3 free unknowns and 4 pairs, QPs of 5 unknowns, 4 rows, an equality and bounds. Every answer is measured, Siconos'
by the same verdict as ours. `solve` is the compiled call alone, `judged` all of it: call, verdicts, and what went to
the automatic choice one by one. One thread on one core in processor time; two threads in wall time, which says
something where two cores are free. The median of ROUNDS is told.

Siconos lives in the system's Python and is called for FEWER of the problems, from a loop in Python over objects that
are made before; its solvers are asked for less and less until our verdict on nearly all of their answers is `solved`.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import one_race

FEWER = 2000
ROUNDS = 3
NEARLY = 0.999
"""The share of their answers that has to pass."""
FINER = (1.0, 0.1, 1e-2, 1e-3)
SICONOS = {
    "lcp": (("SICONOS_LCP_LEMKE", "lcp_lexicolemke"), ("SICONOS_LCP_PIVOT", "lcp_pivot")),
    "contacts": (("SICONOS_FRICTION_3D_NSGS", "fc3d_nsgs"), ("SICONOS_FRICTION_3D_NSN_AC", "fc3d_driver")),
}
TOLERANCES = {"lcp": 1e-8, "contacts": 1e-6, "mlcp": 1e-8, "qp": 1e-8}


def _definite(rng: np.random.Generator, count: int, n: int) -> Any:
    A = rng.standard_normal((count, n, n))
    return A @ A.transpose(0, 2, 1) / n + 0.1 * np.eye(n)


def lcps(rng: np.random.Generator, count: int) -> dict[str, Any]:
    """Random positive definite M."""
    return {"M": _definite(rng, count, 6), "q": rng.standard_normal((count, 6))}


def boxes(rng: np.random.Generator, count: int) -> dict[str, Any]:
    """Boxes of half a kilogram to two, 0.4 to 2 m long, that hit the ground with their four lower corners."""
    half, mass = rng.uniform(0.2, 1.0, (count, 3)), rng.uniform(0.5, 2.0, count)
    square = half * half
    inertia = mass[:, None] / 3.0 * (square[:, [1, 0, 0]] + square[:, [2, 2, 1]])
    inverse = np.concatenate([np.repeat(1.0 / mass[:, None], 3, axis=1), 1.0 / inertia], axis=1)
    fall = rng.standard_normal((count, 3)) * [1.0, 1.0, 0.5] - [0.0, 0.0, 0.3]
    velocity = np.concatenate([fall, 0.5 * rng.standard_normal((count, 3))], axis=1)
    H = np.zeros((count, 12, 6))
    for corner, sides in enumerate([(1, 1, -1), (1, -1, -1), (-1, -1, -1), (-1, 1, -1)]):
        arm = half * sides
        for row, axis in enumerate(np.eye(3)[[2, 0, 1]]):
            H[:, 3 * corner + row, :3] = axis
            H[:, 3 * corner + row, 3:] = np.cross(arm, axis)
    W = H * inverse[:, None, :] @ H.transpose(0, 2, 1)
    W = 0.5 * (W + W.transpose(0, 2, 1))
    return {"W": W, "q": np.einsum("kij,kj->ki", H, velocity), "mu": rng.uniform(0.1, 1.0, (count, 4))}


def mlcps(rng: np.random.Generator, count: int) -> dict[str, Any]:
    """Random positive definite [[A, C], [D, B]]."""
    K, k = _definite(rng, count, 7), rng.standard_normal((count, 7))
    blocks = {"A": K[:, :3, :3], "B": K[:, 3:, 3:], "C": K[:, :3, 3:], "D": K[:, 3:, :3]}
    return {**blocks, "a": k[:, :3], "b": k[:, 3:]}


def qps(rng: np.random.Generator, count: int) -> dict[str, Any]:
    """Random rows around a point, so that they are feasible."""
    A, C, z = (rng.standard_normal((count, *shape)) for shape in ((4, 5), (1, 5), (5,)))
    lb, ub = (np.where(rng.random((count, 5)) < 0.5, z + side, np.inf * side) for side in (-1.0, 1.0))
    b = np.einsum("kij,kj->ki", A, z) - rng.random((count, 4))
    rows = {"A": A, "b": b, "C": C, "d": np.einsum("kij,kj->ki", C, z), "lb": lb, "ub": ub}
    return {"Q": _definite(rng, count, 5), "p": 3.0 * rng.standard_normal((count, 5)), **rows}


MAKERS: dict[str, tuple[str, Callable[[np.random.Generator, int], dict[str, Any]]]] = {
    "lcp": ("LCP", lcps),
    "contacts": ("FrictionContact", boxes),
    "mlcp": ("MLCP", mlcps),
    "qp": ("QP", qps),
}


# ---------------------------------------------------------------- their side, under the system's Python


def serve(folder: Path, name: str, constant: str, function: str, tolerance: float) -> None:
    """Solve all problems of the set once and once more in time; the answers go to answers.npy."""
    import siconos.numerics as sn  # pyright: ignore[reportMissingImports]

    sn.numerics_set_verbose(0)
    data = dict(np.load(folder / f"{name}.npz"))
    count, n = data["q"].shape
    x, w = np.zeros((2, count, n))
    if name == "lcp":
        problems = [sn.LCP(data["M"][i], data["q"][i]) for i in range(count)]
    else:
        triples = zip(data["W"], data["q"], data["mu"], strict=True)
        problems = [sn.FrictionContactProblem(3, n // 3, W, q, mu) for W, q, mu in triples]
    call, seconds = getattr(sn, function), 0.0
    for _ in range(2):  # once to be warm
        options = [sn.SolverOptions(getattr(sn, constant)) for _ in range(count)]
        for option in options:  # solvers write into theirs
            option.dparam[0] = tolerance
        x[:] = w[:] = 0.0
        begun = time.process_time()
        for problem, answer, slack, option in zip(problems, x, w, options, strict=True):
            call(problem, answer, slack, option)
        seconds = time.process_time() - begun
    np.save(folder / "answers.npy", x)
    (folder / "seconds.json").write_text(json.dumps(seconds / count))


def theirs(python: str, name: str, stack: Any, data: dict[str, Any], tolerance: float) -> None:
    """Print problems per second of each of their solvers, at the first tolerance at which nearly all answers pass."""
    from cpbench.verification.stacked import judge_stack

    part = "z" if name == "lcp" else "r"
    with tempfile.TemporaryDirectory() as given:
        folder = Path(given)
        np.savez(folder / f"{name}.npz", **data)
        for constant, function in SICONOS[name]:
            for share in FINER:
                asked = [python, __file__, "--serve", given, name, constant, function, str(share * tolerance)]
                if subprocess.run(asked, capture_output=True, timeout=600, check=False).returncode != 0:
                    print(f"  {function:18s} ended with an error")
                    break
                verdicts = judge_stack(stack, {part: np.load(folder / "answers.npy")}, tolerance)
                seconds = json.loads((folder / "seconds.json").read_text())
                if verdicts.solved.mean() >= NEARLY or share == FINER[-1]:
                    passed = f"{int(verdicts.solved.sum())} of {len(verdicts.solved)} solved"
                    print(
                        f"  {function:18s} {1 / seconds:12,.0f} a second  {passed}, asked for {share * tolerance:.0e}"
                    )
                    break


# ---------------------------------------------------------------- our side


def ours(kind: Any, data: dict[str, Any], tolerance: float, threads: int) -> None:
    """Print problems per second of the compiled call, and with the verdicts."""
    import cpbench as cp
    from cpbench.solvers.base import automatic_solver, solvers

    stack = cp.solve_many(kind, tolerance=tolerance, **{key: a[:100] for key, a in data.items()}).stack  # warm
    clock = time.process_time if threads == 1 else time.perf_counter
    calls: list[float] = []
    whole: list[float] = []
    solutions = None
    for _ in range(ROUNDS):
        begun = clock()
        solutions = cp.solve_many(kind, tolerance=tolerance, threads=threads, **data)
        between = clock()
        stack, call = solutions.stack, solvers.get(automatic_solver(solutions.stack.kind.node)).stack_call
        call.solve(stack, call.shares[0] * tolerance, threads)
        whole.append((between - begun) / len(stack))
        calls.append((clock() - between) / len(stack))
    assert solutions is not None
    called, judged = (1.0 / statistics.median(times) for times in (calls, whole))
    print(
        f"  {threads} thread{'s' * (threads > 1)}: solve {called:12,.0f} a second, judged {judged:12,.0f}  {solutions}"
    )


def main(python: str, count: int, names: list[str]) -> None:
    import cpbench as cp

    for name in names:
        class_name, make = MAKERS[name]
        kind, tolerance, data = getattr(cp, class_name), TOLERANCES[name], make(np.random.default_rng(2026), count)
        print(f"{name}: {count:,} problems at {tolerance:g}", flush=True)
        ours(kind, data, tolerance, 1)
        with one_race.let_go():
            ours(kind, data, tolerance, 2)
        if name in SICONOS:
            some = {key: a[:FEWER] for key, a in data.items()}
            theirs(python, name, cp.solve_many(kind, tolerance=tolerance, **some).stack, some, tolerance)


if __name__ == "__main__":
    if "--serve" in sys.argv:
        folder, name, constant, function, tolerance = sys.argv[sys.argv.index("--serve") + 1 :]
        serve(Path(folder), name, constant, function, float(tolerance))
        sys.exit()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", default="/usr/bin/python3", help="the interpreter that has siconos")
    parser.add_argument("--count", type=int, default=100_000, help="problems of each set")
    parser.add_argument("--sets", default=",".join(MAKERS), help="of " + ", ".join(MAKERS))
    arguments = parser.parse_args()
    one_race.hold()
    main(arguments.python, arguments.count, arguments.sets.split(","))
