"""MathOptFormat (JSON, schema 1.x), which JuMP and MathOptInterface read.

lcp    variables z[1]...z[n] ≥ 0; the vector (Mz + q, z) in Complements(2n)
mlcp   u[1]... free, v[1]... ≥ 0; (Au + Cv + a, Du + Bv + b, u, v) in Complements: what stands beside a free one is 0
relay  z between its bounds; (Mz + q, z) in Complements; so is an avi whose set is a box
qp     min ½zᵀQz + pᵀz; rows A[1]... ≥ b, rows C[1]... = d; bounds of z
ncp    (F(z), z) in Complements, z ≥ 0; micp: z between its bounds
nlp    min f(z); rows g[1]... ≥ 0, rows h[1]... = 0; bounds of z

In a quadratic function the coefficient of a pair i ≠ j is that of zᵢzⱼ, that of (i, i) is twice that of zᵢ², so that
both are entries of Q; where rounding has made Qᵢⱼ and Qⱼᵢ different, there are two terms, with half of each. Nonlinear
functions are read back bit for bit (`to_mof`); starts are the variables' `primal_start`; a parameter of a
map is one more variable, in Parameter(value), of the name it has. The description begins with the formulation
(`cpbench lcp: ...`); a file without that becomes what its functions and bounds say (`model_problem`). Second-order
cones, plain and rotated, are read and not written.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

from cpbench.errors import FormatError
from cpbench.formulations.base import Point, Problem, formulations
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.nonlinear import Equation
from cpbench.storage.base import Format, formats, no_member, read_bytes, read_head
from cpbench_problems.formats.model_problem import problem_of
from cpbench_problems.formats.mof_functions import Affine, Quadratic
from cpbench_problems.formats.mof_model import read_model
from cpbench_problems.formats.mof_write import constraints, objective, variables
from cpbench_problems.formats.problem_model import CONVEX, MODELS, formulation_of, model_of_problem
from cpbench_problems.formats.to_mof import MINOR

SUFFIX = ".mof.json"
LARGEST = 5_000_000
"""Coefficients or operations beyond which a file would take gigabytes; HDF5 takes matrices of any size."""
MARK = "cpbench "
"""Beginning of the description of a written file, the formulation after it."""
LARGEST_FILE = 1 << 30
"""Bytes of a file that is looked into; one of a third of that is refused for what it would take in memory."""


class MOF(Format):
    name = "mof"
    summary = "MathOptFormat 1.x (JSON), as JuMP reads it: complementarity problems, quadratic and nonlinear programs"
    suffixes = (SUFFIX,)
    writes = frozenset(MODELS)

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.name.lower().endswith(SUFFIX)

    def why_not(self, node: str) -> str:
        kind = formulations.get(node)
        if issubclass(kind, ContactProblem):
            return "a cone with friction is none of MathOptFormat's sets"
        if issubclass(kind, Equation):
            return "MathOptFormat has optimization and complementarity; an equation is a micp without bounds"
        if not kind.has_maps():
            return ""
        return (
            "MathOptFormat has complementarity between bounds alone (Complements): convert it to micp, where it can be"
        )

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        model = read_model(_content(path), path)
        description = model.description
        formulation = description.removeprefix(MARK).partition(":")[0] if description.startswith(MARK) else ""
        node = formulation.removesuffix(CONVEX)
        name = model.name or path.name.removesuffix(".json").removesuffix(".mof")
        # names in a file of cpbench are those of the parts of its own formulations
        names = () if description.startswith(MARK) else model.names
        return problem_of(model, path, name, node, convex=formulation == f"nlp{CONVEX}", names=names)

    def write(self, problem: Problem, file: BinaryIO, *, compress: bool, guesses: Sequence[Point] = ()) -> None:
        for part in text(problem):
            file.write(part.encode())


def _content(path: Path) -> bytes:
    read_head(path)
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise FormatError(path, "", f"has {size / 1e9:.1f} GB, at most {LARGEST_FILE / 1e9:.1f} are read")
    return read_bytes(path)


def text(problem: Problem) -> Iterator[str]:
    """Yield the file in pieces; raises FormatError when it would be too large, or the set of an avi is not a box."""
    model = model_of_problem(problem)
    functions = [*model.pairs.values(), *(row.function for row in (*model.above, *model.equal))]
    entries = sum(len(function.columns) for function in functions if isinstance(function, Affine))
    entries += len(model.objective.products) if isinstance(model.objective, Quadratic) else 0
    entries += sum(F.operations for F in problem.maps().values())
    if entries > LARGEST:
        raise FormatError(model.source, "", f"has {entries} coefficients or operations, too many: use .h5")
    described = f"{MARK}{formulation_of(problem)}: {', '.join(problem.relations)}"
    named = f'"name": {json.dumps(problem.name)},\n' if problem.name else ""
    version = f'{{"major": 1, "minor": {MINOR if problem.has_maps() else 0}}}'
    yield f'{{"version": {version},\n{named}"description": {json.dumps(described)},\n"variables": ['
    yield ", ".join(variables(model))
    yield f'],\n"objective": {objective(model)},\n"constraints": [\n'
    yield ",\n".join(constraints(model, ("g", "h") if problem.has_maps() else ("A", "C")))
    yield "\n]}\n"


formats.add("mof", MOF())
