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
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.fcm import FCMPoint, MixedFrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.global_contact import GFCPoint
from cpbench.formulations.grfc import GlobalRollingFrictionContact
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.formulations.qp import QP, QPPoint
from cpbench.formulations.relay import Relay
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.formulations.soclcp import SOCLCP, SOCLCPPoint

__all__ = [
    "AVI",
    "LCP",
    "MLCP",
    "QP",
    "SOCLCP",
    "AVIPoint",
    "AnisotropicFrictionContact",
    "ConeQP",
    "ConeQPPoint",
    "Contacts",
    "FCMPoint",
    "FCPoint",
    "FrictionContact",
    "GFCPoint",
    "GlobalFrictionContact",
    "GlobalRollingFrictionContact",
    "Info",
    "Kind",
    "LCPPoint",
    "MLCPPoint",
    "MixedFrictionContact",
    "Point",
    "Problem",
    "QPPoint",
    "Relay",
    "Residuals",
    "RollingFrictionContact",
    "SOCLCPPoint",
    "Sequence",
    "Step",
    "Trace",
    "formulations",
]
