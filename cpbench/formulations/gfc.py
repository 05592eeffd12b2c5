"""Frictional contact in global form, Acary's P_LM: Mv = Hr + Gλ + f, Gᵀv + b = 0, u = Hᵀv + w, contact law of `fc`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from cpbench.formulations.base import Point, formulations, matrix_field, vector_field
from cpbench.formulations.global_contact import GFCPoint, GlobalContact
from cpbench.foundation.matrices import Matrix, Vector


@formulations.register("gfc")
@dataclass(frozen=True, eq=False, kw_only=True)
class GlobalFrictionContact(GlobalContact):
    """Mv = Hr + Gλ + f, Gᵀv + b = 0, u = Hᵀv + w, K*_μ ∋ û ⟂ r ∈ K_μ at every contact.

    G and b are bilateral constraints (joints), empty by default; w is 0 by default. M need not be symmetric.
    """

    node: ClassVar[str] = "gfc"
    core: ClassVar[bool] = True
    title: ClassVar[str] = "frictional contact, global"
    equation: ClassVar[str] = "P_LM"
    relations: ClassVar[tuple[str, ...]] = (
        "Mv = Hr + Gλ + f",
        "Gᵀv + b = 0",
        "u = Hᵀv + w",
        "û = u + μ‖u_T‖e_N",
        "K*_μ ∋ û ⟂ r ∈ K_μ",
    )
    point_type: ClassVar[type[Point]] = GFCPoint
    no_slip: ClassVar[str] = (
        "with T its tangential rows, set mu = 0 there and append H[:, T] to G and w[T] to b, so that lam has its r_T"
    )

    M: Matrix = matrix_field("n", "n")
    H: Matrix = matrix_field("n", "m")
    G: Matrix = matrix_field("n", "p", optional=True)
    f: Vector = vector_field("n")
    w: Vector = vector_field("m", fill=0.0)
    b: Vector = vector_field("p", fill=0.0)
    mu: Vector = vector_field("nc")
