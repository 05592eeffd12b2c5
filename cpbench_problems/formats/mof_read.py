"""Reading MathOptFormat.

A model with Complements constraints is a complementarity problem: every variable stands beside one function, and there
are no other rows. Its description says which (`cpbench lcp: ...`); what a model without that is, `model_problem` says.
"""

from __future__ import annotations

from pathlib import Path

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.storage.base import read_bytes, read_head
from cpbench_problems.formats.model_problem import problem_of
from cpbench_problems.formats.mof_model import read_model

MARK = "cpbench "
"""Beginning of the description of a written file, the formulation after it."""
CONVEX = " convex"
"""Behind the formulation of an nlp that was said to be convex."""
LARGEST_FILE = 1 << 30
"""Bytes of a file that is looked into; one of a third of that is refused for what it would take in memory."""


def read(path: Path) -> Problem:
    """Read the problem in a file; raises FormatError."""
    model = read_model(_content(path), path)
    description = model.description
    formulation = description.removeprefix(MARK).partition(":")[0] if description.startswith(MARK) else ""
    node = formulation.removesuffix(CONVEX)
    name = model.name or path.name.removesuffix(".json").removesuffix(".mof")
    # names in a file of cpbench are those of the parts of its own formulations
    names = () if description.startswith(MARK) else model.names
    return problem_of(model, path, name, node, convex=formulation == f"nlp{CONVEX}", names=names)


def _content(path: Path) -> bytes:
    read_head(path)
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise FormatError(path, "", f"has {size / 1e9:.1f} GB, at most {LARGEST_FILE / 1e9:.1f} are read")
    return read_bytes(path)
