"""The nonlinear maps of a problem, written out as the library holds them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from cpbench import Problem
from cpbench.formulations.expressions.infix import formulas
from lecture.blocks import Data, Formula, formula

LONGEST = 400
SYMBOLS = {"upper": r"\mathrm{upper}"}
WIDE = 66
"""Characters of LaTeX in a row."""


def maps(problem: Problem, *names: str, unknowns: Sequence[str] = (), of: str = "z") -> Data | Formula:
    """The maps of a problem that are named, in unknowns that are LaTeX, z_1 and so on unless given.

    What is wider than a small screen is a display, which scrolls.
    """
    wide = False
    parts = []
    for name in names:
        F = problem.maps()[name]
        letters = tuple(unknowns) or tuple(f"z_{{{k + 1}}}" for k in range(F.inputs))
        rows = [latex(row) for row in formulas(F, letters, LONGEST)]
        wide |= max(map(len, rows)) > WIDE
        body = r"\\".join(rows)
        if F.rows > 1:
            body = rf"\begin{{pmatrix}}{body}\end{{pmatrix}}"
        parts.append(rf"{SYMBOLS.get(name, name)}({of}) = {body}")
    return formula(r"\qquad ".join(parts)) if wide else Data(tuple(parts))


def latex(infix: str) -> str:
    r"""A formula for people in LaTeX; repeated factors are powers, where they stand side by side.

    >>> latex("2*x*x*x + -1*y - (x - 2)*(x - 2) - -3")
    '2 x^{3} - y - (x - 2)^{2} + 3'
    >>> latex("z_{1}*sqrt(z_{1}*z_{1} + 0.5)/4 + -6")
    'z_{1} \\sqrt{z_{1}^{2} + 0.5}/4 - 6'
    >>> latex("2*x*0.25*y - 2*-y")
    '2 x \\cdot 0.25 y - 2 (-y)'
    """
    told = infix.replace("+ -", "- ").replace("- -", "+ ")
    told = re.sub(r"(?<![\w.}])1\*", "", told)
    factor = r"([A-Za-z\\]+(?:_\{\w+\})?|\([^()]*\))"
    told = re.sub(rf"(?<![\w}}]){factor}((?:\*\1(?![\w_]))+)", _power, told)
    told = re.sub(r"sqrt\(([^()]*)\)", r"\\sqrt{\1}", told)
    told = re.sub(r"\*(-[^\s()*/]+)", r" (\1)", told)
    return re.sub(r"\*(?=\d)", r" \\cdot ", told).replace("*", " ")


def _power(found: re.Match[str]) -> str:
    return f"{found[1]}^{{{1 + found[2].count('*' + found[1])}}}"
