"""The kinds of single figures that `cpbench plot` draws: a module each, found by its name and imported when asked for.

A kind `sliding-speeds` is the module `sliding_speeds` of a package (`report/plots`, or one behind the entry points
``cpbench.figures``), with one function registered here. Its options are the keyword arguments of that function,
with their defaults; the first line of the module's docstring tells what it shows.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from cpbench.errors import UnknownName
from cpbench.registry import Registry

if TYPE_CHECKING:
    from matplotlib.figure import Figure

F = TypeVar("F", bound=Callable[..., Any])


class Need(StrEnum):
    """Need of a figure of a problem for an answer."""

    NONE = "none"
    OPTIONAL = "optional"
    REQUIRED = "required"


@dataclass(frozen=True, eq=False)
class Drawing:
    """A figure, what it shows in a few words, and how to read it in a sentence or two.

    short : the title of a figure that has room for a line only, where it is another one.
    """

    figure: Figure
    title: str
    guide: str
    short: str = ""


@dataclass(frozen=True)
class FigureKind:
    """One kind of figure.

    Attributes
    ----------
    draw : draw(problem, point, **options) -> Drawing for problems, draw(run, choice, **options) for runs; raises
        CpbenchError on what it cannot draw.
    answer : whether `point` may be None.
    helps : option -> what it means.
    """

    name: str
    draw: Callable[..., Drawing]
    answer: Need
    helps: Mapping[str, str]

    @property
    def options(self) -> dict[str, Any]:
        """Options with their defaults."""
        parameters = inspect.signature(self.draw).parameters.values()
        return {p.name: p.default for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY}


figure_kinds: Registry[FigureKind] = Registry("figure")


def figure_kind(name: str, /, *, answer: Need = Need.NONE, **helps: str) -> Callable[[F], F]:
    """Register the function that draws the kind `name` (a decorator); `helps` has a line for each of its options."""

    def keep(draw: F) -> F:
        kind = FigureKind(name, draw, answer, helps)
        assert set(kind.options) == set(helps), f"figure {name}: every option has a help, and no other"
        figure_kinds.add(name, kind)
        return draw

    return keep


def summaries(package: str) -> dict[str, str]:
    """List the kinds of a package (`cpbench.report.plots`) and the first line of each module, without importing
    them.
    """
    folder = Path(str(importlib.import_module(package).__file__)).parent
    return {
        info.name.replace("_", "-"): _headline(folder / f"{info.name}.py")
        for info in pkgutil.iter_modules([str(folder)])
    }


def find(package: str, name: str) -> FigureKind:
    """Find the kind `name` of a package; raises UnknownName."""
    known = summaries(package)
    if name not in known:
        raise UnknownName("figure", name, known)
    importlib.import_module(f"{package}.{name.replace('-', '_')}")
    return figure_kinds.get(name)


def _headline(path: Path) -> str:
    doc = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return doc.splitlines()[0] if doc else ""
