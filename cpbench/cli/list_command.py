"""`cpbench list`."""

from __future__ import annotations

from pathlib import Path

import click


@click.command()
@click.argument("what", type=click.Choice(["formulations", "conversions", "solvers", "formats", "problems", "readme"]))
@click.option(
    "--write", type=click.Path(path_type=Path, exists=True), help="With readme: bring the tables in FILE up to date."
)
def command(what: str, write: Path | None) -> None:
    """List formulations, conversions, solvers, formats or the built-in problems; readme: the tables in Markdown."""
    if write is not None:
        from cpbench.report.registry_tables import registry_tables, replace_between_marks

        write.write_text(replace_between_marks(write.read_text(), registry_tables()))
        return
    for line in {
        "formulations": _formulations,
        "conversions": _conversions,
        "solvers": _solvers,
        "formats": _formats,
        "problems": _problems,
        "readme": _readme,
    }[what]():
        click.echo(line)


def _formulations() -> list[str]:
    from cpbench.formulations import formulations

    return [f"{cls.node:<6} {cls.title} {cls.equation}" for cls in formulations]


def _conversions() -> list[str]:
    from cpbench.graph import edges
    from cpbench.report.registry_tables import promise

    return [f"{e.name:<20} {e.source:>5} -> {e.target:<5} {promise(e):<25} {e.equation}" for e in edges()]


def _solvers() -> list[str]:
    from cpbench.solvers.base import solvers

    rows: list[str] = []
    for solver in solvers:
        spec, state = solver.spec, solver.availability()
        note = "" if state.ok else f"  [{state.state}: {state.detail.splitlines()[-1]}]"
        rows.append(f"{spec.name:<20} {spec.node:<5} {spec.summary}{note}")
    return rows


def _formats() -> list[str]:
    from cpbench.storage import formats

    return [f"{f.name:<18} {', '.join(f.suffixes):<14} {f.summary}" for f in formats]


def _readme() -> list[str]:
    from cpbench.report.registry_tables import registry_tables

    return registry_tables().splitlines()


def _problems() -> list[str]:
    from cpbench import storage
    from cpbench.generators.collection import builtin_folder

    folder = builtin_folder()
    return [address.removeprefix(f"{folder}/") for address in storage.problem_files([str(folder)])]
