"""Rolling friction in local form: forces and moments at every contact, u = Wr + q."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cpbench.formulations.base import Point, formulations, matrix_field, vector_field
from cpbench.formulations.contact import FCPoint, LocalContact
from cpbench.foundation.matrices import Matrix, Vector


@formulations.register("rfc")
@dataclass(frozen=True, eq=False, kw_only=True)
class RollingFrictionContact(LocalContact):
    """u = Wr + q; K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}, K* ∋ û ⟂ r ∈ K with û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N.

    Rows of a contact: (N, T1, T2, M1, M2) for dimension 5, (N, T, M) for dimension 3 (plane problems). The law
    is that of Acary and Bourrier, Coulomb friction with rolling resistance as a cone complementarity problem (2021).
    """

    node: ClassVar[str] = "rfc"
    title: ClassVar[str] = "rolling frictional contact, local"
    equation: ClassVar[str] = "P_L, rolling"
    relations: ClassVar[tuple[str, ...]] = (
        "u = Wr + q",
        "û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N",
        "K* ∋ û ⟂ r ∈ K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}",
    )
    point_type: ClassVar[type[Point]] = FCPoint
    dimensions: ClassVar[tuple[int, ...]] = (3, 5)

    W: Matrix = matrix_field("m", "m")
    q: Vector = vector_field("m")
    mu: Vector = vector_field("nc")
    mu_r: Vector = vector_field("nc")
    dimension: int = 5
