"""Conditions on the facts of problems, as `pandas.DataFrame.query` reads them: `3*nc/ndof > 1 and node != 'fc'`.

What a problem does not have is unknown, and pandas' nullable types keep it unknown through arithmetic, comparisons,
`and`, `or` and `not`: `nc > 3 or node == 'lcp'` selects an LCP, which has no nc. Only what is known to hold is
selected. A condition may come with the plan of somebody else, so that Python's own functions, attributes and variables
are refused before pandas sees it.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench.errors import CpbenchError, UnknownName

if TYPE_CHECKING:  # imported where it is used: most runs have no condition
    import pandas as pd

ALLOWED = "write numbers, 'texts', facts, + - * / // % **, < <= == != > >=, in [], and, or, not, ()"
_PARTS = (
    ast.Expression, ast.BoolOp, ast.UnaryOp, ast.BinOp, ast.Compare, ast.Name, ast.List, ast.Constant, ast.Load,
    ast.And, ast.Or, ast.Not, ast.UAdd, ast.USub, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod, ast.Pow,
    ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.In, ast.NotIn,
)  # fmt: skip


def require_condition(text: str, columns: Mapping[str, type]) -> None:
    """Raise CpbenchError where `text` is no condition on facts of the names and types `columns` (float or str).

    >>> require_condition("1 < nc/2 <= 3", {"nc": float})
    """
    _values(text, [{name: "" if kind is str else 1.0 for name, kind in columns.items()}], columns)


def holds(text: str, facts: Sequence[Mapping[str, float | str]], columns: Mapping[str, type]) -> list[bool]:
    """Tell for the facts of each problem whether the condition is known to hold; raises CpbenchError.

    >>> holds("not nc > 100", [{"nc": 7.0}, {"nc": 120.0}, {}], {"nc": float})
    [True, False, False]
    """
    return [bool(value) for value in _values(text, facts, columns).fillna(False)]


def _values(text: str, facts: Sequence[Mapping[str, float | str]], columns: Mapping[str, type]) -> pd.Series[bool]:
    import pandas as pd

    query = _query(text, columns)
    # "string" alone is pyarrow's type where pyarrow is installed, with other words for what is wrong
    types = {name: "string[python]" if kind is str else "Float64" for name, kind in columns.items()}
    table = pd.DataFrame(list(facts), columns=list(columns)).astype(types)
    try:
        with np.errstate(all="ignore"):
            values: Any = table.eval(query, engine="python")
    except Exception as cause:  # of whatever class pandas raises for texts that are added, numbers that are negated ...
        names = sorted({node.id for node in ast.walk(ast.parse(query)) if isinstance(node, ast.Name)})
        kinds = ", ".join(f"{name} is a {'text' if columns[name] is str else 'number'}" for name in names)
        raise _wrong(text, f"cannot be evaluated ({kinds}): {' '.join(str(cause).split())}") from None
    if not isinstance(values, pd.Series) or not pd.api.types.is_bool_dtype(values.dtype):
        raise _wrong(text, "is no condition on facts")
    return values


def _query(text: str, columns: Mapping[str, type]) -> str:
    """Return what pandas may evaluate: parts that were checked, all numbers as floats, so that no power takes long."""
    line = " ".join(text.split())
    try:
        tree = ast.parse(line, mode="eval")
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id not in columns:
                raise UnknownName("fact", node.id, columns)
            if isinstance(node, ast.Constant) and isinstance(node.value, int) and not isinstance(node.value, bool):
                node.value = float(node.value)
            wrong = isinstance(node, ast.Constant) and type(node.value) not in (float, str)
            if wrong or not isinstance(node, _PARTS):
                segment = ast.get_source_segment(line, node) if isinstance(node, ast.expr) else line
                raise _wrong(line, f"cannot be read; {ALLOWED}", f"'{segment}'" if segment else "")
        return ast.unparse(tree)
    except SyntaxError as error:
        segment = line[(error.offset or len(line) + 1) - 1 :]
        raise _wrong(line, f"{error.msg}; {ALLOWED}", f"'{segment}'" if segment else "the end") from None
    except (ValueError, MemoryError, RecursionError, OverflowError):  # a null character; a tree too deep for the parser
        raise _wrong(f"{line[:40]}...", f"cannot be read; {ALLOWED}") from None


def _wrong(text: str, what: str, where: str = "") -> CpbenchError:
    return CpbenchError(f"'{text}': at {where}: {what}" if where else f"'{text}': {what}")
