"""PATH on a nonlinear MiCP: the map written out as GAMS' scalar equations, one process of GAMS a solve."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import numpy as np

from cpbench.formulations import MiCP
from cpbench.formulations.expressions import Map, Operator
from cpbench_adapters import gams_licence

SIGNS = {Operator.ADD: "+", Operator.SUB: "-", Operator.MUL: "*", Operator.DIV: "/"}
FUNCTIONS = {
    Operator.SQRT: "sqrt", Operator.EXP: "exp", Operator.LOG: "log", Operator.SIN: "sin", Operator.COS: "cos",
    Operator.TAN: "tan", Operator.ATAN: "arctan", Operator.SINH: "sinh", Operator.COSH: "cosh", Operator.TANH: "tanh",
}  # fmt: skip
LONGEST = 3_000_000
"""Characters of a model; beyond it the map shares too much for a model without definitions."""


def usable() -> bool:
    """Whether GAMS starts with its licence."""
    try:
        return gams_licence.refusal()[0] == 0
    except Exception:
        return False


def solve(problem: MiCP, start: np.ndarray, tolerance: float, seconds: float) -> tuple[np.ndarray | None, str]:
    """z and what GAMS says; None where the licence, an operator or the size forbids."""
    n = start.size
    most = gams_licence.most_rows()
    if most is not None and n > most:
        return None, f"licence ({n} rows)"
    try:
        model = _model(problem, start, seconds)
    except KeyError as missing:
        return None, f"operator {Operator(missing.args[0]).name}"
    if len(model) > LONGEST:
        return None, "formulas too long"
    with tempfile.TemporaryDirectory(prefix="path-") as folder:
        place = Path(folder)
        (place / "m.gms").write_text(model)
        (place / "path.opt").write_text(f"convergence_tolerance {tolerance}\n")
        command = [str(gams_licence.system_directory() / "gams"), "m.gms"]
        command += [f"license={gams_licence.licence_file()}", "lo=0"]
        subprocess.run(command, cwd=folder, capture_output=True, timeout=seconds + 60.0, check=False)
        answer = place / "answer.txt"
        if not answer.exists():
            listing = (place / "m.lst").read_text(errors="replace") if (place / "m.lst").exists() else ""
            said = [line for line in listing.splitlines() if line.startswith("****")]
            return None, said[0].strip("* ") if said else "no answer"
        numbers = answer.read_text().split()
    z = np.array([float(x) for x in numbers[1:]])
    return (z if z.size == n else None), f"model status {float(numbers[0]):g}"


def _model(problem: MiCP, start: np.ndarray, seconds: float) -> str:
    n = start.size
    z = problem.project(start)
    lines = ["$offDigit", "variables", ",".join(f"\nz{i}" for i in range(n)) + ";"]
    for i in range(n):
        if np.isfinite(problem.lb[i]):
            lines.append(f"z{i}.lo = {float(problem.lb[i])!r};")
        if np.isfinite(problem.ub[i]):
            lines.append(f"z{i}.up = {float(problem.ub[i])!r};")
        lines.append(f"z{i}.l = {float(z[i])!r};")
    lines += ["equations", ",".join(f"\ne{i}" for i in range(n)) + ";"]
    lines += [f"e{i}.. {text} =n= 0;" for i, text in enumerate(_formulas(problem.F))]
    lines.append("model m / " + ",\n".join(f"e{i}.z{i}" for i in range(n)) + " /;")
    lines += ["m.optfile = 1; option mcp = path; option iterlim = 1000000;", f"option reslim = {seconds};"]
    lines += ["solve m using mcp;", "file f / 'answer.txt' /; f.nr = 2; f.nw = 26; f.nd = 16; f.pw = 40;"]
    lines += ["put f; put m.modelstat /;", *(f"put z{i}.l /;" for i in range(n)), "putclose f;"]
    return "\n".join(lines) + "\n"


def _formulas(F: Map) -> list[str]:
    """Raises KeyError with an operator that GAMS has under no name here."""
    texts = [f"z{i}" for i in range(F.inputs)] + [f"({float(c)!r})" for c in F.constants]
    for head, a, b in zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True):
        operator = Operator(head)
        if operator is Operator.NEG:
            text = f"(-{texts[a]})"
        elif operator in SIGNS:
            text = f"({texts[a]}\n {SIGNS[operator]}{texts[b]})"
        elif operator is Operator.POW:
            text = f"({texts[a]}\n **{texts[b]})"
        else:
            text = f"{FUNCTIONS[operator]}({texts[a]})"
        texts.append(text if len(text) <= LONGEST else "x" * (LONGEST + 1))
    return [texts[k] for k in F.outputs.tolist()]
