"""Tell whether a physics engine satisfies its own law, step by step, and how far that law is from Coulomb's."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np

from cpbench.cli.options import json_option, tolerance_option
from cpbench.cli.terminal import print_lines, table
from cpbench.cli.types import FOLDER
from cpbench.errors import CpbenchError, NotApplicable
from cpbench_lab.audit.auditing import HEAD, Audit, audit, cells, compared, read_audits, scenes, write_folder


@click.command()
@click.argument("engine", metavar="ENGINE|A.json")
@click.argument("scene", metavar="SCENE|B.json")
@click.option("--steps", type=click.IntRange(1), default=1000, show_default=True, help="Steps of each scene.")
@click.option("--engine-option", "given", multiple=True, metavar="NAME=VALUE", help="Of the engine, as cone=elliptic.")
@click.option("--compare", is_flag=True, help="Compare two files of --json, as of two versions of an engine.")
@click.option("-o", "--output", type=FOLDER, help="Folder for the figure over time and the worst step.")
@tolerance_option
@json_option
def command(
    engine: str, scene: str, steps: int, given: tuple[str, ...], compare: bool, output: Path | None,
    tolerance: float, as_json: bool,
) -> None:  # fmt: skip
    """Tell whether the answers of a physics engine satisfy the engine's own law, and which step is the worst.

    ENGINE is mujoco, or one of a plugin (`cpbench new engine` writes one). SCENE is a file of the engine, the name
    of a scene that ships, or `all` for these. Each step is a problem in the law of the engine, and its answer has the
    verdict of every answer; beside it stands the error on Coulomb's law. What the engine says of itself counts for
    nothing. The exit code is 1 where a step breaks the law, and with --compare where B breaks more than A.

    \b
      cpbench audit mujoco pile --steps 200 --engine-option cone=pyramidal
      cpbench audit mujoco all --steps 200 --json > new.json
      cpbench audit --compare old.json new.json
    """
    if compare:
        lines, worse = compared(read_audits(Path(engine)), read_audits(Path(scene)))
        print_lines(lines)
        sys.exit(int(worse))
    options = dict(map(_option, given))
    every = scenes() if scene == "all" else [scene]
    audits: list[Audit] = []
    refused: list[str] = []
    for one in every:
        try:
            audits.append(audit(engine, one, steps=steps, options=options, tolerance=tolerance))
        except NotApplicable as cause:  # the engine has no law for the scene, or does not read it
            if scene != "all" or (one == every[-1] and not audits):
                raise
            refused.append(f"  not audited: {cause}")
    if as_json:
        click.echo(json.dumps([one.record() for one in audits], allow_nan=False))
    else:
        print_lines([*(_table(audits) if len(audits) > 1 else audits[0].lines()), *refused])
    for one in audits if output else []:
        print_lines((f"  {path}" for path in write_folder(one, output)), err=as_json)
    sys.exit(int(any(one.broken.any() for one in audits)))


def _option(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise CpbenchError(f"--engine-option {text}: write NAME=VALUE, as in cone=elliptic")
    return name, value


def _table(audits: list[Audit]) -> Iterator[str]:
    broken, head = np.concatenate([one.broken for one in audits]), audits[0].head
    yield f"{broken.sum()} of {broken.size} steps break the engine's own law at {head['tolerance']:g}"
    yield f"  {head['engine']} {head['version']}; law: {head['law']}"
    yield from table([HEAD, *map(cells, audits)])
