"""Statements of GAMS' scalar text, as CONVERT writes it: variables, equations, bounds and levels, one model, one solve.

Variables, Equations           names; Positive, Negative and Free Variables too, discrete ones are refused
e1.. LEFT =E= RIGHT;           also =G=, =L= and =N=
x1.lo = 1; x1.up, x1.fx, x1.l  numbers; marginals (x1.m, e1.m, e1.l) and what is said to a solver (x1.scale, m.limrow =
                               0) change no problem and are passed over
Model m / e1, e2.x1 /;         or / all /; e2.x1: the equation e2 is complementary to the variable x1
Solve m using NLP minimizing x1;
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from cpbench_problems.formats.gams_text import Token, Tokens

_BOUNDS: Mapping[str, tuple[float, float]] = {
    "free": (-math.inf, math.inf),
    "positive": (0.0, math.inf),
    "nonnegative": (0.0, math.inf),
    "negative": (-math.inf, 0.0),
}
_DISCRETE = ("binary", "integer", "sos1", "sos2", "semicont", "semiint")
_VARIABLE, _EQUATION = ("variable", "variables"), ("equation", "equations")
_PASSED_OVER = frozenset({"m", "scale"})
PROGRAMS = ("lp", "qcp", "nlp", "dnlp", "rmip", "rmiqcp", "rminlp")
COMPLEMENTARY = ("mcp", "mpec", "rmpec")
_INFINITE = {"inf": math.inf, "eps": 0.0}


@dataclass
class Variable:
    """Bounds and level of a variable. line : where it is declared."""

    line: int
    lo: float = -math.inf
    up: float = math.inf
    level: float = 0.0


@dataclass
class GAMSSolve:
    """The last statement. objective : the name of a variable, "" where there is none."""

    model: str
    kind: str
    line: int
    sense: str = "feasibility"
    objective: str = ""


@dataclass
class Statements:
    """Contents of a file: by name, in their order. definitions : the tokens behind `..` of equations.

    models : for each name its equations, each with the variable that it is complementary to, "" where there is none.
    """

    variables: dict[str, Variable] = field(default_factory=dict[str, Variable])
    equations: dict[str, int] = field(default_factory=dict[str, int])
    definitions: dict[str, list[Token]] = field(default_factory=dict[str, list[Token]])
    models: dict[str, dict[str, str]] = field(default_factory=dict[str, dict[str, str]])
    solve: GAMSSolve | None = None


def read_statements(path: Path, text: str) -> Statements:
    """Return what a text says; raises FormatError."""
    reader = _Reader(Tokens(path, text))
    while reader.statement():
        pass
    return reader.statements


class _Reader:
    def __init__(self, tokens: Tokens) -> None:
        self._tokens = tokens
        self.statements = Statements()

    def statement(self) -> bool:
        """Read the next statement; False at the end of the file."""
        tokens, statements = self._tokens, self.statements
        if tokens.ended:
            return False
        if tokens.accept(";"):
            return True
        line, name = tokens.next.line, tokens.name("a statement")
        if statements.solve is not None:
            tokens.refuse(
                f"has {name} after the solve of line {statements.solve.line}: cpbench reads one model a file", line
            )
        if tokens.accept(".."):
            self._definition(name, line)
        elif tokens.accept("."):
            self._assignment(name, line)
        elif name == "model":
            self._model()
        elif name == "solve":
            self._solve(line)
        elif name in _EQUATION:
            self._declare_equations()
        elif name in _VARIABLE or name in _BOUNDS or name in _DISCRETE:
            self._declare_variables(name)
        else:
            tokens.refuse(
                f"has the statement '{name}', which CONVERT does not write in a scalar model: let GAMS write the file "
                "by CONVERT (option GAMS)",
                line,
            )
        return True

    def _declare_variables(self, kind: str) -> None:
        tokens, statements = self._tokens, self.statements
        if kind not in _VARIABLE:
            word = tokens.name("'Variables'")
            if word not in _VARIABLE:
                tokens.refuse(f"has '{word}' behind '{kind}', expected 'Variables'")
        for name, line in self._names():
            if kind in _DISCRETE:
                tokens.refuse(
                    f"declares {name} as {kind}, and cpbench has continuous variables only: delete this statement for "
                    "the relaxation",
                    line,
                )
            if name in statements.equations:
                tokens.refuse(f"declares {name} as a variable, which is an equation", line)
            if kind in _VARIABLE and name in statements.variables:
                tokens.refuse(f"declares the variable {name} again", line)
            variable = statements.variables.setdefault(name, Variable(line))
            if kind in _BOUNDS:
                variable.lo, variable.up = _BOUNDS[kind]

    def _declare_equations(self) -> None:
        for name, line in self._names():
            if name in self.statements.equations or name in self.statements.variables:
                self._tokens.refuse(f"declares {name} again", line)
            self.statements.equations[name] = line

    def _names(self) -> list[tuple[str, int]]:
        """Read names with commas between them, up to the semicolon."""
        tokens, names = self._tokens, list[tuple[str, int]]()
        while True:
            line = tokens.next.line
            names.append((tokens.name("a name"), line))
            if tokens.accept(";"):
                return names
            tokens.require(",", f"after {names[-1][0]}")

    def _definition(self, name: str, line: int) -> None:
        tokens, statements = self._tokens, self.statements
        if name not in statements.equations:
            tokens.refuse(f"defines {name}, which is not declared under Equations", line)
        if name in statements.definitions:
            tokens.refuse(f"defines the equation {name} again", line)
        held: list[Token] = []
        while not tokens.ended and tokens.next.text not in (";", ".."):
            held.append(tokens.advance())
        tokens.require(";", f"in the equation {name} of line {line}")
        held.append(Token("end", "", line))
        statements.definitions[name] = held

    def _assignment(self, name: str, line: int) -> None:
        tokens, statements = self._tokens, self.statements
        attribute = tokens.name(f"an attribute of {name}")
        tokens.require("=", f"after {name}.{attribute}")
        value = self._value()
        tokens.require(";", f"after the value of {name}.{attribute}")
        if name in statements.models or (name in statements.equations and attribute in ("l", "m", "scale")):
            return
        if name not in statements.variables:
            tokens.refuse(f"has {name}.{attribute}, and {name} is no variable", line)
        variable = statements.variables[name]
        if attribute in _PASSED_OVER:
            return
        if attribute == "l" and not math.isfinite(value):
            tokens.refuse(f"has {name}.l = {value}, expected a finite number", line)
        if attribute == "fx":
            variable.lo = variable.up = variable.level = value
        elif attribute == "lo":
            variable.lo = value
        elif attribute == "up":
            variable.up = value
        elif attribute == "l":
            variable.level = value
        else:
            tokens.refuse(f"has {name}.{attribute}, cpbench reads lo, up, fx, l, m and scale", line)

    def _value(self) -> float:
        tokens = self._tokens
        sign = -1.0 if tokens.accept("-") else 1.0
        if sign > 0:
            tokens.accept("+")
        token = tokens.next
        if token.kind == "number":
            value = float(tokens.advance().text)
            if not math.isfinite(value):
                tokens.refuse("has a number beyond 1.8e308: infinite is inf", token.line)
        elif token.text in _INFINITE:
            value = _INFINITE[tokens.advance().text]
        else:
            tokens.refuse(f"has {tokens.shown()}, expected a number or inf")
        return sign * value

    def _model(self) -> None:
        tokens, statements = self._tokens, self.statements
        line, name = tokens.next.line, tokens.name("the name of a model")
        if name in statements.models or name in statements.variables or name in statements.equations:
            tokens.refuse(f"declares {name} again", line)
        tokens.require("/", f"after {name}")
        if tokens.accept("all"):
            rows = dict.fromkeys(statements.equations, "")
        else:
            rows: dict[str, str] = {}
            while True:
                here, equation = tokens.next.line, tokens.name("the name of an equation")
                if equation not in statements.equations or equation in rows:
                    why = "is in the model twice" if equation in rows else "is no equation"
                    tokens.refuse(f"has {equation} in the model {name}, which {why}", here)
                rows[equation] = tokens.name("the name of a variable") if tokens.accept(".") else ""
                if rows[equation] and rows[equation] not in statements.variables:
                    tokens.refuse(f"has {equation}.{rows[equation]}, and {rows[equation]} is no variable", here)
                if tokens.next.text == "/":
                    break
                tokens.require(",", f"after {equation}")
        tokens.require("/", f"after the equations of {name}")
        tokens.require(";", f"after the model {name}")
        statements.models[name] = rows

    def _solve(self, line: int) -> None:
        tokens, statements = self._tokens, self.statements
        model = tokens.name("the name of a model")
        if model not in statements.models:
            tokens.refuse(f"solves {model}, which is no model", line)
        tokens.require("using", f"after {model}")
        kind = tokens.name("a type of model")
        if kind not in (*PROGRAMS, *COMPLEMENTARY):
            known = ", ".join((*PROGRAMS, *COMPLEMENTARY)).upper()
            tokens.refuse(f"solves {model} as {kind.upper()}, cpbench reads {known}", line)
        statements.solve = GAMSSolve(model, kind, line)
        if not tokens.accept(";"):
            sense = tokens.name("minimizing or maximizing")
            if sense not in ("minimizing", "maximizing"):
                tokens.refuse(f"has '{sense}', expected minimizing or maximizing")
            statements.solve.sense, statements.solve.objective = sense[:3], tokens.name("a variable")
            if statements.solve.objective not in statements.variables:
                tokens.refuse(f"has the objective {statements.solve.objective}, which is no variable")
            tokens.require(";", "after the objective")
