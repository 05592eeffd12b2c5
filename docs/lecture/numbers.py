"""Computed numbers as words of the page: never more digits than a reader wants."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cpbench import Point
from cpbench.foundation.matrices import Matrix, Vector, dense

NOISE = 1e-9
GREEK = {"lam": "λ", "mu": "μ", "nu": "ν"}


def number(value: float, digits: int = 4) -> str:
    """HTML of one number; what is rounding noise has one digit.

    >>> number(-0.5), number(2.2e-16), number(0.0), number(1234567.0)
    ('−0.5', '2&#8239;×&#8239;10<sup>−16</sup>', '0', '1.235&#8239;×&#8239;10<sup>6</sup>')
    """
    if value == 0:
        return "0"
    if not math.isfinite(value):
        return ("−" if value < 0 else "") + ("∞" if math.isinf(value) else "not a number")
    if 1e-4 <= abs(value) < 1e5:
        shown = f"{value:.{digits}g}"
        return shown.replace("-", "−")
    mantissa, exponent = f"{value:.{0 if abs(value) < NOISE else digits - 1}e}".split("e")
    mantissa = f"{float(mantissa):g}"
    return f"{mantissa}&#8239;×&#8239;10<sup>{int(exponent)}</sup>".replace("-", "−")


def error(value: float | None) -> str:
    """HTML of a measured error, one digit; — where there is none.

    >>> error(3.14e-16), error(0.0), error(None), error(0.0497)
    ('3&#8239;×&#8239;10<sup>−16</sup>', '0', '—', '0.05')
    """
    return "—" if value is None else number(value, 1)


def vector(values: Vector) -> str:
    """HTML of a vector, in parentheses.

    >>> vector(np.array([1.0, -2.5]))
    '(1, −2.5)'
    """
    return f"({', '.join(number(_clean(v)) for v in values)})"


def point(answer: Point) -> str:
    """HTML of the parts of an answer that have numbers other than 0, by name."""
    parts = {name: value for name, value in answer.arrays().items() if value.size}
    shown = {name: value for name, value in parts.items() if value.any()} or parts
    return "; ".join(f"<i>{GREEK.get(name, name)}</i> = {vector(value)}" for name, value in shown.items())


def value(thing: Any) -> str:
    """HTML of whatever was computed: numbers, vectors, counts; a text is text."""
    if isinstance(thing, np.ndarray):
        return vector(thing.ravel())
    if isinstance(thing, (bool, str)) or not isinstance(thing, (int, float, np.integer, np.floating)):
        return str(thing).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return str(int(thing)) if isinstance(thing, (int, np.integer)) else number(float(thing))


def matrix_latex(values: Matrix | Vector) -> str:
    r"""A matrix, a vector as a column, or a number, in LaTeX.

    >>> matrix_latex(np.array([[1.0, 0.5]]))
    '\\begin{pmatrix}1&0.5\\end{pmatrix}'
    """
    table = np.atleast_2d(dense(values)) if values.ndim == 2 else np.asarray(values)[:, None]
    if table.shape == (1, 1):
        return f"{_clean(table[0, 0]):.4g}"
    rows = "\\\\".join("&".join(f"{_clean(entry):.4g}" for entry in row) for row in table)
    return rf"\begin{{pmatrix}}{rows}\end{{pmatrix}}"


def _clean(entry: float) -> float:
    """Rounding noise around 0 is 0."""
    return 0.0 if abs(entry) < NOISE else float(entry)
