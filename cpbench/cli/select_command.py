"""`cpbench select`."""

from __future__ import annotations

import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cpbench.bench.planning import plan_text
from cpbench.bench.planning.quantities import duration
from cpbench.bench.results.sealed import sealed
from cpbench.cli import next_command
from cpbench.cli.options import Command, Duration, force_option
from cpbench.errors import CpbenchError
from cpbench.plurals import counted

if TYPE_CHECKING:
    import pandas as pd

    from cpbench.analysis.costs import MeasuredCosts
    from cpbench.cli.subset_plan import Source


@click.command(cls=Command)
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RESULTS...")
@click.option("--budget", type=Duration(), default="10m", show_default=True, help="Wall clock of a run of the plan.")
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Decides between equal problems."
)
@click.option(
    "--safety",
    type=click.FloatRange(min=1.0),
    default=1.25,
    show_default=True,
    help="What the expected time is multiplied with: the other machine may be slower.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    default="ci.toml",
    show_default=True,
    help="Plan file.",
)
@force_option
def command(files: tuple[Path, ...], budget: float, seed: int, safety: float, output: Path, force: bool) -> None:
    """Select problems for runs that have to be short: a plan for cpbench run, from results of all of them.

    Every family that fits is represented by its cheapest problem. The rest of the budget goes to problems that tell
    the solvers apart; those that everybody solves at once, or nobody, add nothing. Solvers, routes and limits are
    those of the results, and so is the time it takes: on another machine, mind --safety.
    """
    from cpbench.analysis import costs, subset
    from cpbench.cli import subset_plan

    if output.suffix != ".toml":
        raise CpbenchError(f"-o {output}: a plan is a .toml file")
    if output.exists() and not force:
        raise CpbenchError(f"{output}: exists; --force replaces it")
    if not math.isfinite(budget):
        raise CpbenchError("--budget none: without a limit there is nothing to select; run all problems")
    table, sources = _read(files)
    found = costs.measured(table)
    room = found.affordable(budget / safety)
    _require_room(found, room, budget, safety)
    chosen = subset.choose(found.outcomes, found.cost, found.family, room, seed)
    told = subset_plan.Chosen(
        chosen,
        found,
        budget,
        safety,
        subset.agreement(found.outcomes, chosen.problems),
        _asked(sources, budget, safety, seed),
    )
    folder = _builtin()
    text = subset_plan.text(told, sources, output.absolute().parent, folder)
    plan_text.write(output, text)
    for line in text.splitlines():
        if line.startswith("#"):
            click.echo(line.removeprefix("# "))
    click.echo(f"plan: {output}; run it with: {next_command.line('run', '--plan', str(output))}")
    _tell(told, folder, room)


def _read(files: tuple[Path, ...]) -> tuple[pd.DataFrame, list[Source]]:
    import pandas as pd

    from cpbench.cli.subset_plan import source

    tables: list[pd.DataFrame] = []
    sources: list[Source] = []
    for path in dict.fromkeys(path.resolve() for path in files):
        with sealed(path) as store:
            meta: dict[str, Any] = store.meta()
            tables.append(store.table())
        sources.append(source(path.name, meta.get("plan")))
    return pd.concat(tables, ignore_index=True), sources


def _asked(sources: list[Source], budget: float, safety: float, seed: int) -> str:
    """The command without the places of this machine."""
    names = shlex.join(source.name for source in sources)
    return f"cpbench select {names} --budget {budget:g}s --safety {safety:g} --seed {seed}"


def _require_room(found: MeasuredCosts, room: float, budget: float, safety: float) -> None:
    """Raises CpbenchError when not even the cheapest problem fits."""
    least = found.cost.min()
    if room < least:
        need = math.ceil(safety * found.expected(least))
        cheapest = str(found.cost.idxmin())
        whole = cheapest.startswith("sequence ")  # as `costs` names it
        what = f"the {cheapest}, whose steps cannot be taken apart," if whole else "the cheapest problem"
        raise CpbenchError(
            f"--budget {duration(budget)}: starting {counted(found.solvers, 'solver')} and {what} take "
            f"{need} s with --safety {safety:g}: use --budget {need}s or more, or results of fewer solvers"
        )


def _tell(told: Any, folder: Path | None, room: float) -> None:
    """What the reader of the plan should do something about."""
    from cpbench.cli.subset_plan import missing
    from cpbench.solvers.base import solvers

    cost = told.measured.cost
    left = cost[~cost.index.isin(told.subset.problems)]
    if len(left) and left.min() <= room - told.subset.cost:
        click.echo("no further problem tells the solvers apart: the rest of the budget is left", err=True)
    for file in missing(told, folder):
        click.echo(f"not here: {file}; the plan names it as the results do", err=True)
    names = set(told.measured.rows["solver"]) - set(solvers.names())
    if names:
        click.echo(
            f"declared elsewhere: {', '.join(sorted(names))}; the command above needs --plugin FILE for them", err=True
        )


def _builtin() -> Path | None:
    from cpbench.generators.collection import builtin_folder

    try:
        return builtin_folder()
    except CpbenchError:
        return None
