"""The solvers that are registered, by formulation."""

from __future__ import annotations

import html

from cpbench.formulations.base import Problem, formulations
from cpbench.solvers.base import SolverSpec, solvers


class SolverSpecs(list[SolverSpec]):
    """A list of solvers that shows itself as a table of name, formulation, method and summary."""

    @property
    def names(self) -> list[str]:
        """The names, as `cpbench.solve` and `cpbench.run` take them."""
        return [spec.name for spec in self]

    def __repr__(self) -> str:
        return "\n".join(f"{spec.name:<28} {spec.node:<8} {spec.method}: {spec.summary}" for spec in self)

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr>{''.join(f'<td>{html.escape(text)}</td>' for text in (s.name, s.node, s.method, s.summary))}</tr>"
            for s in self
        )
        return f"<table><tr><th>solver</th><th>node</th><th>method</th><th>summary</th></tr>{rows}</table>"


def list_solvers(node: str | Problem | None = None, *, available: bool = True) -> SolverSpecs:
    """Return the solvers of a formulation, or of all, by name.

    Parameters
    ----------
    node : formulation (`cpbench list formulations`), or a problem of it. available : whether those are left out whose
        packages are not installed here; nothing is imported to see.

    Raises UnknownName on an unknown formulation.

    >>> import cpbench
    >>> "lemke" in cpbench.list_solvers("lcp").names
    True
    """
    from cpbench.bench import availability

    wanted = node.node if isinstance(node, Problem) else node
    if wanted is not None:
        formulations.get(wanted)
    chosen = [solver for solver in solvers if wanted in (None, solver.spec.node)]
    return SolverSpecs(solver.spec for solver in chosen if not available or availability.glance(solver).usable)
