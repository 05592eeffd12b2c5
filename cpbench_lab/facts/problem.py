"""The facts of a whole problem: those of its matrices, and what a contact problem or a block matrix adds."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from cpbench.formulations import MLCP, Problem
from cpbench.formulations.contact import ContactProblem, DelassusContact, without_motion
from cpbench.foundation import matrices
from cpbench.foundation.matrices import PSD_TOLERANCE, Matrix
from cpbench_lab.facts.fact import Fact, How, decided
from cpbench_lab.facts.sign_classes import p_matrix, z_matrix
from cpbench_lab.facts.spectrum import SCALED, definiteness, rank, symmetry

_OTHER_SETS = frozenset({("mlcp", "A"), ("qp", "Q"), ("coneqp", "Q"), ("soclcp", "M")})
"""Square matrices whose unknowns do not live in an orthant or a box: the classes of the LCP say nothing of them."""


def of_problem(problem: Problem) -> tuple[Fact, ...]:
    """Return all facts of a problem, matrix by matrix in the order of its definition."""
    facts: list[Fact] = []
    contact = isinstance(problem, ContactProblem)
    for f in fields(problem):
        shape = f.metadata.get("shape", ())
        if len(shape) != 2 or shape[1].isdigit():  # a table of coefficients is not an operator
            continue
        M = getattr(problem, f.name)
        classes = not contact and (problem.node, f.name) not in _OTHER_SETS
        facts += of_matrix(M, f.name, square=shape[0] == shape[1], classes=classes)
    if isinstance(problem, MLCP):
        whole = matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
        facts.append(definiteness(whole, "[[A, C], [D, B]]"))
    if contact:
        facts += _contact(problem, {f.matrix: f for f in facts if f.name == "rank"})
    return tuple(map(decided, facts))


def of_matrix(M: Matrix, name: str, *, square: bool | None = None, classes: bool = True) -> list[Fact]:
    """Decide rank, and for a square matrix symmetry and definiteness; with `classes` also Z and P."""
    if square is None:
        square = M.shape[0] == M.shape[1]
    if not square:
        return [rank(M, name)]
    known = definiteness(M, name)
    result = [symmetry(M, name), known, rank(M, name, known=known)]
    if classes:
        result += [z_matrix(M, name), p_matrix(M, name, known)]
    return result


def _contact(problem: ContactProblem, ranks: dict[str, Fact]) -> list[Fact]:
    mu = np.asarray(matrices.dense(problem.mu))
    smooth = mu == 0 if mu.ndim == 1 else (mu == 0).all(axis=1)
    rows = problem.nc * problem.dimension
    result = [
        Fact("contacts", "", problem.nc, How.EXACT),
        Fact("frictionless contacts", "", int(smooth.sum()), How.EXACT, evidence="μ = 0"),
    ]
    if immobile := without_motion(problem):
        text = f"{immobile[:8]}: no force moves them along their normals, as a joint carries it"
        result.append(Fact("contacts with W_NN = 0", "", len(immobile), How.FACTORIZATION, evidence=text))
    if isinstance(problem, DelassusContact):
        result += _diagonal_blocks(problem)
    operator = "W" if "W" in ranks else "H"
    known: Any = ranks.get(operator)
    if known is not None:
        count = None if known.value is None else rows - int(known.value)
        evidence = f"{rows} reaction components less rank of {operator}" if count is not None else known.evidence
        result.append(Fact("hyperstaticity", "", count, known.how, evidence=evidence))
    return result


def _diagonal_blocks(problem: DelassusContact) -> list[Fact]:
    """Examine W_cc of every contact, on which block methods (NSGS) rest: symmetric? least eigenvalue?"""
    blocks, name = problem.diagonal_blocks, "W_cc"
    if not len(blocks):
        return []
    skew = matrices.block_asymmetry(blocks)
    least = np.linalg.eigvalsh(np.stack([matrices.unit_diagonal(block) for block in blocks]))[:, 0]
    word = "positive definite" if (least > 1e-14).all() else "positive semidefinite"
    if (least < -PSD_TOLERANCE).any():
        word = "indefinite"
    worst = int(least.argmin())
    evidence = f"{int((least <= 1e-14).sum())} of {len(blocks)} are not definite; least eigenvalue {SCALED}"
    return [
        Fact(
            "symmetry",
            name,
            bool((skew <= matrices.SYMMETRY_TOLERANCE).all()),
            How.EXACT,
            float(skew.max()),
            matrices.SYMMETRY_TOLERANCE,
            f"largest asymmetry, contact {int(skew.argmax()) + 1},",
        ),
        Fact("definiteness", name, word, How.FACTORIZATION, float(least[worst]), evidence=evidence),
    ]
