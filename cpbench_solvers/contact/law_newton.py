"""Semismooth Newton on four functions of the law: as two projections (Alart and Curnier, Jean and Moreau), and as
K*_μ ∋ û ⟂ r ∈ K_μ by De Saxcé's change of variable (the natural map, Fischer and Burmeister)."""

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
    """The method of newton-alart-curnier; the disk has the radius μ(r_N)₊ of the iterate, not of its projection."""

    function = ContactFunction.JEAN_MOREAU
    spec: ClassVar[SolverSpec] = newton_spec(
        name="newton-jean-moreau",
        summary="semismooth Newton on the Jean-Moreau function, from a start by Gauss-Seidel",
        citation="Jean and Moreau 1987; Acary, Brémond and Huber 2018, Springer LNACM 92:205",
        by_default=False,
    )


@register
class NaturalMapContact(ContactNewton):
    """The method of newton-alart-curnier, on r − P_K(r − ϱû): û has a kink where a contact begins to slide, the
    derivative there is that without the shift."""

    function = ContactFunction.NATURAL_MAP
    spec: ClassVar[SolverSpec] = newton_spec(
        name="newton-natural-map",
        summary="semismooth Newton on the natural map of the friction cone, from a start by Gauss-Seidel",
        citation="De Saxcé and Feng 1998, Math. Comput. Modelling 28:225; Acary, Brémond and Huber 2018, LNACM 92:205",
        by_default=False,
    )


@register
class FischerBurmeisterContact(ContactNewton):
    """The method of newton-alart-curnier, on a + b − (a∘a + b∘b)^½ in the Jordan algebra of the second-order cone,
    of reactions a = (μr_N, r_T) and velocities b = ϱ(û_N, μu_T); a contact without friction has the function of
    Fischer."""

    function = ContactFunction.FISCHER_BURMEISTER
    spec: ClassVar[SolverSpec] = newton_spec(
        name="newton-fb-fc",
        summary="semismooth Newton on the Fischer-Burmeister function of the second-order cone, after Gauss-Seidel",
        citation="Fukushima, Luo and Tseng 2001, SIAM J. Optim. 12:436; Acary, Brémond and Huber 2018, LNACM 92:205",
        by_default=False,
    )
