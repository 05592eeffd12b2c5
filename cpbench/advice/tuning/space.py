"""The configurations of a solver that a search tries: its default first, then draws that the seed alone decides."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace

from cpbench.bench.planning import grids
from cpbench.bench.planning.plan import Entry
from cpbench.errors import CpbenchError
from cpbench.solvers.base import solvers
from cpbench.solvers.options import Domain, domains

VAIN = 1000
"""Draws in a row that bring nothing new, after which a space counts as exhausted."""


@dataclass(frozen=True)
class Space:
    """`entry` : the solver, with the options that are fixed. `domains` : where the others lie."""

    entry: Entry
    domains: Mapping[str, Domain]

    @property
    def size(self) -> float:
        """Number of configurations; infinite where an option may be any number of a range."""
        return math.prod(domain.size for domain in self.domains.values())

    def configurations(self, seed: int) -> Iterator[Entry]:
        """Yield different configurations, the default first, until VAIN draws in a row bring none that is new."""
        seen = {self.entry.label}
        yield self.entry
        draw = vain = 0
        while vain < VAIN:
            draw += 1
            source = random.Random(f"{seed} {self.entry.label} {draw}")
            drawn = {name: self.domains[name].draw(source) for name in sorted(self.domains)}
            entry = replace(self.entry, options={**self.entry.options, **drawn})
            vain += 1
            if entry.label not in seen:
                vain = 0
                seen.add(entry.label)
                yield entry


def space(text: str) -> Space:
    """Return the space of one solver, as in `nsgs` or `nsgs[shuffle=true,omega=0.8:1.6:0.1]`: one value is fixed,
    several are the choices, and options that are not named lie where the solver says.

    Raises CpbenchError when there is nothing to search, or more than one solver.
    """
    entries = grids.grid(text)
    names = {entry.solver for entry in entries}
    if len(names) > 1:
        raise CpbenchError(f"'{text}' is {len(names)} solvers ({', '.join(sorted(names))}): tune one at a time")
    spec = solvers.get(entries[0].solver).spec
    choices = {name: tuple(dict.fromkeys(e.options[name] for e in entries)) for name in entries[0].options}
    fixed = {name: values[0] for name, values in choices.items() if len(values) == 1}
    named = {name: Domain(choices=values) for name, values in choices.items() if len(values) > 1}
    where = {name: domain for name, domain in domains(spec.options).items() if name not in choices} | named
    if not where:
        options = ", ".join(f.name for f in fields(spec.options)) or "none"
        raise CpbenchError(
            f"{spec.name} has nothing to search (its options: {options}); name values as in "
            f"'{spec.name}[option=1|2|3]', or see cpbench list solvers {spec.name}"
        )
    return Space(replace(entries[0], options=fixed), where)
