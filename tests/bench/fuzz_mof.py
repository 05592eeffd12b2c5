"""Mutated MathOptFormat: whatever a file says, it is a problem or one line of FormatError, soon and in little memory.

Valid models (written by us, and as JuMP writes them) are changed at random in their bytes and in their structure, and
read as files and as the maps of an HDF5 file. A crash is any exception but FormatError, a message of several lines,
more than 10 s of computing, more than 1 GB, or a problem that does not come back as itself when it is written again.

    python tests/bench/fuzz_mof.py --minutes 10 [--seed 0]
"""

from __future__ import annotations

import argparse
import copy
import json
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import LCP, MLCP, NCP, NLP, QP, MiCP
from cpbench.formulations.expressions import Map, from_mof, to_mof

SECONDS, BYTES = 10, 1_000_000_000
LONGEST = 4_000_000
"""Bytes of an input: what large ones take is known by their brackets."""
HOSTILE: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2**31, 2**63, -(2**64), 10**400, 0.0, -0.0, 1e308, float("nan"), float("inf"),
    float("-inf"), "", "z[1]", "x", "node", "gamma", "complex", "ifelse", "+", "^", "\ud800", "\x00", "a\nb", [], {},
    [[]], ["z[1]"], {"type": "node", "index": 1}, {"type": "node", "index": 10**30}, {"type": "real", "value": 1e999},
    {"type": "variable", "name": "z[2]"}, {"type": "+", "args": []}, {"type": [], "args": ["x"]},
    {"type": "complex", "real": 1.0, "imag": 2.0}, {"type": "ScalarNonlinearFunction", "root": 1.0, "node_list": []},
    {"type": "Complements", "dimension": 2}, {"type": "Parameter", "value": 1.0}, {"type": "Integer"},
)  # fmt: skip


def seeds(folder: Path) -> tuple[list[str], list[str]]:
    """Models, and models that hold maps."""
    z = ca.SX.sym("z", 4)
    F = Map.from_casadi(
        z,
        ca.vertcat(
            ca.exp(z[0]) * z[1] - 2, z[1] ** 2.5 + ca.if_else(z[2] < 1, z[3], ca.sqrt(ca.fabs(z[0]))),
            ca.fmin(z[0], z[3]) + z[2] * z[3], 2 * z[0] + 3 * z[1] - 1,
        ),
    )  # fmt: skip
    nu = ca.SX.sym("nu")
    G = Map.from_casadi(z, nu * ca.exp(z) - nu**2 + 2 * z, {"nu": 2.0})
    f = Map.from_casadi(z, ca.sumsqr(z) + ca.exp(z[0]))
    h = Map.from_casadi(z, ca.vertcat(z[0] + 2 * z[1] - 1, z[2] * z[3]))
    lb, ub = [0.0, -np.inf, -1.0, 0.0], [np.inf, np.inf, 1.0, np.inf]
    problems = [
        NCP(F=F, start=[1.0, 2.0, 3.0, 4.0]),
        NCP(F=G),
        MiCP(F=F, lb=lb, ub=ub),
        NLP(f=f, g=F, h=h, lb=lb, ub=ub, convex=False),
        LCP(M=np.eye(3), q=-np.ones(3)),
        MLCP(A=[[1.0]], B=[[2.0]], C=[[0.5]], D=[[0.0]], a=[1.0], b=[-1.0]),
        QP.build(np.eye(2), np.ones(2)),
    ]
    texts: list[str] = []
    for k, problem in enumerate(problems):
        storage.save(problem, folder / f"{k}.mof.json")
        texts.append((folder / f"{k}.mof.json").read_text())
    texts.append(json.dumps(_as_jump()))
    names = [f"z[{k}]" for k in range(1, 5)]
    return texts, [json.dumps(to_mof.model(maps, names)) for maps in ({"F": F, "g": h}, {"F": G})]


def _as_jump() -> dict[str, Any]:
    """Every operation an entry of node_list, which refers to entries before it."""
    nodes = [
        {"type": "*", "args": [2, "x"]},
        {"type": "sin", "args": ["x"]},
        {"type": "^", "args": [{"type": "node", "index": 2}, 2]},
        {"type": "+", "args": [{"type": "node", "index": 1}, {"type": "node", "index": 3}, "y"]},
    ]
    function = {"type": "ScalarNonlinearFunction", "root": {"type": "node", "index": 4}, "node_list": nodes}
    return {
        "name": "MathOptFormat Model",
        "version": {"major": 1, "minor": 7},
        "variables": [{"name": "x", "primal_start": 1}, {"name": "y"}],
        "objective": {"sense": "max", "function": function},
        "constraints": [
            {"name": "c1", "function": function, "set": {"type": "Interval", "lower": -1, "upper": 3.5}},
            {"function": {"type": "Variable", "name": "x"}, "set": {"type": "GreaterThan", "lower": 0}},
        ],
    }


class Mutant:
    """Texts at random from texts."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def of(self, text: str) -> bytes:
        if self.random.random() < 0.6:
            try:
                return self._structure(json.loads(text))
            except (RecursionError, ValueError):  # nested deeper, or a longer number, than can be written
                pass
        return self._bytes(text.encode())

    def _bytes(self, raw: bytes) -> bytes:
        data, pick = bytearray(raw), self.random
        for _ in range(pick.choice((1, 1, 2, 5, 20))):
            at = pick.randrange(len(data) + 1)
            kind = pick.randrange(6) if len(data) < LONGEST else 1
            if kind == 0 and data:
                data[at % len(data)] = pick.randrange(256)
            elif kind == 1:
                del data[at : at + pick.choice((1, 2, 10, 1000))]
            elif kind == 2:
                data[at:at] = pick.choice((b"[", b"{", b'"', b",", b"1e999", b"NaN", b"-Infinity", b"\\ud800", b"\x00"))
            elif kind == 3:
                data[at:at] = data[at : at + pick.choice((1, 10, 300))] * pick.choice((1, 2, 50))
            elif kind == 4:
                data[at:at] = pick.choice((b"[", b'{"a":', b'{"type":"-","args":[')) * pick.choice((10, 2000, 100_000))
            else:
                del data[at:]
        return bytes(data)

    def _structure(self, model: Any) -> bytes:
        pick = self.random
        for _ in range(pick.choice((1, 1, 1, 2, 4, 10))):
            places = self._places(model)
            parent, key = pick.choice(places)
            kind = pick.randrange(8)
            if kind <= 2:
                parent[key] = copy.deepcopy(pick.choice(HOSTILE))
            elif kind == 3:
                other, index = pick.choice(places)
                parent[key] = copy.deepcopy(other[index])
            elif kind == 4:
                del parent[key]
            elif kind == 5 and isinstance(parent, list) and len(parent) < 1000:
                parent[key:key] = parent[: pick.choice((1, 3, 100))] * pick.choice((1, 20))
            elif kind == 6:
                parent[key] = self._nested(parent[key])
            elif isinstance(parent[key], str) and len(parent[key]) < 1000:
                parent[key] = pick.choice((parent[key] * 1000, parent[key][:1], parent[key] + "]"))
            elif isinstance(parent[key], int) and not isinstance(parent[key], bool):
                parent[key] = pick.choice((parent[key] + 1, -parent[key], parent[key] * 10**30))
        return json.dumps(model).encode()

    def _nested(self, term: Any) -> Any:
        head, depth = self.random.choice(("-", "sin", "+", "ifelse")), self.random.choice((2, 50, 300))
        for _ in range(depth):
            term = {"type": head, "args": [term]}
        return term

    def _places(self, model: Any) -> list[tuple[Any, Any]]:
        found: list[tuple[Any, Any]] = []
        stack = [model]
        while stack:
            parent = stack.pop()
            keys = list(parent) if isinstance(parent, dict) else range(len(parent))
            for key in keys:
                found.append((parent, key))
                if isinstance(parent[key], dict | list):
                    stack.append(parent[key])
        return found or [({"a": 1}, "a")]


def tried(raw: bytes, path: Path, *, maps: bool) -> str:
    """What came of a text: the node, or refused."""
    try:
        if maps:
            found = from_mof.maps(raw, "memory", {"F": None, "g": None})
            for F in found.values():
                F.evaluate(np.zeros(F.inputs))
            return "maps"
        path.write_bytes(raw)
        problem = storage.load(path)
        again = path.with_name("again.mof.json")
        storage.save(problem, again, force=True)
        if storage.load(again).fingerprint != problem.fingerprint:
            raise AssertionError("comes back as another problem")
    except FormatError as refusal:
        str(refusal).encode()
        if "\n" in str(refusal):
            raise AssertionError("a refusal of several lines") from refusal
        return "refused"
    return problem.node


def _late(*_: Any) -> None:
    raise TimeoutError(f"more than {SECONDS} s of computing")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=None, help="a folder for the inputs that crash")
    asked = parser.parse_args()
    mutant, counts, crashes = Mutant(asked.seed), Counter[str](), 0
    signal.signal(signal.SIGPROF, _late)
    limit = BYTES
    slowest, end = 0.0, time.monotonic() + 60 * asked.minutes
    with tempfile.TemporaryDirectory() as folder:
        models, stored = seeds(Path(folder))
        while time.monotonic() < end:
            maps = mutant.random.random() < 0.2
            raw = mutant.of(mutant.random.choice(stored if maps else models))
            began = time.process_time()
            signal.setitimer(signal.ITIMER_PROF, SECONDS)  # of this process: others keep it waiting
            try:
                counts[tried(raw, Path(folder) / "m.mof.json", maps=maps)] += 1
                peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
                if peak > limit:
                    limit = peak + BYTES  # it never falls: said once
                    raise MemoryError(f"{peak} bytes, {len(raw)} of input")
            except Exception:
                crashes += 1
                traceback.print_exc()
                if asked.keep:
                    (asked.keep / f"crash-{asked.seed}-{crashes}.json").write_bytes(raw)
            signal.setitimer(signal.ITIMER_PROF, 0)
            slowest = max(slowest, time.process_time() - began)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    outcome = ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))
    print(
        f"{sum(counts.values()) + crashes} inputs: {outcome}; {crashes} crashes; {slowest:.2f} s, {peak:.0f} MB at most"
    )
    sys.exit(crashes > 0)


if __name__ == "__main__":
    main()
