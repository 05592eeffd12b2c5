"""What the library knows beyond the lecture: elliptic cones and rolling friction."""

from __future__ import annotations

from lecture.blocks import Heading, Section, Try, formula, text
from lecture.conversions import data, shown, trips
from lecture.numerics.examples import problems


def section() -> Section:
    """Anisotropic and rolling contacts."""
    known = problems()
    return Section(
        "beyond",
        "Beyond the lecture",
        text("The same machinery carries two laws that the lecture does not have."),
        (
            Heading("Two coefficients"),
            text(
                "A skate slides along more easily than across. Its disk is an ellipse, and scaling the tangents by "
                "$S=\\mathrm{diag}(1,\\mu_1,\\mu_2)$ makes it round again."
            ),
            data(known["anisotropic"], "q", "mu"),
            *shown(trips("anisotropic", "afc-fc")),
            Heading("Rolling"),
            text(
                "A wheel resists rolling as it resists sliding[^rolling]. The contact has moments $m$ and angular "
                "velocities $\\omega$ besides, and a cone with two bounds:"
            ),
            formula(
                r"K=\left\{r:\;\|r_{\mathrm T}\|\le\mu r_{\mathrm N},\;\|m\|\le\mu_{r}r_{\mathrm N}\right\},\qquad"
                r"\hat u=u+(\mu\|u_{\mathrm T}\|+\mu_{r}\|\omega\|)e_{\mathrm N}"
            ),
            *shown(
                [
                    *trips("rolling", "rfc-lcp-facets", "rfc-coneqp", "rfc-cp", "rfc-vi"),
                    *trips("rolling-plane", "rfc-lcp-2d"),
                    *trips("rolling-global", "grfc-rfc"),
                ]
            ),
            Try(
                (
                    "cpbench solve problems.h5::anisotropic --solver nsgs",
                    "cpbench solve problems.h5::rolling --solver nsgs-rfc",
                    "cpbench graph",
                )
            ),
        ),
    )
