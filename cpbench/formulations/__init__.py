"""The nodes of the graph: one problem class a file, registered under its node name."""

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
from cpbench.formulations.fc import FCPoint, FrictionContact
from cpbench.formulations.gfc import GFCPoint, GlobalFrictionContact
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.formulations.qp import QP, QPPoint

__all__ = [
    "LCP",
    "MLCP",
    "QP",
    "Contacts",
    "FCPoint",
    "FrictionContact",
    "GFCPoint",
    "GlobalFrictionContact",
    "Info",
    "Kind",
    "LCPPoint",
    "MLCPPoint",
    "Point",
    "Problem",
    "QPPoint",
    "Residuals",
    "Sequence",
    "Step",
    "Trace",
    "formulations",
]
