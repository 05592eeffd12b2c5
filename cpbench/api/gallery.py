"""The built-in families of problems, as a mapping from their names."""

from __future__ import annotations

import html
from collections.abc import Iterator, Mapping

from cpbench.errors import UnknownName
from cpbench.formulations.base import Problem
from cpbench.generators.base import generators


class Gallery(Mapping[str, tuple[Problem, ...]]):
    """The built-in families: `gallery["american-put"]` makes its problems, `list(gallery)` has the names.

    Raises UnknownName on a family that is not there.

    >>> import cpbench
    >>> [problem.name for problem in cpbench.gallery["american-put"]][0]
    'american-put-100'
    """

    def __getitem__(self, family: str) -> tuple[Problem, ...]:
        if family not in generators:
            raise UnknownName("family", family, generators.names())
        return tuple(instance.problem for instance in generators.get(family).instances())

    def __iter__(self) -> Iterator[str]:
        return iter(generators.names())

    def __len__(self) -> int:
        return len(generators)

    def __contains__(self, family: object) -> bool:
        return family in generators.names()

    def about(self) -> dict[str, str]:
        """Return formulation and summary of each family."""
        return {one.name: f"{one.node}: {one.summary}" for one in generators}

    def __repr__(self) -> str:
        return "\n".join(f"{name:<24} {text}" for name, text in self.about().items())

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(one.name)}</td><td>{one.node}</td>"
            f'<td style="text-align:left">{html.escape(one.summary)}</td></tr>'
            for one in generators
        )
        return f"<table><tr><th>family</th><th>node</th><th>summary</th></tr>{rows}</table>"


gallery = Gallery()
