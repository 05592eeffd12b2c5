"""What a section shows of its conversions: a table of measured round trips, and the mathematics behind a title each."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from cpbench import Problem
from cpbench.conversions.base import conversions, mathematics
from cpbench.solvers.base import solvers as registry
from lecture import cells, numbers
from lecture.blocks import Block, Data, Fold, Html, Table
from lecture.numerics.examples import problems
from lecture.numerics.round_trips import RoundTrip, answer, round_trip


def shown(trips: Sequence[RoundTrip], caption: str = "") -> tuple[Block, ...]:
    """The table of round trips, and a fold for every edge."""
    rows = [
        (
            Html(
                f"<code>{trip.edge.split('[')[0]}</code><br><small>{trip.source.node} → {trip.target.node}, "
                f"{_size(trip.source)} → {_size(trip.target)} unknowns<br>{trip.equation}</small>"
            ),
            cells.words(trip.kind),
            cells.words(trip.by),
            cells.point(trip.lifted),
            cells.error(trip.target_error),
            cells.error(trip.source_error),
            cells.error(trip.pushed_error),
        )
        for trip in trips
    ]
    head = ("conversion", "promise", "solved there by", "lifted answer", "error there", "error here", "error, pushed")
    told = (
        "The problem is converted and solved there; the answer is lifted back and measured here. The last column goes "
        "the other way: our own answer, pushed there and measured. "
    )
    edges = dict.fromkeys(trip.edge.split("[")[0] for trip in trips)
    folds = [Fold(f"The mathematics of `{name}`", tuple(mathematics(conversions.get(name)))) for name in edges]
    return (Table(head, tuple(rows), told + caption), *folds)


def trips(problem: str, *edges: str) -> list[RoundTrip]:
    """Round trips of one of the page's problems."""
    source = problems()[problem]
    return [round_trip(source, edge) for edge in edges]


def data(problem: Problem, *names: str) -> Data:
    """The numbers of a problem, written out."""
    parts = problem.data()
    symbols = {"lb": r"l", "ub": r"u", "mu": r"\mu", "mu_r": r"\mu_{r}"}
    shown_parts = [f"{symbols.get(name, name)} = {numbers.matrix_latex(parts[name])}" for name in names]
    return Data(tuple(shown_parts))


def by_solvers(problem: str, *solvers: str) -> Table:
    """One problem by several solvers of its own node: what each counted and how well it did."""
    source = problems()[problem]
    rows: list[tuple[str | Html, ...]] = []
    for name in solvers:
        spec, done = registry.get(name).spec, answer(source, name)
        counted = ", ".join(f"{what.replace('_', ' ')}: {count}" for what, count in done.counters.items()) or "—"
        rows.append(
            (
                Html(f"<code>{escape(name)}</code>"),
                cells.words(spec.method),
                cells.words(counted),
                cells.point(done.point),
                cells.error(done.error),
            )
        )
    head = ("solver", "kind of method", "what it counted", "answer", "error, measured")
    return Table(
        head, tuple(rows), "The small problem by one solver of each kind; the error is measured by us, never theirs."
    )


def registered(node: str) -> Html:
    """The solvers of a node that run by default, by kind of method."""
    kinds: dict[str, list[str]] = {}
    for solver in registry:
        if solver.spec.node == node and solver.spec.by_default:
            kinds.setdefault(solver.spec.method, []).append(solver.spec.name)
    return Html(
        "; ".join(
            f"{escape(method)}: " + ", ".join(f"<code>{escape(name)}</code>" for name in names)
            for method, names in sorted(kinds.items())
        )
    )


def _size(problem: Problem) -> int:
    return sum(problem.point_sizes.values())
