"""`cpbench info`."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from typing import Any

import click
import numpy as np

from cpbench import facts, matrices, storage
from cpbench.cli import info_summary
from cpbench.cli.answer import is_results, print_results
from cpbench.cli.options import Address, Command, format_option, number
from cpbench.facts import Fact
from cpbench.formulations import Problem
from cpbench.generators.collection import address_text
from cpbench.plain_text import printable

LABELS = ("title", "description", "math_info", "family", "source", "licence", "citation")


@click.command(cls=Command)
@click.argument("files", nargs=-1, required=True, type=Address())
@click.option("--json", "as_json", is_flag=True, help="Everything, machine readable: a list with one object a problem.")
@click.option("--facts/--no-facts", "measure", default=True, show_default=True, help="Measure facts of the matrices.")
@format_option
def command(files: tuple[str, ...], as_json: bool, measure: bool, file_format: str | None) -> None:
    """Show formulation, sizes, facts, origin and provenance of problems (FILE, FILE::NAME or folders).

    Of more than three problems it shows a line each; one that cannot be read does not keep back the others. Of a
    results file: which solver to use, as the run that wrote it ended.

    A fact says how it was found: exact, by a factorization, by a randomized estimate, or not decided.
    """
    if any(map(is_results, files)):
        first, *others = files
        if as_json or file_format or others:
            raise click.UsageError("a results file stands alone, without options; its rows as JSON: cpbench export")
        print_results(first)
        return
    records: list[dict[str, Any]] = []
    addresses = storage.problem_files(files) or list(files)
    if len(addresses) > info_summary.MANY and not as_json:
        told, refused = info_summary.lines(addresses, file_format)
        click.echo("\n".join(told))
        for reason in refused:
            click.echo(reason, err=True)
        if refused:
            sys.exit(2)
        return
    for address in addresses:
        problem = storage.load(address, format=file_format)
        measured = facts.of(problem) if measure else ()
        if as_json:
            records.append(_record(address, problem, measured))
        else:
            _print(address, problem, measured)
    if as_json:
        click.echo(json.dumps(records, indent=2, ensure_ascii=False, allow_nan=False))


def _print(address: str, problem: Problem, measured: tuple[Fact, ...]) -> None:
    click.echo(f"{address_text(address)}: {problem.title} {problem.equation}")
    click.echo(f"  node         {problem.node}")
    click.echo(f"  name         {printable(problem.name)}")
    click.echo(f"  fingerprint  {problem.fingerprint}")
    for symbol, size in problem.sizes().items():
        click.echo(f"  {symbol:<12} {size}")
    for name, value in problem.data().items():
        click.echo(f"  {name:<12} {_describe(value)}")
    for name, F in problem.maps().items():
        click.echo(f"  {name:<12} map {F.rows}x{F.inputs}, {F.operations} operations, {F.constants.size} constants")
    for name, value in problem.parameters.items():
        click.echo(f"  parameter    {name} = {value:.17g}")
    for label in LABELS:
        text = getattr(problem.info, label)
        if text:
            click.echo(f"  {label:<12} {printable(text)}")
    for key, value in problem.info.properties.items():
        click.echo(printable(f"  property     {key} = {value}"))
    for step in problem.provenance:
        parameters = ", ".join(f"{k}={v}" for k, v in step.parameters.items())
        click.echo(
            f"  made by      {step.conversion}({parameters}), {step.kind}, from {step.source_node} {step.source}"
        )
    for fact in measured:
        click.echo(f"  fact         {fact}")


def _describe(value: matrices.Matrix | matrices.Vector) -> str:
    if value.ndim == 1:
        return f"vector of {value.size}, max |.| {number(matrices.max_abs(value))}"
    rows, cols = value.shape
    storage_kind = "sparse" if matrices.is_sparse(value) else "dense"
    return f"{storage_kind} {rows}x{cols}, {matrices.nnz(value)} nonzeros, max |.| {number(matrices.max_abs(value))}"


def _record(address: str, problem: Problem, measured: tuple[Fact, ...]) -> dict[str, Any]:
    return {
        "address": address,
        "node": problem.node,
        "title": problem.title,
        "equation": problem.equation,
        "relations": list(problem.relations),
        "name": problem.name,
        "fingerprint": problem.fingerprint,
        "sizes": problem.sizes(),
        "data": {name: _data_record(value) for name, value in problem.data().items()},
        "maps": {
            name: {"shape": list(F.shape), "operations": F.operations, "constants": F.constants.size}
            for name, F in problem.maps().items()
        },
        "parameters": problem.parameters,
        "unknowns": problem.point_sizes,
        "info": {label: getattr(problem.info, label) for label in LABELS},
        "properties": {key: _plain(value) for key, value in problem.info.properties.items()},
        "provenance": [
            {
                "conversion": step.conversion,
                "parameters": {k: _plain(v) for k, v in step.parameters.items()},
                "kind": step.kind,
                "source_node": step.source_node,
                "source": step.source,
            }
            for step in problem.provenance
        ],
        "facts": [{k: _plain(v) for k, v in fact.record().items()} for fact in measured],
    }


def _data_record(value: matrices.Matrix | matrices.Vector) -> dict[str, Any]:
    record: dict[str, Any] = {"shape": list(value.shape), "max_abs": _plain(matrices.max_abs(value))}
    if value.ndim == 2:
        record |= {"storage": "sparse" if matrices.is_sparse(value) else "dense", "nonzeros": matrices.nnz(value)}
    return record


def _plain(value: Any) -> Any:
    """A value that JSON has: NumPy scalars and arrays unpacked, infinities and NaN by name."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (np.ndarray, list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value if isinstance(value, (bool, int, float, str)) or value is None else str(value)
