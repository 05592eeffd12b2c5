"""Siconos' solvers of frictional contact in global form (gfc3d_Solvers.h), for `gfc` of dimension 3.

M and H are sparse. Those whose name ends in -wr condense to the local form first, which prints on stdout. Siconos has
no joints (G, b) in this form, and no driver for the plane.

Left out, for Debian's library cannot run them: SICONOS_GLOBAL_FRICTION_3D_GAMS_PATH and _GAMS_PATHVI (without GAMS).
"""

from __future__ import annotations

from typing import Any

from cpbench.solvers.adapters.siconos import SiconosEntry, SiconosSolver, register_family
from cpbench.solvers.adapters.siconos_tolerances import Bound

REVIEW = "Acary, Brémond and Huber, On solving contact problems with Coulomb friction (2018)"
JEAN = "Jean, The non-smooth contact dynamics method, CMAME 177 (1999)"
ALART = "Alart and Curnier, A mixed formulation for frictional contact problems, CMAME 92 (1991)"
ACARY = "Acary, Cadoux, Lemaréchal and Malick, A formulation of Coulomb friction, ZAMM 91 (2011)"
PANG = "Facchinei and Pang, Finite-Dimensional Variational Inequalities (2003), chapter 12"
ADMM = "Boyd et al., Distributed optimization and statistical learning via ADMM (2011)"


class SiconosGFC3D(SiconosSolver):
    """A solver of Siconos for frictional contact in space, global form, no joints."""

    node = "gfc"

    def obstacle(self, problem: Any) -> str | None:
        if problem.dimension != 3:
            return f"is for contacts of 3 rows, these have {problem.dimension}"
        if problem.b.size:
            return f"has {problem.b.size} rows of joints, which Siconos has not in this form"
        if not problem.nc:
            return "has no contacts: Siconos asserts that there are some and aborts"
        return super().obstacle(problem)


register_family(
    SiconosGFC3D,
    SiconosEntry(
        name="siconos-gfc3d-nsgs-wr",
        constant="SICONOS_GLOBAL_FRICTION_3D_NSGS_WR",
        summary="condensed; Gauss–Seidel over the contacts, Alart–Curnier Newton with projections in each",
        method="block Gauss–Seidel",
        citation=JEAN,
        warm=True,
        storage="sparse",
        by_default=True,
        early={"mass-unit-1e+08": 2.4e-02},
    ),
    SiconosEntry(
        name="siconos-gfc3d-nsgsv-wr",
        constant="SICONOS_GLOBAL_FRICTION_3D_NSGSV_WR",
        summary="condensed; Gauss–Seidel in velocities, whose default for its contacts it does not know",
        method="block Gauss–Seidel",
        citation=JEAN,
        storage="dense",
        failures={
            "check_answers_have_their_shape": "exit code 1: unknown internal solver FC3D_ONECONTACT_NSN",
            "check_claims_are_true": "exit code 1: unknown internal solver FC3D_ONECONTACT_NSN",
            "check_one_iteration_claims_nothing_false": "exit code 1: unknown internal solver FC3D_ONECONTACT_NSN",
            "check_some_case_is_solved": "exit code 1: unknown internal solver FC3D_ONECONTACT_NSN",
            "check_the_problem_stays": "exit code 1: unknown internal solver FC3D_ONECONTACT_NSN",
            "check_the_same_twice": "exit code 1: unknown internal solver FC3D_ONECONTACT_NSN",
        },
    ),
    SiconosEntry(
        name="siconos-gfc3d-prox-wr",
        constant="SICONOS_GLOBAL_FRICTION_3D_PROX_WR",
        summary="condensed; proximal point, semismooth Newton inside",
        method="proximal point",
        citation=REVIEW,
        storage="sparse",
        bound=Bound.OUTER,
        false={"mass-unit-1e-08": 6.9e-02, "mass-unit-1e+08": 4.4e-01},
    ),
    SiconosEntry(
        name="siconos-gfc3d-dsfp-wr",
        constant="SICONOS_GLOBAL_FRICTION_3D_DSFP_WR",
        summary="condensed; De Saxcé's fixed point (Uzawa), ρ = 1",
        method="projection",
        citation="De Saxcé and Feng, The bipotential method, Math. Comput. Modelling 28 (1998)",
        warm=True,
        storage="sparse",
        false={"mass-unit-1e-08": 4.1e276},
    ),
    SiconosEntry(
        name="siconos-gfc3d-tfp-wr",
        constant="SICONOS_GLOBAL_FRICTION_3D_TFP_WR",
        summary="condensed; Tresca fixed point",
        method="fixed point",
        citation="Haslinger, Least square method for solving contact problems with friction (1984)",
        warm=True,
        storage="sparse",
        bound=Bound.OUTER,
        false={"mass-unit-1e-08": 3.5e-01, "mass-unit-1e+08": 3.3e-01},
    ),
    SiconosEntry(
        name="siconos-gfc3d-nsn-ac-wr",
        constant="SICONOS_GLOBAL_FRICTION_3D_NSN_AC_WR",
        summary="condensed; semismooth Newton on the Alart–Curnier function",
        method="semismooth Newton",
        citation=ALART,
        warm=True,
        storage="sparse",
        bound=Bound.NEWTON,
        false={"mass-unit-1e-08": 6.9e-02},
    ),
    SiconosEntry(
        name="siconos-gfc3d-admm-wr",
        constant="SICONOS_GLOBAL_FRICTION_3D_ADMM_WR",
        summary="condensed; alternating direction method of multipliers",
        method="ADMM",
        citation=ADMM,
        storage="sparse",
        bound=Bound.SPLITTING,
        false={"mass-unit-1e-08": 4.9e-01},
    ),
    SiconosEntry(
        name="siconos-gfc3d-nsgs",
        constant="SICONOS_GLOBAL_FRICTION_3D_NSGS",
        summary="Gauss–Seidel over the contacts with the velocities of the bodies",
        method="block Gauss–Seidel",
        citation=JEAN,
        warm=True,
        storage="sparse",
    ),
    SiconosEntry(
        name="siconos-gfc3d-nsn-ac",
        constant="SICONOS_GLOBAL_FRICTION_3D_NSN_AC",
        summary="semismooth Newton on the Alart–Curnier function and the dynamics",
        method="semismooth Newton",
        citation=ALART,
        warm=True,
        storage="sparse",
        bound=Bound.NEWTON,
        false={"mass-unit-1e-08": 2.3e-02, "mass-unit-1e+08": 9.6e-02},
    ),
    SiconosEntry(
        name="siconos-gfc3d-vi-fpp",
        constant="SICONOS_GLOBAL_FRICTION_3D_VI_FPP",
        summary="fixed point of the projection, step size by itself",
        method="projection",
        citation=PANG,
        warm=True,
        storage="sparse",
        impossible=("squeezed",),
    ),
    SiconosEntry(
        name="siconos-gfc3d-vi-eg",
        constant="SICONOS_GLOBAL_FRICTION_3D_VI_EG",
        summary="extragradient, step size by itself",
        method="extragradient",
        citation="Khobotov, A modification of the extragradient method, USSR Comp. Math. 27 (1987)",
        warm=True,
        storage="sparse",
    ),
    SiconosEntry(
        name="siconos-gfc3d-aclmfp",
        constant="SICONOS_GLOBAL_FRICTION_3D_ACLMFP",
        summary="fixed point of the De Saxcé term, each step a convex QP over the cone by ADMM",
        method="fixed point",
        citation=ACARY,
        storage="sparse",
        bound=Bound.OUTER,
        false={"mass-unit-1e-08": 4.7e-02, "mass-unit-1e+08": 2.9e-02},
        ends={"frictionless-3d": "NaN after a thousand steps, 8 s; info 1"},
    ),
    SiconosEntry(
        name="siconos-gfc3d-admm",
        constant="SICONOS_GLOBAL_FRICTION_3D_ADMM",
        summary="alternating direction method of multipliers",
        method="ADMM",
        citation=ADMM,
        warm=True,
        storage="sparse",
        bound=Bound.SPLITTING,
    ),
    SiconosEntry(
        name="siconos-gfc3d-ipm",
        constant="SICONOS_GLOBAL_FRICTION_3D_IPM",
        summary="primal-dual interior point on the convex relaxation (no De Saxcé term), listed among those of the law",
        method="interior point",
        citation="Acary, Armand, Nguyen and Shpakovych, Second-order cone programming for frictional contact (2023)",
        storage="sparse",
        bound=Bound.NEWTON,
        impossible=("squeezed",),
        false={
            "symmetric-3d": 2.6e-02,
            "sparse-3d": 9.4e-03,
            "nonsymmetric-3d": 7.7e-02,
            "mass-unit-1e-08": 1.3e03,
            "mass-unit-1e+08": 4.7e-02,
            "contact-twice": 5.7e-02,
        },
        ends={"frictionless-3d": "signal 6: asserts that no norm is NaN (NV_norm_2)"},
        failures={"check_some_case_is_solved": "none of those that are not excused"},
    ),
)
