"""Siconos' Gauss–Seidel methods and fixed points of frictional contact in space (fc3d_Solvers.h), `fc` of dimension 3.

W is dense where the problem's is, else in 3 x 3 blocks, which is how Siconos' own simulations keep it; PFP takes
blocks alone (abort in other storages), NSGSV and the Newton of the test suite dense storage.

Left out, for Debian's library cannot run them: SICONOS_FRICTION_3D_NCPGlockerFBFixedPoint (its driver does not know
it: abort), _GAMS_PATH, _GAMS_PATHVI, _GAMS_LCP_PATH and _GAMS_LCP_PATHVI (without GAMS).
"""

from __future__ import annotations

from typing import Any

from cpbench.solvers.adapters.siconos import SiconosEntry, SiconosSolver, register_family
from cpbench.solvers.adapters.siconos_tolerances import Bound

REVIEW = "Acary, Brémond and Huber, On solving contact problems with Coulomb friction (2018)"
JEAN = "Jean, The non-smooth contact dynamics method, CMAME 177 (1999)"
ACARY = "Acary, Cadoux, Lemaréchal and Malick, A formulation of Coulomb friction, ZAMM 91 (2011)"
ONE = "SICONOS_FRICTION_3D_ONECONTACT_"


class SiconosFC3D(SiconosSolver):
    """A solver of Siconos for frictional contact in space."""

    node = "fc"

    def obstacle(self, problem: Any) -> str | None:
        if problem.dimension != 3:
            return f"is for contacts of 3 rows, these have {problem.dimension}"
        return super().obstacle(problem)


register_family(
    SiconosFC3D,
    SiconosEntry(
        name="siconos-fc3d-nsgs",
        constant="SICONOS_FRICTION_3D_NSGS",
        summary="Gauss–Seidel over the contacts, Alart–Curnier Newton with projections in each",
        method="block Gauss–Seidel",
        citation=JEAN,
        warm=True,
        storage="given",
        by_default=True,
        early={"velocity-unit-1e-08-3d": 8.5e-02, "impulse-unit-1e+08-3d": 8.5e-02},
        ends={"nonsymmetric-3d": "signal 6: asserts a positive diagonal of W (compute_rho_split_spectral_norm)"},
    ),
    SiconosEntry(
        name="siconos-fc3d-nsgs-projection",
        constant="SICONOS_FRICTION_3D_NSGS",
        inner=f"{ONE}ProjectionOnConeWithLocalIteration",
        summary="Gauss–Seidel over the contacts, projections with local iterations in each",
        method="block Gauss–Seidel",
        citation=REVIEW,
        warm=True,
        storage="given",
        early={"impulse-unit-1e-08-3d": 7.3e-01, "impulse-unit-1e+08-3d": 8.5e-02},
        impossible=("immovable",),
    ),
    SiconosEntry(
        name="siconos-fc3d-nsgs-quartic",
        constant="SICONOS_FRICTION_3D_NSGS",
        inner=f"{ONE}QUARTIC",
        summary="Gauss–Seidel over the contacts, each by the roots of a quartic",
        method="block Gauss–Seidel",
        citation="Bonnefon and Daviet, Quartic formulation of Coulomb 3D frictional contact (2011)",
        warm=True,
        storage="given",
        early={"velocity-unit-1e-08-3d": 8.5e-02, "impulse-unit-1e+08-3d": 8.5e-02},
    ),
    SiconosEntry(
        name="siconos-fc3d-nsgsv",
        constant="SICONOS_FRICTION_3D_NSGSV",
        summary="Gauss–Seidel in velocities; Debian's default for its contacts is one that it does not know",
        method="block Gauss–Seidel",
        citation=JEAN,
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
        name="siconos-fc3d-prox",
        constant="SICONOS_FRICTION_3D_PROX",
        summary="proximal point, semismooth Newton inside",
        method="proximal point",
        citation=REVIEW,
        storage="given",
        bound=Bound.OUTER,
        impossible=(
            "squeezed",
            "immovable",
        ),
        false={
            "impulse-unit-1e-08-3d": 7.3e-02,
            "velocity-unit-1e-08-3d": 4.9e-01,
            "impulse-unit-1e+08-3d": 4.9e-01,
            "velocity-unit-1e+08-3d": 7.3e-02,
        },
    ),
    SiconosEntry(
        name="siconos-fc3d-tfp",
        constant="SICONOS_FRICTION_3D_TFP",
        summary="Tresca fixed point: friction thresholds held, a convex problem by Gauss–Seidel, and again",
        method="fixed point",
        citation="Haslinger, Least square method for solving contact problems with friction (1984)",
        warm=True,
        storage="given",
        bound=Bound.OUTER,
        false={
            "sparse-3d": 1.2e-06,
            "impulse-unit-1e-08-3d": 3.0e-02,
            "velocity-unit-1e-08-3d": 3.8e-01,
            "impulse-unit-1e+08-3d": 3.6e-01,
            "velocity-unit-1e+08-3d": 1.0e-02,
        },
    ),
    SiconosEntry(
        name="siconos-fc3d-pfp",
        constant="SICONOS_FRICTION_3D_PFP",
        summary="Panagiotopoulos' fixed point: normal and tangential problems in turn",
        method="fixed point",
        citation="Panagiotopoulos, A nonlinear programming approach to the unilateral contact problem (1975)",
        warm=True,
        storage="blocks",
        bound=Bound.OUTER,
        false={
            "impulse-unit-1e-08-3d": 4.1e-04,
            "velocity-unit-1e-08-3d": 3.5e-01,
            "impulse-unit-1e+08-3d": 3.5e-01,
            "velocity-unit-1e+08-3d": 4.1e-04,
        },
    ),
    SiconosEntry(
        name="siconos-fc3d-aclmfp",
        constant="SICONOS_FRICTION_3D_ACLMFP",
        summary="fixed point of the De Saxcé term, each step a second-order cone problem",
        method="fixed point",
        citation=ACARY,
        storage="given",
        bound=Bound.OUTER,
        impossible=("immovable",),
        false={
            "impulse-unit-1e-08-3d": 5.3e-02,
            "velocity-unit-1e-08-3d": 1.6e-01,
            "impulse-unit-1e+08-3d": 5.3e-02,
            "velocity-unit-1e+08-3d": 5.3e-02,
        },
    ),
    SiconosEntry(
        name="siconos-fc3d-soclcp",
        constant="SICONOS_FRICTION_3D_SOCLCP",
        summary="Gauss–Seidel on the convex relaxation (no De Saxcé term), listed by Siconos among those of the law",
        method="relaxation",
        citation=ACARY,
        warm=True,
        storage="given",
        false={
            "positive-definite-3d": 2.5e-02,
            "singular-semidefinite-3d": 2.9e-02,
            "monotone-3d": 2.0e-02,
            "sparse-3d": 4.0e-03,
            "impulse-unit-1e-08-3d": 6.8e-03,
            "velocity-unit-1e-08-3d": 1.6e-01,
            "impulse-unit-1e+08-3d": 6.8e-03,
            "velocity-unit-1e+08-3d": 6.8e-03,
            "fast-3d": 3.8e-01,
        },
    ),
)
