"""Times of the native solvers beside those of Siconos on the same data, one thread, both judged by us.

    python tests/bench/native_vs_siconos.py [--python /usr/bin/python3] [CONTACT_FILE.dat ...]

Siconos lives in the system's Python (NumPy 1): the script starts itself there and talks to it through .npz files. A
time is the least of several solves in the warm process, without set-up of the problem on either side, and the final
check of the native solvers included. A row says who solved; a ratio stands only where both did.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

TOLERANCE = 1e-8
CONTACT_TOLERANCE = 1e-4
SWEEPS = 20_000
REPEATS = 5
LCP_PAIRS = {
    "lemke": ("SICONOS_LCP_LEMKE", "lcp_lexicolemke"),
    "bpp": ("SICONOS_LCP_NEWTONMIN", "lcp_newton_min"),
    "newton-min": ("SICONOS_LCP_NEWTON_MIN_FBLSA", "lcp_newton_minFB"),
    "pgs": ("SICONOS_LCP_PGS", "lcp_pgs"),
}


def least_time(solve: Callable[[], object]) -> float:
    """Seconds of the fastest of REPEATS solves, after one that is not counted."""
    solve()
    times: list[float] = []
    for _ in range(REPEATS):
        before = time.perf_counter()
        solve()
        times.append(time.perf_counter() - before)
    return min(times)


def problems() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Random LCPs: symmetric positive definite, nonsymmetric positive definite, PSD of rank 0.6 n and feasible."""
    made: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for n in (10, 50, 200, 1000):
        rng = np.random.default_rng(n)
        A, B = rng.standard_normal((2, n, n))
        G = rng.standard_normal((n, max(2, 6 * n // 10)))
        made[f"pd-{n}"] = (A @ A.T / n + np.eye(n), rng.standard_normal(n))
        made[f"nonsymmetric-{n}"] = (
            A @ A.T / n + 0.1 * np.eye(n) + (B - B.T) / math.sqrt(n),
            rng.standard_normal(n),
        )
        made[f"psd-{n}"] = (G @ G.T, G @ rng.standard_normal(G.shape[1]) + 0.05 * abs(rng.standard_normal(n)))
    return made


def siconos_side(folder: Path, contact_files: list[str]) -> None:
    """Runs under the system's Python: solves everything in `folder`, leaves answers and times there."""
    import siconos.numerics as sn

    sn.numerics_set_verbose(0)
    times: dict[str, float] = {}
    answers: dict[str, np.ndarray] = {}
    for path in sorted(folder.glob("lcp-*.npz")):
        data = np.load(path)
        problem = sn.LCP(data["M"], data["q"])
        n = data["q"].size
        for native, (identifier, function) in LCP_PAIRS.items():
            z, w = np.zeros(n), np.zeros(n)

            def solve(z=z, w=w, problem=problem, identifier=identifier, function=function):
                z[:] = 0
                w[:] = 0
                options = sn.SolverOptions(getattr(sn, identifier))
                options.dparam[0], options.iparam[0] = TOLERANCE, SWEEPS
                getattr(sn, function)(problem, z, w, options)

            key = f"{path.stem[4:]}/{native}"
            times[key], answers[key] = least_time(solve), z
    for file in contact_files:
        problem = sn.frictionContact_new_from_filename(file)
        size = problem.dimension * problem.numberOfContacts
        r, u = np.zeros(size), np.zeros(size)

        def solve(r=r, u=u, problem=problem):
            r[:] = 0
            u[:] = 0
            options = sn.SolverOptions(sn.SICONOS_FRICTION_3D_NSGS)
            options.dparam[0], options.iparam[0] = CONTACT_TOLERANCE, SWEEPS
            sn.fc3d_nsgs(problem, r, u, options)

        key = f"{Path(file).stem}/nsgs"
        times[key], answers[key] = least_time(solve), r
    np.savez(folder / "answers.npz", **{k.replace("/", "|"): v for k, v in answers.items()})
    (folder / "times.json").write_text(json.dumps(times))


def main(python: str, contact_files: list[str]) -> None:
    from cpbench import storage
    from cpbench.formulations import LCP, FCPoint, LCPPoint
    from cpbench.solvers import Budget, solvers
    from cpbench.verification import judge

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        asked = {key: LCP(M=M, q=q) for key, (M, q) in problems().items()}
        for key, problem in asked.items():
            np.savez(folder / f"lcp-{key}.npz", M=np.asfortranarray(problem.M), q=problem.q)
        subprocess.run([python, __file__, "--siconos", name, *contact_files], check=True, stdout=subprocess.DEVNULL)
        times = json.loads((folder / "times.json").read_text())
        answers = {k.replace("|", "/"): v for k, v in np.load(folder / "answers.npz").items()}
    asked |= {Path(file).stem: storage.load(file) for file in contact_files}
    print(f"{'problem':32s} {'solver':11s} {'siconos':>12s} {'native':>12s} {'ratio':>8s}")
    ratios: dict[str, list[float]] = {}
    for key, theirs in times.items():
        label, native = key.rsplit("/", 1)
        problem, solver = asked[label], solvers.get(native)
        if solver.obstacle(problem) is not None:
            continue
        tolerance = CONTACT_TOLERANCE if native == "nsgs" else TOLERANCE
        options = solver.spec.options()
        budget = Budget(tolerance=tolerance, iterations=SWEEPS if native in ("pgs", "nsgs") else None)
        prepared = solver.setup(problem, budget, options)
        ours = least_time(lambda s=solver, p=prepared, b=budget, o=options: s.solve(p, b, o))
        point = solver.solve(prepared, budget, options).point
        their_point = FCPoint(r=answers[key]) if native == "nsgs" else LCPPoint(z=answers[key])
        # their stopping test is the natural residual, so that is what they are judged by
        we = point is not None and judge(problem, point, tolerance).solved
        they = judge(problem, their_point, tolerance, "natural").solved
        ratio = theirs / ours if we and they else math.nan
        if we and they:
            ratios.setdefault(native, []).append(ratio)
        shown = [f"{1e3 * t:9.3f} ms" if ok else "not solved" for t, ok in ((theirs, they), (ours, we))]
        print(f"{label:32s} {native:11s} {shown[0]:>12s} {shown[1]:>12s} {ratio:8.2f}")
    for native, found in ratios.items():
        mean = math.exp(float(np.mean(np.log(found))))
        print(f"{native}: geometric mean {mean:.1f}, least {min(found):.2f}, most {max(found):.1f} ({len(found)} rows)")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("contact_files", nargs="*")
    parser.add_argument("--python", default="/usr/bin/python3", help="the interpreter that has siconos")
    parser.add_argument("--siconos", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.siconos:
        siconos_side(Path(arguments.siconos), arguments.contact_files)
    else:
        sys.exit(main(arguments.python, arguments.contact_files))
