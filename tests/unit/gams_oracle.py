"""The equations of a GAMS scalar text by Python's own parser, whose signs bind as GAMS'; no code of cpbench."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

FUNCTIONS = {
    "sqr": lambda x: x * x,
    "power": lambda x, n: x**n,
    "exp": math.exp,
    "log": math.log,
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "abs": abs,
}


@dataclass
class Equation:
    """Sides as texts of Python, and what stands between them."""

    left: str
    relation: str
    right: str

    def sides(self, point: dict[str, float]) -> tuple[float, float]:
        return _value(self.left, point), _value(self.right, point)

    def size(self, point: dict[str, float]) -> float:
        """About how large its terms are: all are added up."""
        return max(1.0, *(abs(_value(side.replace("-", "+"), point)) for side in (self.left, self.right)))

    def uses(self, name: str) -> bool:
        return re.search(rf"\b{name}\b", f"{self.left} {self.right}") is not None


def _value(text: str, point: dict[str, float]) -> float:
    return eval(text.strip(), {"__builtins__": {}}, FUNCTIONS | point)


def equations(text: str) -> dict[str, Equation]:
    """Return the equations of a text by name."""
    lines = [line for line in text.lower().split("\n") if not line.startswith(("*", "$"))]
    found: dict[str, Equation] = {}
    for statement in " ".join(lines).split(";"):
        match = re.fullmatch(r"\s*(\w+)\s*\.\.(.*)=([egln])=(.*)", statement, re.DOTALL)
        if match:
            found[match[1]] = Equation(*(match[k].replace("\n", " ") for k in (2, 3, 4)))
    return found


def declared(text: str) -> list[str]:
    """Return the names of the variables, in the order of their first declaration."""
    lines = "\n".join(line for line in text.lower().split("\n") if not line.startswith("*"))
    match = re.search(r"^\s*variables?\s([^;]*);", lines, re.MULTILINE)
    return [name.strip() for name in match[1].split(",")] if match is not None else []
