"""Rolling friction in global form: Mv = Hr + Gλ + f, Gᵀv + b = 0, u = Hᵀv + w, contact law of `rfc`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cpbench.formulations.base import Point, formulations, matrix_field, vector_field
from cpbench.formulations.global_contact import GFCPoint, GlobalContact
from cpbench.foundation.matrices import Matrix, Vector


@formulations.register("grfc")
@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalRollingFrictionContact(GlobalContact):
    """Mv = Hr + Gλ + f, Gᵀv + b = 0, u = Hᵀv + w, K* ∋ û ⟂ r ∈ K with the rolling cone of `rfc`.

    Rows of a contact: (N, T1, T2, M1, M2) for dimension 5, (N, T, M) for dimension 3.
    """

    node: ClassVar[str] = "grfc"
    title: ClassVar[str] = "rolling frictional contact, global"
    equation: ClassVar[str] = "P_LM, rolling"
    relations: ClassVar[tuple[str, ...]] = (
        "Mv = Hr + Gλ + f",
        "Gᵀv + b = 0",
        "u = Hᵀv + w",
        "û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N",
        "K* ∋ û ⟂ r ∈ K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}",
    )
    point_type: ClassVar[type[Point]] = GFCPoint
    dimensions: ClassVar[tuple[int, ...]] = (3, 5)

    M: Matrix = matrix_field("n", "n")
    H: Matrix = matrix_field("n", "m")
    G: Matrix = matrix_field("n", "p", optional=True)
    f: Vector = vector_field("n")
    w: Vector = vector_field("m")
    b: Vector = vector_field("p", fill=0.0)
    mu: Vector = vector_field("nc")
    mu_r: Vector = vector_field("nc")
    dimension: int = 5
