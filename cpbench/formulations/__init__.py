"""The nodes of the graph: problem classes, registered under their node names, relatives in one file."""

from cpbench.formulations.base import (
    Contacts,
    Info,
    Kind,
    Point,
    Problem,
    Residuals,
    Sequence,
    Step,
    Trace,
    formulations,
)
from cpbench.formulations.conic import CP, SOCLCP, ConeQP, ConeQPPoint, CPPoint, SOCLCPPoint
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.global_contact import (
    GFCPoint,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    NFCPoint,
    NonlinearFrictionContact,
)
from cpbench.formulations.linear import AVI, LCP, MLCP, AVIPoint, LCPPoint, MLCPPoint, Relay
from cpbench.formulations.local_contact import (
    AnisotropicFrictionContact,
    FCMPoint,
    FrictionContact,
    MixedFrictionContact,
    RollingFrictionContact,
)
from cpbench.formulations.nonlinear import NCP, Equation, EquationPoint, MiCP, MiCPPoint, NCPPoint
from cpbench.formulations.programs import NLP, QP, NLPPoint, QPPoint
from cpbench.formulations.variational import GE, QVI, VI, GEPoint, QVIPoint, VIPoint

__all__ = [
    "AVI",
    "CP",
    "GE",
    "LCP",
    "MLCP",
    "NCP",
    "NLP",
    "QP",
    "QVI",
    "SOCLCP",
    "VI",
    "AVIPoint",
    "AnisotropicFrictionContact",
    "CPPoint",
    "ConeQP",
    "ConeQPPoint",
    "Contacts",
    "Equation",
    "EquationPoint",
    "FCMPoint",
    "FCPoint",
    "FrictionContact",
    "GEPoint",
    "GFCPoint",
    "GlobalFrictionContact",
    "GlobalRollingFrictionContact",
    "Info",
    "Kind",
    "LCPPoint",
    "MLCPPoint",
    "MiCP",
    "MiCPPoint",
    "MixedFrictionContact",
    "NCPPoint",
    "NFCPoint",
    "NLPPoint",
    "NonlinearFrictionContact",
    "Point",
    "Problem",
    "QPPoint",
    "QVIPoint",
    "Relay",
    "Residuals",
    "RollingFrictionContact",
    "SOCLCPPoint",
    "Sequence",
    "Step",
    "Trace",
    "VIPoint",
    "formulations",
]
