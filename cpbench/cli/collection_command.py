"""List and write the problems of cpbench, simulate scenes, and check the problem files that others publish."""

from __future__ import annotations

import filecmp
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import click

from cpbench.cli import Group
from cpbench.cli.options import ListOption, force_option, seed_option, tolerance_option
from cpbench.cli.terminal import print_lines, table
from cpbench.cli.types import COUNT, DURATION, FILE, FOLDER
from cpbench.foundation.extensions import hook
from cpbench.foundation.text import counted, some_of
from cpbench.generators.base import SMALL, TIERS
from cpbench.generators.collection import (
    NAME,
    TIER_FOLDER,
    VERSION,
    ListedProblem,
    builtin_folder,
    catalogue,
    identity,
    write_collections,
)
from cpbench.storage.base import require_new
from cpbench.storage.collections import added, manifests

SHOWN = 5
"""Names of files that a line shows."""


def first_line(entries: Sequence[ListedProblem]) -> str:
    """Return the identity of the collection, and how many problems each tier has."""
    counts = Counter(entry.tier for entry in entries)
    counted_tiers = [f"{counts[tier]} {tier}" for tier in TIERS if tier != SMALL and counts[tier]]
    rest = f"; {' and '.join(counted_tiers)}, which cpbench collection generate --tier writes" if counted_tiers else ""
    return f"{identity(entries)}: {counts[SMALL]} {SMALL}, installed as files{rest}"


def formulation_rows(entries: Sequence[ListedProblem]) -> Iterator[tuple[str, ...]]:
    """Yield a head, a row for each formulation, and one of sums: families, problems, those of each tier, proofs."""
    yield "formulation", "families", "problems", *TIERS, "proved"
    by_node: dict[str, list[ListedProblem]] = {}
    for entry in entries:
        by_node.setdefault(entry.node, []).append(entry)
    for node in sorted(by_node):
        yield _counts(node, by_node[node])
    yield _counts("all", entries)


def _counts(name: str, entries: Sequence[ListedProblem]) -> tuple[str, ...]:
    tiers = Counter(entry.tier for entry in entries)
    numbers = (len({(entry.node, entry.family) for entry in entries}), len(entries))
    proved = sum(bool(entry.proof) for entry in entries)
    parts = (*numbers, *(tiers[tier] for tier in TIERS), proved)
    return name, *(str(part) if part else "·" for part in parts)


@click.group("collection", cls=Group)
def command() -> None:
    """List and write the problems of cpbench, simulate scenes, and check the problem files that others publish.

    Of collections of others cpbench has the facts: where their files are, their licences, sizes and hashes. It has none
    of their files, and downloads none. A collection that is there is an address as that of a file is: `cpbench run
    collection/maros-meszaros`, `cpbench info collection/diphasic/diphasic-Ma.txt`.
    """


@command.command("list")
def list_collections() -> None:
    """Count the problems of cpbench by formulation, tier and proof; list the collections of others, with formulations,
    formats, files, licences and sources."""
    entries = catalogue()
    print_lines([first_line(entries), "", *table(formulation_rows(entries)), ""])
    print_lines(["Collections of others (cpbench collection verify says where they go):"])
    print_lines(table(_rows()))


def _rows() -> Iterator[tuple[str, ...]]:
    yield "collection", "formulation", "format", "files", "size", "licence", "source"
    for manifest in map(manifests.manifest, manifests.names()):
        size = size_text(manifest.size) if manifest.files else "unknown"
        yield (
            manifest.name,
            manifest.formulation or "none",
            manifest.reader or "not read",
            manifest.extent,
            size,
            manifest.licence,
            manifest.source,
        )


@command.command("verify")
@click.argument("names", nargs=-1, metavar="[NAME]...")
def verify(names: tuple[str, ...]) -> None:
    """Check the files of collections against their hashes, and say which are there and where the others go.

    The exit code is 1 where files are missing or have another content, or a named collection is not there.
    """
    wrong = False
    for manifest in map(manifests.manifest, names or manifests.names()):
        checked = added.check(manifest)
        if checked is None:
            wrong |= bool(names)
            print_lines([f"{manifest.name}: not there; {added.how_to_add(manifest)}"])
        else:
            wrong |= bool(checked.changed or checked.missing)
            whole = sum(file in manifest.files and file not in checked.changed for file in checked.files)
            line = f"{manifest.name}: {_extent(checked)}, {whole} as the manifest has them, in {checked.folder}"
            print_lines([line, *_lacking(checked)])
    sys.exit(int(wrong))


@command.command("generate")
@click.argument("folder", required=False, type=FOLDER)
@click.option("--family", "names", cls=ListOption, metavar="NAME", help="Family to write; needs FOLDER. Repeatable.")
@click.option(
    "--tier",
    type=click.Choice(TIERS),
    default=SMALL,
    show_default=True,
    help="Problems to write: small ones are shipped; others need FOLDER.",
)
@click.option("--check", is_flag=True, help="Write nothing; exit with 1 unless the files are the same bit for bit.")
def generate(folder: Path | None, names: tuple[str, ...], tier: str, check: bool) -> None:
    """Write the built-in problems again from their formulas, into FOLDER or the shipped one.

    The standard tier has up to 100,000 unknowns, the large tier up to a million; each family is written before the
    next one is made. The exit code is 1 unless all are those of the published collection.
    """
    if names and folder is None:
        raise click.UsageError("--family needs a FOLDER to write to: the shipped one holds the built-in problems")
    if tier != SMALL:
        if folder is None or names or check:
            raise click.UsageError(f"--tier {tier} needs a FOLDER to write to, and goes without --family and --check")
        written = write_collections(folder, tier=tier)
        tables = (path for path in _shown(written) if path.suffix == ".toml")
        _require_same(tables, folder, builtin_folder() / TIER_FOLDER / tier, "not as published")
        click.echo(f"{folder}: every problem is that of {NAME} {VERSION}")
    elif check:
        target = folder or builtin_folder()
        with tempfile.TemporaryDirectory() as fresh:
            _require_same(write_collections(Path(fresh), names), Path(fresh), target, "differs")
        click.echo(f"{target}: every file is what its formula gives, bit for bit")
    else:
        for path in write_collections(folder or builtin_folder(), names):
            click.echo(str(path))


def _shown(paths: Iterable[Path]) -> Iterator[Path]:
    for path in paths:
        click.echo(str(path))
        yield path


def _require_same(paths: Iterable[Path], folder: Path, other: Path, what: str) -> None:
    """Exit with 1 unless the files of a folder are in the other one, bit for bit."""
    pairs = [(path, other / path.relative_to(folder)) for path in paths]
    different = [file for path, file in pairs if not (file.exists() and filecmp.cmp(path, file, shallow=False))]
    print_lines((f"{what}: {file}" for file in different), err=True)
    if different:
        sys.exit(1)


@command.command("scene")
@click.argument("name")
@click.option("--size", type=COUNT, help="Bodies: cubes, bricks, stones, balls, links, ...  [default: 10]")
@click.option("--steps", type=COUNT, default=50, show_default=True, help="Number of time steps.")
@click.option("--dt", type=DURATION, help="Time step.  [default: 5ms]")
@click.option("--mu", type=float, help="Coefficient of friction; default: that of the scene.")
@click.option("--mass-ratio", type=float, help="Mass of the heaviest body over that of the lightest.  [default: 1]")
@seed_option("Seed of the random numbers.")
@click.option("-s", "--solver", metavar="NAME", help="Solver by which the bodies move; default: cpbench chooses.")
@tolerance_option
@click.option("-o", "--output", type=FILE, required=True, metavar="FILE", help="File of the problems (.h5).")
@force_option
def scene(
    name: str, steps: int, solver: str | None, tolerance: float, output: Path, force: bool, **chosen: Any
) -> None:
    """Simulate rigid bodies, and write the contact problem of each step in local and in global form.

    Bodies move under gravity by Moreau and Jean's time stepping: arch, chain, chute, clusters, falling-arch, grasp,
    rolling-heap, spheres, tower, trough, wall. The exit code is 1 unless all answers meet the tolerance.
    """
    require_new(output, force)
    simulation = hook("simulate_scene")(name, solver, tolerance, **chosen)
    with click.progressbar(simulation.run(steps), length=steps, label=name, file=sys.stderr) as states:
        for _ in states:
            pass
    values = {"steps": steps, "solver": solver, "tolerance": tolerance, **chosen}
    given = [f"--{key.replace('_', '-')} {value}" for key, value in values.items() if value is not None]
    source = " ".join(["cpbench collection scene", name, *given])
    print_lines(hook("write_scene")(simulation, output, source, force=force))
    if simulation.missed:
        sys.exit(1)


def _extent(files: added.LocalFiles) -> str:
    return f"{counted(len(files.files), 'file')}, {size_text(files.size)}"


def _lacking(checked: added.LocalFiles) -> Iterator[str]:
    """Yield a line each on files that are missing or have another content."""
    for files, what in ((checked.missing, "missing"), (checked.changed, "with another content (SHA-256)")):
        if files:
            yield f"  {len(files)} {what}: {some_of(files, SHOWN)}"


def size_text(size: int) -> str:
    """Return a number of bytes in kB or MB.

    >>> size_text(18881), size_text(5216409)
    ('18.9 kB', '5.22 MB')
    """
    return f"{size / 1e3:.3g} kB" if size < 1e6 else f"{size / 1e6:.3g} MB"
