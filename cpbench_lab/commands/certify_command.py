"""Prove that a solution is near an answer, and show the distance."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from cpbench import storage
from cpbench.api.problems import load, verify
from cpbench.api.results import is_results_file
from cpbench.api.solving import solve
from cpbench.bench import multipliers
from cpbench.bench.results.store import Store
from cpbench.cli.answered import answer_lines
from cpbench.cli.options import force_option, format_option, number, timeout_option, tolerance_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import ADDRESS, PATH
from cpbench.generators.collection import address_text
from cpbench.storage.base import require_new
from cpbench_lab.certificate_text import certificate_lines
from cpbench_lab.certifying import TOLERANCE, certify, certify_first, certify_rows, save_certificate
from cpbench_lab.proved_optima import certify_folder, published_values


@click.command()
@click.argument("problem", metavar="PROBLEM|RESULTS|FOLDER", type=ADDRESS)
@click.option(
    "--all", "everything", is_flag=True, help="All problems in FOLDER, into the folder -o: a table, and certificates."
)
@click.option(
    "--published", metavar="FILE.csv", type=PATH, help="With --all: optimal values of others (problem, value)."
)
@click.option("--answer", type=PATH, help="Answer file (.h5, .npy, .npz, .csv).")
@click.option("-s", "--solver", metavar="NAME[opt=value]", help="Solver, where no answer is given; default: several.")
@tolerance_option
@timeout_option
@click.option("-o", "--output", type=PATH, help="Output file of the certificate, with the answer (.h5).")
@format_option
@force_option
def command(
    problem: str,
    everything: bool,
    published: Path | None,
    answer: Path | None,
    solver: str | None,
    tolerance: float,
    timeout: float,
    output: Path | None,
    file_format: str | None,
    force: bool,
) -> None:
    """Look for a proof that an answer is a solution, and show the distance.

    Polyhedral problems are solved exactly. An answer is proved when it is within the tolerance of the exact solution.
    For others the command looks for a box near the answer that contains a solution (enclosed). An answer is distant
    when a solution is known and the answer is not near it, and stationary when the program is not convex, so that only
    its first-order conditions are proved. If there is no proof, the command says what prevents one. Without an answer
    it also looks for a proof that the problem has no solution (infeasible, unbounded). The program
    cpbench_lab/certificates/checker checks the proof in a file again. The exit code is 0 when the answer is proved or
    enclosed, when there is proved to be none, and when a distant answer meets the tolerance by its error; else 1. With
    RESULTS all stored answers get their level and distance, which cpbench report shows. With --all every problem in a
    folder gets a row in table.csv, with its optimal value; rows that are there stay, values that differ from published
    ones come first, and the exit code is 0.
    """
    if everything or published is not None:
        if not everything or output is None or answer is not None or solver is not None or file_format is not None:
            raise click.UsageError(
                "--all FOLDER needs -o FOLDER, and no --answer, --solver or --format; --published --all"
            )
        values = published_values(published) if published is not None else {}
        print_lines(certify_folder(Path(problem), output, timeout, tolerance, values))
        return
    if is_results_file(problem):
        if answer is not None or solver is not None or output is not None:
            raise click.UsageError("with RESULTS no --answer, --solver or --output: all kept answers are looked at")
        with Store(problem, create=True) as store:
            print_lines(certify_rows(store, timeout))
        return
    if answer is not None and solver is not None:
        raise click.UsageError("give --answer or --solver, not both")
    if output is not None:
        require_new(output, force)
    loaded = load(problem, format=file_format)
    point: Any
    if answer is None and solver is None:
        point, certificate = certify_first(loaded, timeout, tolerance)
    else:
        if answer is not None:
            given = storage.load_answer(answer, loaded, primal=True)
            point, completed = multipliers.whole(loaded, given, tolerance)
            print_lines([f"  {completed}"] if completed else [])
        else:
            point = solve(loaded, solver, tolerance=TOLERANCE)
        certificate = certify(loaded, point, seconds=timeout, tolerance=tolerance)
    told, solved = f"{address_text(problem)}: ", False
    if certificate.answer.size:
        verdict = verify(loaded, point, tolerance=tolerance)
        told, solved = f"{told}error {number(verdict.error)}, ", verdict.solved and "stationary" not in verdict.flags
    click.echo(f"{told}{certificate.level}")
    far = solved and certificate.level == "distant"
    print_lines(certificate_lines(certificate))
    if far:
        click.echo(f"  answer     meets the tolerance {tolerance:g} by its error, away from the solution that is known")
    if certificate.answer.size:
        print_lines(answer_lines(loaded, loaded.point_from_vector(certificate.answer), tolerance))
    if output is not None:
        save_certificate(certificate, loaded, output, force=force)
    if not (certificate or far):
        sys.exit(1)
