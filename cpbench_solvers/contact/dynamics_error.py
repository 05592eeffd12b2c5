"""When an answer to a global contact problem is good enough: by norms, and by what every connected part feels.

Norms have the reactions in the scale of velocities. Where bodies press on each other and hardly move, reactions are
large: errors as large as the velocities themselves pass. Parts compare velocities with velocities and forces with
forces, in units that make the dynamics, the joints and the contacts of like size (`kernels.dynamics_rows`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.global_contact import GFCPoint, GlobalContact
from cpbench.foundation.matrices import Vector, entries, norm, transpose
from cpbench_solvers.contact.sweeps import kernel


@dataclass(frozen=True, eq=False)
class DynamicsError:
    """The error of answers to one problem.

    Attributes
    ----------
    data : first arguments of the kernel. units : what makes rows of contacts, dynamics and joints even.
    """

    data: tuple[Any, ...]
    units: Vector

    @classmethod
    def of(cls, problem: GlobalContact) -> DynamicsError:
        rows, nc, d = kernel("dynamics_rows"), problem.nc, problem.dimension
        n, p, lengths = problem.f.size, problem.b.size, problem.lengths
        matrices = M, H, G = tuple(entries(A) for A in (problem.M, problem.H, problem.G))
        if not problem.factorization.symmetric:
            M = entries(0.5 * (abs(problem.M) + transpose(abs(problem.M))))
        start = np.zeros(nc + n + p + 1, np.int64)
        count = rows.count(*M[:2], *H[:2], *G[:2], d, nc, start)
        column, size = np.empty(count, np.int64), np.empty(count)
        rows.fill(*M, *H, *G, lengths.ravel(), d, nc, start, column, size)
        part, units = np.empty(start.size - 1, np.int64), np.empty(start.size - 1)
        kernel("row_errors").label_parts((start, column, size), part)
        kernel("equilibration").equilibrate(start, column, size, part.size, units)
        moves = problem.w.reshape(nc, d) * lengths
        constants = np.concatenate([np.sqrt(np.einsum("ij,ij->i", moves, moves)), np.abs(problem.f), np.abs(problem.b)])
        law = (problem.mu, getattr(problem, "mu_r", np.zeros(0)), lengths, problem.rho)
        absolute = not constants.any()
        impulse, velocity = (0.0, 0.0) if absolute else problem.units
        scales = max(impulse, norm(problem.f)), max(velocity, norm(problem.b))
        vectors = (problem.f, problem.w, problem.b, problem.free_velocity)
        felt = (start, column, size, units, part, constants)
        return cls((*matrices, *vectors, law, felt, absolute, *scales), units)

    def __call__(self, point: GFCPoint) -> float:
        """Return the larger one of the error of norms (`GlobalContact.residuals`) and that of the parts.

        That is √Σ‖x̂ − P(x̂ − f̂)‖² of a part, over its contacts, dynamics and joints, or the square of what no answer may
        have in a row, over the constants of the part, which no answer can stretch. Infinite where it is not a number.
        """
        error = kernel("dynamics_error").judged(*self.data, point.v, point.r, point.lam)
        return error if math.isfinite(error) else math.inf
