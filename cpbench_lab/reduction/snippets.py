"""A reduced problem as a program in Python, C and Julia: its data, a claimed and a true answer, and the check of both.

The programs need nothing but their language: their users can put the data into the solver at hand. They print how
far each answer is from meeting the conditions, and end with 0 where that is what was found here.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from string import Template
from textwrap import indent
from typing import Any

import numpy as np

from cpbench.foundation.matrices import Dense, Vector
from cpbench_lab.reduction.forms import Form

PROGRAMS = Path(__file__).parent / "programs"
"""Templates of the programs, named as these are."""
MET = 1e-6
"""Error of an answer up to which it counts as true: of the order of the tolerances of solvers."""


def snippets(form: Form, title: str, answers: Mapping[str, Any]) -> dict[str, str]:
    """Return the programs by file name.

    Parameters
    ----------
    title : a line about the problem and the solver. answers : name -> point, `claimed` and `true`, as far as known.
    """
    vectors = {name: form.vector(point) for name, point in answers.items()}
    conditions = _CONDITIONS.format(names=_names(form))
    writers = {"snippet.py": ("", _python), "snippet.c": ("   ", _c), "snippet.jl": ("# ", _julia)}
    result: dict[str, str] = {}
    for name, (margin, write) in writers.items():
        template = Template(PROGRAMS.joinpath(f"{name}.template").read_text(encoding="utf-8"))
        data = write(form, vectors)
        result[name] = template.substitute(title=title, met=repr(MET), conditions=indent(conditions, margin), **data)
    return result


def _names(form: Form) -> str:
    return ", ".join(f"{name} ({size})" for name, size in form.names.items() if size)


def _number(x: float, infinite: str) -> str:
    if np.isfinite(x):
        return f"{int(x)}.0" if x == int(x) and abs(x) < 1e15 else repr(float(x))
    return f"-{infinite}" if x < 0 else infinite if x > 0 else "NAN"


def _list(values: Any, infinite: str, brackets: str = "[]") -> str:
    return brackets[0] + ", ".join(_number(float(x), infinite) for x in np.ravel(values)) + brackets[1]


def _blocks(form: Form) -> list[list[float]]:
    return [[b.start, b.slides, b.rolls, b.mu, b.mu_r] for b in form.blocks]


def _python(form: Form, vectors: Mapping[str, Vector]) -> dict[str, str]:
    rows = ",\n     ".join(_list(row, "inf") for row in form.K)
    return {
        "K": f"[{rows}]",
        "k": _list(form.k, "inf"),
        "lo": _list(form.lo, "inf"),
        "hi": _list(form.hi, "inf"),
        "blocks": "[" + ", ".join(f"({b[0]}, {b[1]}, {b[2]}, {b[3]!r}, {b[4]!r})" for b in _blocks(form)) + "]",
        "friction": str(form.friction),
        "answers": "{" + ", ".join(f"{n!r}: {_list(x, 'inf')}" for n, x in vectors.items()) + "}",
    }


def _c(form: Form, vectors: Mapping[str, Vector]) -> dict[str, str]:
    blocks = _blocks(form)
    rows = ",\n    ".join(_list(row, "INFINITY", "{}") for row in form.K)
    return {
        "n": str(form.k.size),
        "K": f"{{{rows}}}",
        "k": _list(form.k, "INFINITY", "{}"),
        "lo": _list(form.lo, "INFINITY", "{}"),
        "hi": _list(form.hi, "INFINITY", "{}"),
        "count": str(len(blocks)),
        "blocks": "{" + ", ".join(_list(b, "INFINITY", "{}") for b in blocks or [[0.0] * 5]) + "}",
        "friction": str(int(form.friction)),
        "answers": "{" + ", ".join(_list(x, "INFINITY", "{}") for x in vectors.values() or [form.k]) + "}",
        "labels": "{" + ", ".join(f'"{name}"' for name in vectors or ["none"]) + "}",
        "number": str(len(vectors)),
    }


def _julia(form: Form, vectors: Mapping[str, Vector]) -> dict[str, str]:
    return {
        "K": _julia_matrix(form.K),
        "k": _list(form.k, "Inf"),
        "lo": _list(form.lo, "Inf"),
        "hi": _list(form.hi, "Inf"),
        "blocks": "[" + ", ".join(f"({b[0] + 1}, {b[1]}, {b[2]}, {b[3]!r}, {b[4]!r})" for b in _blocks(form)) + "]",
        "friction": str(form.friction).lower(),
        "answers": "[" + ", ".join(f'"{name}" => {_list(x, "Inf")}' for name, x in vectors.items()) + "]",
    }


def _julia_matrix(K: Dense) -> str:
    if K.size == 1:
        return f"fill({_number(float(K[0, 0]), 'Inf')}, 1, 1)"
    return "[" + ";\n     ".join(" ".join(_number(float(x), "Inf") for x in row) for row in K) + "]"


_CONDITIONS = """\
Unknowns x: {names}. F = Kx + k. Outside the blocks x is in [lo, hi] with F = 0 inside, F >= 0 at lo, F <= 0 at hi.
In a block (start, slides, rolls, mu, mu_r): |x_T| <= mu x_N, |x_M| <= mu_r x_N, and F (with friction
F + (mu|F_T| + mu_r|F_M|)e_N) is in the dual cone and orthogonal to x."""
"""Explanation at the head of each program."""
