"""Solvers that had another name before: the old name still works, and says which name is right now.

A results file keeps the names that it was written with. They are read as the new ones, so that old and new results
compare, and the keys of rows are made from the old names, so that an old file is resumed. Names leave this table
when the schema of results files changes next.
"""

from __future__ import annotations

import re

RENAMED = {
    "admm-cone": "admm-coneqp",
    "admm-contact": "admm-fc",
    "admm-global": "admm-gfc",
    "admm-global-rolling": "admm-grfc",
    "admm-rolling": "admm-rfc",
    "alart-curnier-newton": "newton-alart-curnier",
    "apgd-contact": "apgd-fc",
    "auto-cone": "auto-coneqp",
    "auto-contact": "auto-fc",
    "auto-global": "auto-gfc",
    "auto-rolling": "auto-rfc",
    "clarabel-cone": "clarabel-coneqp",
    "clarabel-desaxce": "clarabel-de-saxce",
    "clarabel-desaxce-rolling": "clarabel-de-saxce-rfc",
    "equation-newton": "newton-equation",
    "extragradient-contact": "extragradient-fc",
    "fischer-burmeister-contact": "newton-fb-fc",
    "interior-point-contact": "interior-point-fc",
    "ipm-cone": "interior-point-coneqp",
    "ipm-soclcp": "interior-point-soclcp",
    "jacobi-contact": "jacobi-fc",
    "jean-moreau-newton": "newton-jean-moreau",
    "lcp-enumeration": "enumeration-lcp",
    "mlcp-enumeration": "enumeration-mlcp",
    "natural-map-contact": "newton-natural-map",
    "newton-cone": "newton-soclcp",
    "newton-contact": "newton-nfc",
    "normal-map-newton": "newton-normal-map",
    "nsgs-global": "nsgs-gfc",
    "nsgs-rolling": "nsgs-rfc",
    "psor-contact": "psor-fc",
    "qp-augmented-lagrangian": "augmented-lagrangian",
    "qp-dual-active-set": "dual-active-set",
    "qp-interior-point": "interior-point-qp",
    "qp-nesterov": "nesterov-qp",
    "qp-primal-active-set": "primal-active-set",
    "qp-projected-gradient": "projected-gradient",
    "qp-proximal-active-set": "proximal-active-set",
    "qp-proximal-point": "proximal-point",
    "qvi-newton": "newton-qvi",
    "qvi-projection": "projection-qvi",
    "scs-cone": "scs-coneqp",
    "scs-desaxce": "scs-de-saxce",
    "scs-desaxce-rolling": "scs-de-saxce-rfc",
    "semismooth-newton-ep": "newton-ep-micp",
    "semismooth-newton-fb": "newton-fb-micp",
    "semismooth-newton-min": "newton-min-micp",
    "semismooth-newton-pfb": "newton-pfb-micp",
    "vi-extragradient": "extragradient-vi",
    "vi-golden-ratio": "golden-ratio",
    "vi-newton": "newton-vi",
    "vi-projected-reflected": "projected-reflected",
    "vi-projection": "projection-vi",
    "vi-solodov-svaiter": "solodov-svaiter",
}
"""New name by old name."""
_OLD = {new: old for old, new in RENAMED.items()}
_NAME = re.compile(r"[\w.-]+")


def current_label(label: str) -> str:
    """Return the label of a solver, of its options and of its route with the name that the solver has now.

    >>> current_label("psor-contact[omega=1.2]@inner8")
    'psor-fc[omega=1.2]@inner8'
    """
    name = _NAME.match(label)
    now = RENAMED.get(name[0]) if name else None
    return label if name is None or now is None else now + label[name.end() :]


def first_name(name: str) -> str:
    """Return the name under which a solver was first published: the keys of rows are made from it."""
    return _OLD.get(name, name)
