"""Frictional contact in local (Delassus) form, Acary's P_L: u = Wr + q with Signorini and Coulomb at every contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cpbench.formulations.base import Point, formulations, matrix_field, vector_field
from cpbench.formulations.contact import FCPoint, LocalContact
from cpbench.foundation.matrices import Matrix, Vector


@formulations.register("fc")
@dataclass(frozen=True, eq=False, kw_only=True)
class FrictionContact(LocalContact):
    """u = Wr + q, and for every contact K*_μ ∋ û ⟂ r ∈ K_μ with û = u + μ‖u_T‖e_N (De Saxcé and Feng).

    Rows of a contact are consecutive, normal first: (N, T) for dimension 2, (N, T1, T2) for dimension 3.
    W need not be symmetric. Residuals: see :func:`cpbench.formulations.contact.contact_residuals`.
    """

    node: ClassVar[str] = "fc"
    core: ClassVar[bool] = True
    title: ClassVar[str] = "frictional contact, local"
    equation: ClassVar[str] = "P_L"
    relations: ClassVar[tuple[str, ...]] = ("u = Wr + q", "û = u + μ‖u_T‖e_N", "K*_μ ∋ û ⟂ r ∈ K_μ")
    point_type: ClassVar[type[Point]] = FCPoint
    no_slip: ClassVar[str] = (
        "with T its tangential rows, use fcm with mu = 0 there, V = W[:, T], R = W[T, T], s = q[T], whose lam is r_T; "
        "where no other contact has friction, mlcp with A = W[T, T], C = W[T, N], D = W[N, T], B = W[N, N]"
    )

    W: Matrix = matrix_field("m", "m")
    q: Vector = vector_field("m")
    mu: Vector = vector_field("nc")
