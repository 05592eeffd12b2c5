"""GAMS' scalar text (.gms), as its CONVERT writes it: one variable and one equation a name, nothing to execute.

Models solved as LP, QCP, NLP, DNLP (and relaxed MIP, MIQCP, MINLP) are a qp or an nlp. An objective variable that
stands alone in one equation, e1.. objvar - f(x) =E= 0, is replaced by f(x), not an unknown; its constant becomes the
property `objective_offset` of a qp. Levels (x1.l) are the start, which a qp and linear problems have not. Variables
that the model does not use are not part of it.

Models solved as MCP, MPEC or RMPEC are complementarity problems where they are square: e.x is the pair of
F = left - right side of e and x, with 0 ≤ F where x is at its lower bound (=G=), F ≤ 0 at its upper bound (=L=), F = 0
where x is free (=E=), any of these by the bounds (=N=); where x is fixed, F is free. `squares` says what becomes of
equations without a variable and when the objective of an MPEC is left out, which is a warning and part of the
description; a model that is not square is refused as an MPCC.
"""

from __future__ import annotations

import dataclasses
import logging
from pathlib import Path
from typing import ClassVar

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.storage.base import Format, formats, no_member, read_text, stem
from cpbench_problems.formats.gams_model import ModelReader
from cpbench_problems.formats.gams_statements import COMPLEMENTARY, Statements, read_statements
from cpbench_problems.formats.model_problem import problem_of
from cpbench_problems.formats.squares import squared

logger = logging.getLogger("cpbench.storage")
LARGEST_FILE = 1 << 26
"""Bytes of a file that is read, in about two minutes."""


class GAMS(Format):
    """A model in GAMS' language, without indices."""

    name = "gams"
    summary = "GAMS' scalar text, as its CONVERT writes it: programs and square complementarity problems"
    suffixes = (".gms",)
    text: ClassVar[bool] = True

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.suffix.lower() in self.suffixes

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        size = path.stat().st_size if path.is_file() else 0
        if size > LARGEST_FILE:
            raise FormatError(path, "", f"has {size / 1e6:.0f} MB, at most {LARGEST_FILE / 1e6:.0f} are read")
        return _problem(path, read_statements(path, read_text(path)))


def _problem(path: Path, statements: Statements) -> Problem:
    solve = statements.solve
    if solve is None:
        raise FormatError(path, "", "has no solve statement, expected 'Solve m using ...' at its end")
    rows = statements.models[solve.model]
    for equation in rows:
        if equation not in statements.definitions:
            line = f"line {statements.equations[equation]}"
            raise FormatError(path, line, f"declares {equation}, which the model {solve.model} has and no line defines")
    reader = ModelReader(path, statements, solve)
    model, left_out = reader.model(), ""
    if solve.kind in COMPLEMENTARY:
        model, left_out = squared(model, f"{solve.sense}imizing {solve.objective}")
        reader.check_pairs(model)
    elif model.pairs:
        pair = next(f"{equation}.{variable}" for equation, variable in rows.items() if variable)
        raise FormatError(path, f"line {solve.line}", f"solves as {solve.kind.upper()} a model with the pair {pair}")
    problem = problem_of(model, path, stem(path), names=model.names)
    if not left_out:
        return problem
    logger.warning("%s: %s", path, left_out)
    info = dataclasses.replace(problem.info, description=f"{solve.kind.upper()} of GAMS; {left_out}")
    return dataclasses.replace(problem, info=info)


formats.add("gams", GAMS())
