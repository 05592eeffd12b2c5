"""`cpbench certify`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from cpbench import storage
from cpbench.api.certifying import TOLERANCE, certificate_lines, certify, certify_first, certify_rows, save_certificate
from cpbench.api.problems import load, verify
from cpbench.api.results import is_results_file
from cpbench.api.solving import solve
from cpbench.bench.results.store import Store
from cpbench.cli.options import Command, force_option, format_option, number, timeout_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import ADDRESS, PATH
from cpbench.generators.collection import address_text
from cpbench.storage.base import require_new


@click.command(cls=Command)
@click.argument("problem", metavar="PROBLEM|RESULTS", type=ADDRESS)
@click.option("--answer", type=PATH, help="Answer file (.h5, .npy, .npz, .csv).")
@click.option("-s", "--solver", metavar="NAME[opt=value]", help="Solver, where no answer is given; default: several.")
@timeout_option
@click.option("-o", "--output", type=PATH, help="Output file of the certificate (.h5).")
@format_option
@force_option
def command(
    problem: str,
    answer: Path | None,
    solver: str | None,
    timeout: float,
    output: Path | None,
    file_format: str | None,
    force: bool,
) -> None:
    """Look for a proof that a solution is near an answer, and show the distance.

    Polyhedral problems are solved exactly (proved). For others the command looks for a box around the answer that
    contains a solution (enclosed), or contains none (refuted). If there is no proof, it says what prevents one. The
    program in cpbench/certificates/checker checks the proof in a file again. The exit code is 1 unless a solution is
    proved or enclosed. With RESULTS all stored answers get their level and distance, as by cpbench run --certify;
    cpbench report shows them.
    """
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
        point, certificate = certify_first(loaded, timeout)
    else:
        point = storage.load_answer(answer, loaded) if answer else solve(loaded, solver, tolerance=TOLERANCE)
        certificate = certify(loaded, point, seconds=timeout)
    click.echo(f"{address_text(problem)}: error {number(verify(loaded, point).error)}, {certificate.level}")
    print_lines(certificate_lines(certificate))
    if output is not None:
        save_certificate(certificate, loaded, output, force=force)
    if not certificate:
        sys.exit(1)
