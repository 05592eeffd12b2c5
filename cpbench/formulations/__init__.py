"""The nodes of the graph: one problem class a file, registered under its node name."""

from cpbench.formulations.afc import AnisotropicFrictionContact
from cpbench.formulations.avi import AVI, AVIPoint
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
from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.cp import CP, CPPoint
from cpbench.formulations.equation import Equation, EquationPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.fcm import FCMPoint, MixedFrictionContact
from cpbench.formulations.ge import GE, GEPoint
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.global_contact import GFCPoint
from cpbench.formulations.grfc import GlobalRollingFrictionContact
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.micp import MiCP, MiCPPoint
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.formulations.ncp import NCP, NCPPoint
from cpbench.formulations.nfc import NFCPoint, NonlinearFrictionContact
from cpbench.formulations.nlp import NLP, NLPPoint
from cpbench.formulations.qp import QP, QPPoint
from cpbench.formulations.qvi import QVI, QVIPoint
from cpbench.formulations.relay import Relay
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.formulations.soclcp import SOCLCP, SOCLCPPoint
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI

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
