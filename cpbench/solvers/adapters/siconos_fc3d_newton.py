"""Siconos' Newton methods, projections and ADMM for contact in space (fc3d_Solvers.h), for `fc` of dimension 3."""

from __future__ import annotations

from cpbench.solvers.adapters.siconos import SiconosEntry, register_family
from cpbench.solvers.adapters.siconos_fc3d import REVIEW, SiconosFC3D
from cpbench.solvers.adapters.siconos_tolerances import Bound

ALART = "Alart and Curnier, A mixed formulation for frictional contact problems, CMAME 92 (1991)"
PANG = "Facchinei and Pang, Finite-Dimensional Variational Inequalities (2003), chapter 12"

register_family(
    SiconosFC3D,
    SiconosEntry(
        name="siconos-fc3d-nsn-ac",
        constant="SICONOS_FRICTION_3D_NSN_AC",
        summary="semismooth Newton on the Alart–Curnier function",
        method="semismooth Newton",
        citation=ALART,
        warm=True,
        storage="given",
        bound=Bound.NEWTON,
        by_default=True,
        false={"impulse-unit-1e-08-3d": 7.3e-02, "velocity-unit-1e+08-3d": 7.3e-02},
    ),
    SiconosEntry(
        name="siconos-fc3d-nsn-ac-test",
        constant="SICONOS_FRICTION_3D_NSN_AC_TEST",
        summary="semismooth Newton on the Alart–Curnier function, the general Newton with line search",
        method="semismooth Newton",
        citation=ALART,
        warm=True,
        storage="given",
        bound=Bound.NEWTON,
        false={"impulse-unit-1e-08-3d": 1.8e-01, "velocity-unit-1e-08-3d": 5.0e-01},
    ),
    SiconosEntry(
        name="siconos-fc3d-nsn-fb",
        constant="SICONOS_FRICTION_3D_NSN_FB",
        summary="semismooth Newton on the Fischer–Burmeister function of the cone",
        method="semismooth Newton",
        citation="Fukushima, Luo and Tseng, Smoothing functions for SOCCP, SIAM J. Optim. 12 (2002)",
        warm=True,
        storage="given",
        bound=Bound.NEWTON,
        impossible=(
            "squeezed",
            "immovable",
        ),
        false={"impulse-unit-1e-08-3d": 1.8e-01, "impulse-unit-1e+08-3d": 4.7e-01, "velocity-unit-1e+08-3d": 1.8e-01},
    ),
    SiconosEntry(
        name="siconos-fc3d-nsn-nm",
        constant="SICONOS_FRICTION_3D_NSN_NM",
        summary="semismooth Newton on the natural map",
        method="semismooth Newton",
        citation=REVIEW,
        warm=True,
        storage="given",
        bound=Bound.NEWTON,
        false={
            "impulse-unit-1e-08-3d": 1.8e-01,
            "velocity-unit-1e-08-3d": 4.9e-01,
            "impulse-unit-1e+08-3d": 4.9e-01,
            "velocity-unit-1e+08-3d": 1.8e-01,
        },
    ),
    SiconosEntry(
        name="siconos-fc3d-dsfp",
        constant="SICONOS_FRICTION_3D_DSFP",
        summary="De Saxcé's fixed point (Uzawa), ρ = 1",
        method="projection",
        citation="De Saxcé and Feng, The bipotential method, Math. Comput. Modelling 28 (1998)",
        warm=True,
        storage="given",
        false={"impulse-unit-1e-08-3d": 4.6e-01, "velocity-unit-1e+08-3d": 4.6e-01},
    ),
    SiconosEntry(
        name="siconos-fc3d-fpp",
        constant="SICONOS_FRICTION_3D_FPP",
        summary="fixed point of the projection, ρ = 1",
        method="projection",
        citation=PANG,
        warm=True,
        storage="given",
        impossible=(
            "squeezed",
            "immovable",
        ),
        false={
            "impulse-unit-1e-08-3d": 4.6e-01,
            "velocity-unit-1e-08-3d": 4.9e-01,
            "impulse-unit-1e+08-3d": 4.9e-01,
            "velocity-unit-1e+08-3d": 4.6e-01,
        },
    ),
    SiconosEntry(
        name="siconos-fc3d-eg",
        constant="SICONOS_FRICTION_3D_EG",
        summary="extragradient",
        method="extragradient",
        citation=PANG,
        warm=True,
        storage="given",
        impossible=(
            "squeezed",
            "immovable",
        ),
        false={
            "impulse-unit-1e-08-3d": 7.2e-01,
            "velocity-unit-1e-08-3d": 4.9e-01,
            "impulse-unit-1e+08-3d": 4.9e-01,
            "velocity-unit-1e+08-3d": 7.2e-01,
        },
    ),
    SiconosEntry(
        name="siconos-fc3d-hp",
        constant="SICONOS_FRICTION_3D_HP",
        summary="hyperplane projection",
        method="projection",
        citation=PANG,
        warm=True,
        storage="given",
        false={"impulse-unit-1e-08-3d": 4.4e-01, "velocity-unit-1e+08-3d": 4.4e-01},
    ),
    SiconosEntry(
        name="siconos-fc3d-vi-fpp",
        constant="SICONOS_FRICTION_3D_VI_FPP",
        summary="fixed point of the projection, step size by itself",
        method="projection",
        citation=PANG,
        warm=True,
        storage="given",
        impossible=("squeezed",),
    ),
    SiconosEntry(
        name="siconos-fc3d-vi-eg",
        constant="SICONOS_FRICTION_3D_VI_EG",
        summary="extragradient, step size by itself",
        method="extragradient",
        citation="Khobotov, A modification of the extragradient method, USSR Comp. Math. 27 (1987)",
        warm=True,
        storage="given",
    ),
    SiconosEntry(
        name="siconos-fc3d-admm",
        constant="SICONOS_FRICTION_3D_ADMM",
        summary="alternating direction method of multipliers on the cone, De Saxcé term held",
        method="ADMM",
        citation="Boyd et al., Distributed optimization and statistical learning via ADMM (2011)",
        storage="given",
        false={"impulse-unit-1e-08-3d": 2.2e-01, "velocity-unit-1e+08-3d": 2.2e-01},
    ),
)
