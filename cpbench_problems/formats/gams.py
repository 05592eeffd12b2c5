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
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.formulations.expressions.operators import Operator
from cpbench.storage.base import Format, formats, no_member, read_text, stem
from cpbench_problems.formats.gams_expressions import GAMSExpressions
from cpbench_problems.formats.gams_statements import COMPLEMENTARY, GAMSSolve, Statements, Tokens, read_statements
from cpbench_problems.formats.model_problem import problem_of
from cpbench_problems.formats.mof_functions import Affine, Function, Functions, Nonlinear
from cpbench_problems.formats.mof_model import Model, ModelRow, slack
from cpbench_problems.formats.plain_rows import PlainRows
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


# -------------------------------------------------------------------------------------------------- the model of a file

_RELATIONS = ("=e=", "=g=", "=l=", "=n=")


@dataclass
class _Row:
    """An equation: values of its sides. line : where it begins."""

    left: int
    relation: str
    right: int
    line: int


class ModelReader:
    """Maker of the model that the statements of a file describe."""

    def __init__(self, path: Path, statements: Statements, solve: GAMSSolve) -> None:
        self._path, self._statements, self._solve = path, statements, solve
        self._rows = statements.models[solve.model]
        self._replaced = self._objective_equation()
        used = {token.text for equation in self._rows for token in statements.definitions[equation]}
        used |= {solve.objective, *self._rows.values()}
        used -= {solve.objective} if self._replaced else set()
        kept = [name for name in statements.variables if name in used]
        self._column = {name: k for k, name in enumerate(kept)}
        self._functions = Functions(path, self._column)
        self._plain = PlainRows(self._functions.build)
        self._pairs: list[tuple[str, str, _Row]] = []

    def _objective_equation(self) -> str:
        """Return the equation in which alone the objective variable stands, "" where it is an unknown like others."""
        objective = self._solve.objective
        if not objective or objective in self._rows.values():
            return ""
        variable = self._statements.variables[objective]
        places = [
            equation
            for equation in self._rows
            for token in self._statements.definitions[equation]
            if token.kind == "name" and token.text == objective
        ]
        single = len(places) == 1 and not self._rows[places[0]]
        unbounded = variable.lo == -np.inf and variable.up == np.inf
        if not (single and unbounded):
            return ""
        # taken apart once as an unknown: with a factor, or inside a function, it has to stay one
        functions = Functions(self._path, {name: k for k, name in enumerate(self._statements.variables)})
        column = {name: k for k, name in enumerate(self._statements.variables)}
        row = self._row(places[0], functions, column)
        number = functions.build.number(row.right)
        terms = [value for _, value in PlainRows(functions.build).summands(row.left)]
        alone = terms.count(column[objective]) == 1
        return places[0] if row.relation == "=e=" and number is not None and alone else ""

    def model(self) -> Model:
        """Return the model; raises FormatError."""
        variables = [self._statements.variables[name] for name in self._column]
        model = Model(
            source=self._path,
            name="",
            description="",
            names=list(self._column),
            lb=np.array([variable.lo for variable in variables], float),
            ub=np.array([variable.up for variable in variables], float),
            start=np.array([variable.level for variable in variables], float),
            functions=self._functions,
            sense=self._solve.sense,
            complementary=self._solve.kind in COMPLEMENTARY,
        )
        if self._replaced:
            model.objective = self._objective(self._replaced)
        elif self._solve.objective:
            model.objective = Affine([self._column[self._solve.objective]], [1.0], 0.0)
        for equation, variable in self._rows.items():
            if equation == self._replaced:
                continue
            row = self._row(equation, self._functions, self._column)
            if variable:
                self._pair(model, equation, row, variable)
            else:
                self._constrain(model, equation, row)
        return model

    def _row(self, equation: str, functions: Functions, column: dict[str, int]) -> _Row:
        """Read an equation, whose sides become values of `functions`."""
        held = self._statements.definitions[equation]
        tokens = Tokens(self._path, held)
        expressions = GAMSExpressions(tokens, functions.build, column.get)
        line = tokens.next.line
        left = expressions.read()
        relation = tokens.next.text.lower()
        if tokens.next.kind != "relation" or relation not in _RELATIONS:
            tokens.refuse(f"has {tokens.shown()} in the equation {equation}, expected =E=, =G=, =L= or =N=")
        tokens.advance()
        right = expressions.read()
        if not tokens.ended:
            tokens.refuse(f"has {tokens.shown()} in the equation {equation}, expected ';'")
        return _Row(left, relation, right, line)

    def _one_sided(self, row: _Row, turns: bool) -> ModelRow:
        """Return a row with the number of one side as its side; `turns`: may be right - left."""
        build, below = self._functions.build, row.relation == "=l="
        for left, right, turned in ((row.left, row.right, False), (row.right, row.left, True)):
            side = build.number(right)
            if side is not None and not (turned and not turns):
                return ModelRow(self._function(left), side, below != turned)
        return ModelRow(self._function(build.apply(Operator.SUB, row.left, row.right)), 0.0, below)

    def _function(self, value: int) -> Function:
        return self._plain.function(value) or Nonlinear(value)

    def _constrain(self, model: Model, equation: str, row: _Row) -> None:
        if row.relation == "=n=":
            raise FormatError(
                self._path, f"line {row.line}", f"has =N= in {equation}, which says nothing: leave it out of the model"
            )
        one_sided = self._one_sided(row, turns=True)
        (model.equal if row.relation == "=e=" else model.above).append(one_sided)

    def _pair(self, model: Model, equation: str, row: _Row, name: str) -> None:
        column = self._column[name]
        if column in model.pairs:
            raise FormatError(self._path, f"line {row.line}", f"is the second equation beside {name}: {equation}")
        one_sided = dataclasses.replace(self._one_sided(row, turns=False), below=False)
        model.pairs[column] = slack(self._functions, one_sided)
        self._pairs.append((equation, name, row))

    def check_pairs(self, model: Model) -> None:
        """Raise FormatError where the relation of an equation and the bounds of its variable contradict each other."""
        for equation, name, row in self._pairs:
            lo, up = model.lb[self._column[name]], model.ub[self._column[name]]
            fits = {
                "=g=": np.isfinite(lo) and up == np.inf,
                "=l=": lo == -np.inf and np.isfinite(up),
                "=e=": lo == -np.inf and up == np.inf,
                "=n=": True,
            }
            if not fits[row.relation] and lo != up:
                raise FormatError(
                    self._path,
                    f"line {row.line}",
                    f"has {row.relation.upper()} in {equation}.{name} with {lo:g} <= {name} <= {up:g}, expected =G= "
                    "beside a lower bound, =L= beside an upper one, =E= beside none, or =N= beside any",
                )

    def _objective(self, equation: str) -> Function:
        """Return f of an equation that says that the objective variable is f."""
        # a name with a value, so that it is not an unknown: only this equation has it, and it is left out of the sum
        build = self._functions.build
        objective = build.parameter(self._solve.objective, 0.0)
        row = self._row(equation, self._functions, {**self._column, self._solve.objective: objective})
        terms = self._plain.summands(row.left)
        own = next(sign for sign, value in terms if value == objective)
        others = [(-own * sign, value) for sign, value in terms if value != objective]
        side = build.number(row.right)
        if side:
            others.append((own * np.sign(side), build.constant(abs(side))))
        total = -1
        for sign, value in others:
            if total < 0:
                total = value if sign > 0 else build.apply(Operator.NEG, value)
            else:
                total = build.apply(Operator.ADD if sign > 0 else Operator.SUB, total, value)
        return self._function(total if total >= 0 else build.constant(0.0))
