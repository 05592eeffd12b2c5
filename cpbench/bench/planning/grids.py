"""Reads solvers as users write them: names, globs of names, and grids of options.

    nsgs                                      one entry
    newton-*                                  every solver of that name
    auto                                      the automatic choice for each problem, whatever its formulation
    all                                       every solver, those too that a run takes only when they are named
    nsgs[omega=0.8:1.4:0.2,shuffle=true|false]   4 x 2 entries: a range with its end and step, a list
    nsgs@head                                 a variant that a plan file or a plugin declares: another build

Numbers of a range are decimal: 0.8:1.4:0.2 is 0.8, 1.0, 1.2, 1.4, whatever binary fractions make of the sum.
"""

from __future__ import annotations

import fnmatch
import itertools
from collections.abc import Iterable, Iterator
from dataclasses import fields
from decimal import Decimal

from cpbench.bench.planning.plan import AUTO, Entry, all_automatic, entry_of
from cpbench.errors import CpbenchError, UnknownName
from cpbench.foundation.text import read_brackets
from cpbench.solvers.base import solvers

ALL = "all"
"""The name that stands for every solver; without any name a run takes those that are `by_default`."""
LARGEST = 10_000
"""Most entries of one grid."""
ROUNDING = Decimal("1e-9")
"""Distance, in steps, within which a range has reached its end."""


def by_default() -> list[Entry]:
    """Return the solvers of a run without named solvers, with their default options."""
    return [Entry(solver.spec.name) for solver in solvers if solver.spec.by_default]


def named(texts: Iterable[str]) -> set[str]:
    """Return the solvers that texts name, rather than match by a glob: such a solver has a row even where it cannot
    run."""
    exact = (text for text in texts if text.strip() not in (ALL, AUTO) and not set(text.partition("[")[0]) & set("*?"))
    return {entry.solver for text in exact for entry in grid(text)}


def entries(texts: Iterable[str]) -> list[Entry]:
    """Return all entries of the texts, each once, in their order; raises UnknownName and CpbenchError."""
    entries = [entry for text in texts for entry in grid(text)]
    # a solver that is named as well takes every problem, not only those whose automatic choice it is
    return list({entry.label: entry for entry in sorted(entries, key=lambda entry: not entry.nearest)}.values())


def grid(text: str) -> list[Entry]:
    """Return the entries of one text.

    >>> [entry.label for entry in grid("psor[omega=1:1.4:0.2]")]
    ['psor[omega=1.0]', 'psor[omega=1.2]', 'psor[omega=1.4]']
    """
    pattern, written = read_brackets("solver", text)
    if pattern == AUTO:
        if written:
            raise CpbenchError(f"solver '{text}': the automatic choice has no options; name one, as auto-qp")
        return [Entry(name, nearest=True) for name in all_automatic()]
    return [entry for name in _names(pattern) for entry in _entries(name, written, text)]


def _names(pattern: str) -> list[str]:
    if pattern == ALL:
        return solvers.names()
    if not set(pattern) & set("*?"):
        return [solvers.get(pattern).spec.name]
    names = [name for name in solvers.names() if fnmatch.fnmatchcase(name, pattern)]
    if not names:
        raise UnknownName("solver", pattern, solvers.names())
    return names


def _entries(name: str, written: dict[str, str], text: str) -> Iterator[Entry]:
    spec = solvers.get(name).spec
    defaults = {f.name: f.default for f in fields(spec.options)}
    for option in written.keys() - defaults.keys():
        raise UnknownName(f"option of {name}", option, defaults)
    axes = [list(values(value, defaults[option], f"{name}[{option}={value}]")) for option, value in written.items()]
    count = 1
    for axis in axes:
        count *= len(axis)
    if count > LARGEST:
        raise CpbenchError(f"solver '{text}': is {count} entries, at most {LARGEST} are run")
    for chosen in itertools.product(*axes):
        yield entry_of(spec, dict(zip(written, chosen, strict=True)))


def values(text: str, default: object, where: str) -> Iterator[str]:
    """Yield the single values of `a|b`, where numbers may be ranges `first:last:step`; raises CpbenchError.

    `default` : a value of the type. `where` : begins messages.
    """
    number = isinstance(default, int | float) and not isinstance(default, bool)
    for part in text.split("|"):
        if number and ":" in part:
            yield from _range(part, where)
        else:
            yield part.strip()


def _range(text: str, where: str) -> Iterator[str]:
    try:
        first, last, step = (Decimal(part.strip()) for part in text.split(":"))
        steps = (last - first) / step
    except (ArithmeticError, ValueError):
        raise CpbenchError(f"{where}: '{text}' is no range; write first:last:step, as in 0.8:1.4:0.2") from None
    if not steps.is_finite() or steps < 0:
        raise CpbenchError(f"{where}: '{text}' has no end: no steps of {step} lead from {first} to {last}")
    if steps >= LARGEST:
        raise CpbenchError(f"{where}: is {steps:.6g} numbers, at most {LARGEST} are run")
    for i in range(int(steps + ROUNDING) + 1):
        value = first + i * step
        yield str(int(value)) if value == value.to_integral_value() else repr(float(value))
