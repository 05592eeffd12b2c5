"""Semismooth Newton on the functions of Alart and Curnier and of Jean and Moreau: the law as two projections."""

from __future__ import annotations

from typing import ClassVar

from cpbench.solvers.base import SolverSpec, register
from cpbench_solvers.contact.newton_equation import ContactFunction
from cpbench_solvers.contact.semismooth_newton import ContactNewton, newton_spec


@register
class AlartCurnierNewton(ContactNewton):
    """Sweeps of Gauss–Seidel to come near, then Newton steps with line search; sweeps again where these fail.

    W is regularized by τ, which falls with ‖Φ‖, so that hyperstatic contacts (W singular) have a Newton step. Contacts
    that are open in the present iterate leave the linear system.
    """

    function = ContactFunction.ALART_CURNIER
    spec: ClassVar[SolverSpec] = newton_spec(
        name="newton-alart-curnier",
        summary="semismooth Newton on the Alart-Curnier function, from a start by Gauss-Seidel",
        citation="Alart and Curnier 1991, CMAME 92:353; Acary, Brémond and Huber 2018, Springer LNACM 92:205",
    )


@register
class JeanMoreauNewton(ContactNewton):
    """The method of newton-alart-curnier; the friction disk has the radius μ(r_N)₊ of the iterate, not that of its
    projection."""

    function = ContactFunction.JEAN_MOREAU
    spec: ClassVar[SolverSpec] = newton_spec(
        name="newton-jean-moreau",
        summary="semismooth Newton on the Jean-Moreau function, from a start by Gauss-Seidel",
        citation="Jean and Moreau 1987; Acary, Brémond and Huber 2018, Springer LNACM 92:205",
        by_default=False,
    )
