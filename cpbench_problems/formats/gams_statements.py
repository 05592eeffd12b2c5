"""Statements of GAMS' scalar text, as CONVERT writes it: variables, equations, bounds and levels, one model, one solve.

Variables, Equations           names; Positive, Negative and Free Variables too, discrete ones are refused
e1.. LEFT =E= RIGHT;           also =G=, =L= and =N=
x1.lo = 1; x1.up, x1.fx, x1.l  numbers; marginals (x1.m, e1.m, e1.l) and what is said to a solver (x1.scale, m.limrow =
                               0) change no problem and are passed over
Model m / e1, e2.x1 /;         or / all /; e2.x1: the equation e2 is complementary to the variable x1
Solve m using NLP minimizing x1;

Nothing is executed: of lines for GAMS' compiler ($...) those are passed over that change no model, and every other one
is refused.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from cpbench.errors import FormatError

_TOKEN = re.compile(
    r"(?P<space>\s+)"
    r"|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
    r"|(?P<name>[A-Za-z_]\w*|%[A-Za-z_]\w*%)"
    r"|(?P<relation>=[A-Za-z]=)"
    r"|(?P<sign>\*\*|\.\.|[-+*/(),;=.])",
    re.ASCII,
)
_HARMLESS = re.compile(
    r"\$\s*(?:if\s+not\s+'%gams\.u1%'\s*==\s*''\s*\$include\s*'%gams\.u1%'"  # a file that a user may name
    r"|(?:on|off)(?:digit|empty|listing|symlist|symxref|uellist|uelxref|inline)"
    r"|title\b.*)\s*",
    re.IGNORECASE,
)
_DEFAULT = re.compile(r"\$\s*if\s+not\s+set\s+(\w+)\s+\$set\s+(\w+)\s+(\w+)\s*", re.IGNORECASE | re.ASCII)
"""`$if not set NLP $set NLP NLP`, with which later versions of CONVERT end their files."""
_SHOWN = 40


@dataclass(frozen=True, slots=True)
class Token:
    """A piece of the text. kind : number, name (in lower case), relation, sign or end."""

    kind: str
    text: str
    line: int


class Tokens:
    """The tokens of a text, or those given, one after the other."""

    def __init__(self, path: Path, text: str | Iterable[Token]) -> None:
        self._path = path
        self._set: dict[str, str] = {}
        self._source = self._all(text) if isinstance(text, str) else iter(text)
        self.next = Token("end", "", 1)
        self.advance()

    def advance(self) -> Token:
        """Return the next token and move behind it."""
        result = self.next
        self.next = next(self._source, Token("end", "", result.line))
        return result

    @property
    def ended(self) -> bool:
        """Whether there is no further token."""
        return self.next.kind == "end"

    def accept(self, text: str) -> bool:
        """Move behind the next token if it has this text."""
        if self.next.text != text or self.ended:
            return False
        self.advance()
        return True

    def require(self, text: str, where: str) -> None:
        """Raise FormatError unless the next token has this text; move behind it."""
        if not self.accept(text):
            self.refuse(f"has {self.shown()} {where}, expected '{text}'")

    def name(self, what: str) -> str:
        """Return the name that comes next; raises FormatError."""
        if self.next.kind != "name":
            self.refuse(f"has {self.shown()}, expected {what}")
        return self.advance().text

    def shown(self) -> str:
        """Return the next token for a message."""
        return f"'{self.next.text[:_SHOWN]}'" if not self.ended else "the end"

    def refuse(self, cause: str, line: int | None = None) -> NoReturn:
        """Raise FormatError with the line of the next token, or another."""
        raise FormatError(self._path, f"line {line or self.next.line}", cause)

    def _all(self, text: str) -> Iterator[Token]:
        hidden = 0
        for number, line in enumerate(text.split("\n"), 1):
            if hidden:
                hidden = 0 if re.match(r"\$\s*offtext\b", line, re.IGNORECASE) else hidden
            elif re.match(r"\$\s*ontext\b", line, re.IGNORECASE):
                hidden = number
            elif line.startswith("$"):
                self._instruction(line, number)
            elif not line.startswith("*"):
                yield from self._of_line(line, number)
        if hidden:
            self.refuse("begins a comment by $onText that does not end", hidden)

    def _of_line(self, line: str, number: int) -> Iterator[Token]:
        at = 0
        while at < len(line):
            match = _TOKEN.match(line, at)
            if match is None:
                self.refuse(f"has {line[at]!a}, which GAMS' CONVERT does not write in scalar models", number)
            at = match.end()
            kind, token = match.lastgroup, match[0]
            if kind == "space":
                continue
            if kind == "name":
                token = token.lower()
                if token.startswith("%"):
                    token = self._value(token, number)
            assert kind is not None  # every alternative of the pattern has a name
            yield Token(kind, token, number)

    def _instruction(self, line: str, number: int) -> None:
        given = _DEFAULT.fullmatch(line)
        if given is not None and given[1].lower() == given[2].lower():
            self._set.setdefault(given[1].lower(), given[3].lower())
        elif not _HARMLESS.fullmatch(line):
            shown = ascii(line[:_SHOWN])[1:-1]
            self.refuse(f"has the instruction {shown}, and cpbench executes none: write the model by CONVERT", number)

    def _value(self, name: str, number: int) -> str:
        values: Mapping[str, str] = self._set
        if name.strip("%") not in values:
            self.refuse(f"has {name}, for which no line above it sets a value", number)
        return values[name.strip("%")]


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
