"""The page of the Python interface: every public name of `cpbench`, documented by its signature and docstring."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Iterator
from typing import Any

from page_parts import verbatim

import cpbench
from cpbench.formulations import Point, Problem


def page() -> str:
    """Return the functions first, then the classes; formulations have a page of their own."""
    public = {name: getattr(cpbench, name) for name in cpbench.__all__ if not name.startswith("__")}
    functions = {name: item for name, item in public.items() if inspect.isroutine(item)}
    classes = {name: item for name, item in public.items() if inspect.isclass(item)}
    parts = ["# Python", "`import cpbench as cp` offers these names; the [formulations](formulations.md) too."]
    parts.append("## Functions")
    for name, item in functions.items():
        parts += _described(f"cpbench.{name}", item)
    for name in sorted(public.keys() - functions.keys() - classes.keys()):
        parts += [f"### cpbench.{name}", markdown(inspect.getdoc(public[name]) or "")]
    parts.append("## Classes")
    for name, item in classes.items():
        if not issubclass(item, (Problem, Point)) or item in (Problem, Point):
            parts += [*_described(f"cpbench.{name}", item), *_members(name, item)]
    return "\n\n".join(parts)


def markdown(docstring: str) -> str:
    """Return a docstring as Markdown: examples fenced, headings of sections bold, parameters as a list."""
    parts: list[str] = []
    for part in re.split(r"\n{2,}", docstring):
        if part.lstrip().startswith(">>>"):
            parts.append(verbatim(part, "pycon"))
            continue
        part = re.sub(r"^(\w[\w ]*)\n-{3,}$", r"**\1**\n", part, flags=re.MULTILINE)
        part = re.sub(r"^(\*{0,2}\w[\w, *]*) : ", lambda found: f"\n- `{found[1]}`: ", part, flags=re.MULTILINE)
        parts.append(re.sub(r":\w+:`~?([^`]+)`", r"`\1`", part))
    return "\n\n".join(parts)


def _described(title: str, item: Any) -> Iterator[str]:
    yield f"### {title}"
    yield verbatim(f"{item.__name__}{_signature(item)}", "python")
    yield markdown(inspect.getdoc(item) or "")


def _signature(item: Any) -> str:
    try:
        written = str(inspect.signature(item))
    except ValueError:  # what is written in C has none
        return "(...)"
    return re.sub(r"(: |-> )'([^']*)'", r"\1\2", written)  # annotations that are kept as text have quotes


def _members(name: str, item: type) -> Iterator[str]:
    """Yield the public methods and properties that the class itself defines and documents."""
    for member, value in vars(item).items():
        attribute = isinstance(value, (property, functools.cached_property))
        callable_ = inspect.isroutine(value) or isinstance(value, (classmethod, staticmethod))
        documented = inspect.getdoc(value) if attribute or callable_ else None
        if documented and not member.startswith("_"):
            yield f"#### {name}.{member}"
            yield verbatim(member if attribute else f"{member}{_signature(getattr(item, member))}", "python")
            yield markdown(documented)
