"""Write the built-in problems again from their formulas, or check them; or simulate a scene."""

from __future__ import annotations

import filecmp
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from cpbench.cli.options import Command, ListOption, force_option, seed_option, tolerance_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import COUNT, DURATION, FILE
from cpbench.foundation.extensions import hook
from cpbench.generators.base import SMALL, TIERS
from cpbench.generators.collection import NAME, TIER_SHEETS, VERSION, builtin_folder, write_collections
from cpbench.storage.base import require_new


@click.command(cls=Command)
@click.argument("folder", required=False, type=click.Path(path_type=Path, file_okay=False))
@click.option(
    "--collection", "names", cls=ListOption, metavar="NAME", help="Collection to write; needs FOLDER. Repeatable."
)
@click.option(
    "--tier",
    type=click.Choice(TIERS),
    default=SMALL,
    show_default=True,
    help="Problems to write: small ones are shipped; others need FOLDER.",
)
@click.option("--check", is_flag=True, help="Write nothing; exit with 1 unless the files are the same bit for bit.")
@click.option("--scene", metavar="NAME", help="Scene to simulate, instead of built-in problems; needs -o.")
@click.option("--size", type=COUNT, help="Bodies of the scene: cubes, bricks, stones, balls, links, ...  [default: 10]")
@click.option("--steps", type=COUNT, help="Number of time steps.  [default: 50]")
@click.option("--dt", type=DURATION, help="Time step.  [default: 5ms]")
@click.option("--mu", type=float, help="Coefficient of friction; default: that of the scene.")
@click.option("--mass-ratio", type=float, help="Mass of the heaviest body over that of the lightest.  [default: 1]")
@seed_option("Seed of the random numbers of the scene.")
@click.option("-s", "--solver", metavar="NAME", help="Solver by which the bodies move; default: cpbench chooses.")
@tolerance_option
@click.option("-o", "--output", type=FILE, metavar="FILE", help="File of the scene (.h5).")
@force_option
@click.pass_context
def command(
    ctx: click.Context,
    folder: Path | None,
    names: tuple[str, ...],
    tier: str,
    check: bool,
    scene: str | None,
    **chosen: Any,
) -> None:
    """Write the built-in problems again from their formulas (default: into the shipped folder), or a scene.

    The standard tier has up to 100,000 unknowns, the large tier up to a million; each collection is written before the
    next one is made. The exit code is 1 unless all are those of the published collection. The recorded sequences
    contact-sequence and contact-sequence-global are written only when they are named.

    With --scene, rigid bodies move under gravity by Moreau and Jean's time stepping, and the contact problem of each
    step is written in local and in global form: arch, chain, chute, clusters, falling-arch, grasp, rolling-heap,
    spheres, tower, trough, wall. The exit code is 1 unless all answers meet the tolerance.
    """
    if scene is not None:
        if folder is not None or names or check:
            raise click.UsageError("--scene goes with -o FILE, not with a FOLDER, --collection or --check")
        _simulate(scene, **chosen)
        return
    for name in chosen:
        if ctx.get_parameter_source(name) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"--{name.replace('_', '-')} is of a scene: add --scene NAME")
    if names and folder is None:
        raise click.UsageError("--collection needs a FOLDER to write to: the shipped one holds the built-in problems")
    if tier != SMALL:
        if folder is None or names or check:
            raise click.UsageError(
                f"--tier {tier} needs a FOLDER to write to, and goes without --collection and --check"
            )
        _write_tier(folder, tier)
        return
    target = folder or builtin_folder()
    if not check:
        for path in write_collections(target, names):
            click.echo(str(path))
        return
    with tempfile.TemporaryDirectory() as fresh:
        different = [
            str(path.relative_to(fresh))
            for path in write_collections(Path(fresh), names)
            if not (target / path.relative_to(fresh)).exists()
            or not filecmp.cmp(path, target / path.relative_to(fresh), shallow=False)
        ]
    for name in different:
        click.echo(f"differs: {target / name}", err=True)
    if different:
        sys.exit(1)
    click.echo(f"{target}: every file is what its formula gives, bit for bit")


def _write_tier(folder: Path, tier: str) -> None:
    """Write a tier that is not shipped, and compare its sheets with those of the published collection."""
    published = builtin_folder() / TIER_SHEETS / tier
    different: list[str] = []
    for path in write_collections(folder, tier=tier):
        click.echo(str(path))
        sheet = published / path.relative_to(folder)
        if path.suffix == ".toml" and not (sheet.exists() and filecmp.cmp(path, sheet, shallow=False)):
            different.append(str(path))
    for name in different:
        click.echo(f"not as published: {name}", err=True)
    if different:
        sys.exit(1)
    click.echo(f"{folder}: every problem is that of {NAME} {VERSION}")


def _simulate(name: str, output: Path | None, steps: int | None, solver: str | None, tolerance: float, force: bool,
              **chosen: Any) -> None:  # fmt: skip
    """Simulate a scene, with a counter on a terminal, and write it."""
    if output is None:
        raise click.UsageError("--scene needs -o FILE, the file to write")
    require_new(output, force)
    simulation = hook("simulate_scene")(name, solver, tolerance, **chosen)
    count = steps or 50
    with click.progressbar(simulation.run(count), length=count, label=name, file=sys.stderr) as made:
        for _ in made:
            pass
    source = command_of(name, count, solver, tolerance, chosen)
    print_lines(hook("write_scene")(simulation, output, source, force=force))
    if simulation.missed:
        sys.exit(1)


def command_of(name: str, steps: int, solver: str | None, tolerance: float, chosen: Mapping[str, Any]) -> str:
    """Return the command that makes a scene again, without the name of its file; what is None is left out.

    >>> command_of("tower", 50, None, 1e-6, {"size": 8, "mass_ratio": None, "seed": 0})
    'cpbench generate --scene tower --steps 50 --tolerance 1e-06 --size 8 --seed 0'
    """
    values = {"steps": steps, "solver": solver, "tolerance": tolerance, **chosen}
    given = (f"--{key.replace('_', '-')} {value}" for key, value in values.items() if value is not None)
    return " ".join(["cpbench generate --scene", name, *given])
