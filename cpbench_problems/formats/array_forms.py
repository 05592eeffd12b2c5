"""Forms in which people keep a problem as named arrays, in one table, and the choice among them by the set of names.

A form of cpbench is read off a formulation: its fields, with their dimensions. The others are those of packages:

qpsolvers    P, q, G, h, A, b, lb, ub: min ½xᵀPx + qᵀx, Gx ≤ h, Ax = b, lb ≤ x ≤ ub
OSQP         P, q, A, l, u, r: min ½xᵀPx + qᵀx + r, l ≤ Ax ≤ u (Maros and Meszaros, as OSQP keeps them)
quadprog     H, f, A, b, Aeq, beq, lb, ub: min ½xᵀHx + fᵀx, Ax ≤ b, Aeq x = beq, lb ≤ x ≤ ub (MATLAB)
cvxopt       P, q, G, h, A, b, dims.l, dims.q, dims.s: min ½xᵀPx + qᵀx, h − Gx in a cone, Ax = b
box QP       data, indices, indptr, shape, q, l, u: min ½xᵀMx + qᵀx, l ≤ x ≤ u, M by rows
ContactBench G, g, mus: u = Gr + g, the normal is the last of each three rows
boxed LCP    A, b, lo, hi, findex: Ax = b + w, lo ≤ x ≤ hi, as ODE, DART and Bullet have it
engine       M, J, v, mu, ... and Delassus W, q, mu, joints: see `engine_arrays`
"""

from __future__ import annotations

import inspect
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cache, cached_property

from cpbench.errors import UnknownName
from cpbench.formulations.base import ANNOTATIONS, Problem, formulations
from cpbench.formulations.contact import ContactProblem

Symbols = tuple[str, ...]


@dataclass(frozen=True)
class ArrayForm:
    """A form: the arrays that it has, and the formulation that they make.

    Attributes
    ----------
    name : as it is shown. node : of the problem. arrays : name -> dimensions, as a formulation declares them; () is one
    number. needs : arrays that are always there. aside : name -> what it is, for arrays that such files have beside
    the problem. own : whether the names are those of the formulation.
    """

    name: str
    node: str
    arrays: Mapping[str, Symbols]
    needs: frozenset[str]
    aside: Mapping[str, str] = field(default_factory=dict)
    own: bool = False

    @cached_property
    def groups(self) -> tuple[frozenset[str], ...]:
        """The arrays that are there together or not at all: optional ones with a dimension that no needed one has."""
        fixed = {symbol for name in self.needs for symbol in self.arrays[name]}
        by_symbol: dict[str, set[str]] = {}
        for name in self.arrays.keys() - self.needs:
            for symbol in self.arrays[name]:
                if symbol not in fixed:
                    by_symbol.setdefault(symbol, set()).add(name)
        return tuple(frozenset(names) for names in by_symbol.values())

    def known(self) -> list[str]:
        """Return all names, those of the problem first."""
        return [*self.arrays, *self.aside]

    def missing(self, names: Collection[str]) -> Iterator[tuple[str, str]]:
        """Yield each array that is missing, with one beside which it should be ("" where it is always needed)."""
        for name in self.arrays:
            if name not in names:
                partner = next((p for group in self.groups if name in group for p in sorted(group) if p in names), "")
                if name in self.needs or partner:
                    yield name, partner

    def unknown(self, names: Collection[str]) -> list[str]:
        """Return the names that are none of this form."""
        return sorted(set(names) - set(self.known()))


def _program(name: str, needs: str, arrays: str, aside: Mapping[str, str], node: str = "qp") -> ArrayForm:
    """Return a form from a text such as `P n n, q n`."""
    split = [part.split() for part in arrays.split(",")]
    return ArrayForm(name, node, {word[0]: tuple(word[1:]) for word in split}, frozenset(needs.split()), aside)


_START = "a starting point"
QPSOLVERS = _program("qpsolvers", "P q", "P n n, q n, G m n, h m, A k n, b k, lb n, ub n", {"initvals": _START})
OSQP = _program(
    "OSQP", "P q A l u", "P n n, q n, r, A m n, l m, u m", {"n": "a number of columns", "m": "a number of rows"}
)
QUADPROG = _program("quadprog", "H f", "H n n, f n, A m n, b m, Aeq k n, beq k, lb n, ub n", {"x0": _START})
CVXOPT = _program("cvxopt", "P q", "P n n, q n, G m n, h m, A k n, b k, dims.l, dims.q c, dims.s s", {})
BOX = _program(
    "box QP", "data indices indptr shape q l u",
    "data e, indices e, indptr r, shape 2, q n, l n, u n", {"x0": _START},
)  # fmt: skip
CONTACTBENCH = _program("ContactBench", "G g mus", "G m m, g m, mus nc", {"lam0": _START}, "fc")
BOXED = _program("boxed LCP", "A b lo hi", "A n n, b n, lo n, hi n, findex n", {}, "avi")
LEAST_SQUARES = _program("least squares", "A b", "A m n, b m, lb n, ub n", {"x0": _START})
"""min ½‖Ax − b‖², lb ≤ x ≤ ub: never chosen by its names, which a system Ax = b has too."""
GAME = _program("game", "A B", "A m n, B m n", {}, "lcp")
"""A bimatrix game, payoffs of the row and of the column player: never chosen by its names either."""
ENGINE = _program(
    "engine", "M J v mu", "M n n, J m n, v n, tau n, dt, mu, phi, restitution, dimension, order", {}, "gfc"
)
DELASSUS = _program("Delassus", "W q mu joints", "W k k, q k, mu, joints, dimension, order", {}, "fcm")
FOREIGN = (QPSOLVERS, OSQP, QUADPROG, CVXOPT, BOX, CONTACTBENCH, BOXED, ENGINE, DELASSUS)

_CONTAINED = {"relay": "avi"}
"""Formulations whose arrays have the names of a wider one, which is read instead: its bounds may be infinite."""


@cache
def own(cls: type[Problem]) -> ArrayForm:
    """Return the form whose names are the fields of a formulation; its `build`, where it has one, says which may be
    left out."""
    declared = {f.name: f.metadata["shape"] for f in fields(cls) if "shape" in f.metadata}
    plain = [f.name for f in fields(cls) if f.name not in ANNOTATIONS and f.name not in declared]
    plain += ["order"] if issubclass(cls, ContactProblem) else []  # of the rows of a contact
    parameters = inspect.signature(getattr(cls, "build", cls)).parameters
    needs = frozenset(name for name in declared if parameters[name].default is inspect.Parameter.empty)
    return ArrayForm(cls.node, cls.node, {**declared, **dict.fromkeys(plain, ())}, needs, own=True)


def forms() -> list[ArrayForm]:
    """Return all forms: those of packages, then those of the formulations without nonlinear maps."""
    names = sorted((name for name in formulations.names() if name not in _CONTAINED), key=len)
    classes = map(formulations.get, names)
    return [*FOREIGN, *(own(cls) for cls in classes if not cls.has_maps())]


def named(text: str) -> ArrayForm:
    """Return the form of a name, in small letters and with hyphens for blanks; raises UnknownName.

    >>> named("boxed-lcp").arrays["findex"], named("qp").own
    (('n',), True)
    """
    known = {form.name.casefold().replace(" ", "-"): form for form in (*forms(), LEAST_SQUARES, GAME)}
    if text.casefold() not in known:
        raise UnknownName("form", text, known)
    return known[text.casefold()]


def fitting(names: Collection[str]) -> list[ArrayForm]:
    """Return the forms that have all of `names` and need no other; first the one with the fewest arrays more."""
    fits = [d for d in forms() if d.needs <= set(names) and not d.unknown(names)]
    return sorted(fits, key=lambda d: len(set(d.arrays) - set(names)))


def has_needs(names: Collection[str]) -> bool:
    """Return whether some form has all that it needs among the names."""
    return any(d.needs <= set(names) for d in forms())


def nearest(names: Collection[str]) -> ArrayForm:
    """Return the form of which the fewest names are missing or unknown; of several that with names like the unknown."""

    def distance(d: ArrayForm) -> tuple[int, int, int]:
        unknown = d.unknown(names)
        free = d.arrays.keys() - set(names)
        hints = sum(bool(alike(name, free)) for name in unknown)
        return len(d.needs - set(names)) + len(unknown), -hints, len(d.arrays)

    return min(forms(), key=distance)


_EQUAL = (
    ("lb", "l", "lower", "lo", "low", "xl", "bl", "lbound"),
    ("ub", "u", "upper", "hi", "up", "high", "xu", "bu", "ubound"),
    ("q", "p", "f", "c", "g", "linear"),
    ("P", "Q", "H", "M", "W", "hessian"),
    ("mu", "mus", "friction"),
)
"""Names of one and the same array in several packages."""


def alike(name: str, known: Collection[str]) -> str:
    """Return the known name that most probably is meant by `name`; "" where none is alike."""
    import difflib  # only for refusals

    for group in _EQUAL:
        if name in group and (found := [other for other in group if other in known]):
            return found[0]
    letters = {other.casefold(): other for other in known}
    near = difflib.get_close_matches(name.casefold(), letters, n=1, cutoff=0.4)
    return letters[near[0]] if near else ""


def refusal(form: ArrayForm, names: Collection[str]) -> tuple[str, str] | None:
    """Return the name of an array that is too many or missing in a form, and why nothing is read; None where all fit.

    >>> refusal(QPSOLVERS, ["P", "q", "l"])
    ('l', 'is no array of the form qpsolvers (P, q, G, h, A, b, lb, ub), the nearest is lb: rename or remove it')
    """
    unknown, missing = form.unknown(names), list(form.missing(names))
    described = f"the form {form.name} ({', '.join(form.arrays)})"
    absent = ", ".join(f"{name} (beside {partner})" if partner else name for name, partner in missing)
    if unknown:
        free = [name for name in form.arrays if name not in names]
        near = (alike(name, free) or alike(name, form.arrays) for name in unknown)
        hints = ", ".join(dict.fromkeys(filter(None, near)))
        verb, them = ("is no array", "it") if len(unknown) == 1 else ("are no arrays", "them")
        cause = (
            f"{verb} of {described}"
            + (f", the nearest is {hints}" if hints else "")
            + (f"; {absent} missing" if absent else "")
        )
        return ", ".join(unknown), f"{cause}: rename or remove {them}"
    if missing:
        return missing[0][0], f"is missing{' beside ' + missing[0][1] if missing[0][1] else ''}, expected {described}"
    return None
