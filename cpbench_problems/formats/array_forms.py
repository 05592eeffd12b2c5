"""Forms in which people keep a problem as named arrays, in one table, and the choice among them by the set of names.

A form of cpbench is read off a formulation: its fields, with their dimensions. Quadratic programs of other packages are
a line of mathematics each (`program_forms`). The others are:

box QP       data, indices, indptr, shape, q, l, u: min ½xᵀMx + qᵀx, l ≤ x ≤ u, M by rows
ContactBench G, g, mus: u = Gr + g, the normal is the last of each three rows
boxed LCP    A, b, lo, hi, findex: Ax = b + w, lo ≤ x ≤ hi, as ODE, DART and Bullet have it
engine       M, J, v, mu, ... and Delassus W, q, mu, joints: see `engine_arrays`
game         A, B: payoffs of the player who chooses the row and of the other
"""

from __future__ import annotations

import inspect
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cache, cached_property

from cpbench.errors import UnknownName
from cpbench.formulations.base import ANNOTATIONS, Problem, formulations
from cpbench.formulations.contact import ContactProblem
from cpbench_problems.formats.program_forms import Program, Symbols, program


@dataclass(frozen=True)
class ArrayForm:
    """A form: the arrays that it has, and the formulation that they make.

    Attributes
    ----------
    name : as it is shown. node : of the problem. arrays : name -> dimensions, as a formulation declares them; () is one
    number. needs : arrays that are always there. aside : name -> what it is, for arrays that such files have beside
    the problem. own : whether the names are those of the formulation. meaning : of the arrays of a program. any_of :
    arrays of which at least one is there.
    """

    name: str
    node: str
    arrays: Mapping[str, Symbols]
    needs: frozenset[str]
    aside: Mapping[str, str] = field(default_factory=dict)
    own: bool = False
    meaning: Program | None = None
    any_of: frozenset[str] = frozenset()

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
                if name in self.needs or (partner and self._other_side(name) not in names):
                    yield name, partner
        if self.any_of and self.any_of.isdisjoint(names):
            yield min(self.any_of), ""

    def _other_side(self, name: str) -> str:
        """Return the name of the other side of rows, of which one is enough; the name itself where there is none."""
        rows = self.meaning.rows if self.meaning else ()
        return next(({r.lower: r.upper, r.upper: r.lower}[name] for r in rows if name in (r.lower, r.upper)), name)

    def unknown(self, names: Collection[str]) -> list[str]:
        """Return the names that are none of this form."""
        return sorted(set(names) - set(self.known()))


def _program(
    name: str,
    objective: str,
    conditions: str,
    answer: str,
    *,
    needs: str = "",
    any_of: str = "",
    more: str = "",
    aside: Mapping[str, str] | None = None,
) -> ArrayForm:
    """Return the form of a program; it needs its objective, unless `needs` says otherwise. more : arrays besides those
    of the line, as `meq` or `dims.q c`."""
    meaning = program(objective, conditions, answer)
    split = [part.split() for part in more.split(", ") if part]
    arrays = {**meaning.arrays(), **{word[0]: tuple(word[1:]) for word in split}}
    wanted = needs.split() or [*meaning.squares, *filter(None, (meaning.hessian, meaning.linear))]
    return ArrayForm(name, "qp", arrays, frozenset(wanted), aside or {}, False, meaning, frozenset(any_of.split()))


_START = {"initvals": "a starting point", "x0": "a starting point"}
_CONES = "s c2, ep, ed, p c3, bu c4, bl c4"
QPSOLVERS = _program(
    "qpsolvers", "½ xᵀ P x + qᵀ x", "G x ≤ h, A x = b, lb ≤ x ≤ ub", "x, G: z, A: y, x: z_box", aside=_START
)
LEAST_SQUARES = _program("least squares", "½ ‖A x − b‖²", "G x ≤ h, C x = d, lb ≤ x ≤ ub", "x", aside=_START)
"""A and b alone are a system Ax = b, too: never chosen by these names."""
GAME = ArrayForm("game", "lcp", {"A": ("m", "n"), "B": ("m", "n")}, frozenset("AB"))
"""A bimatrix game, payoffs of the row and of the column player: never chosen by its names either."""
PROGRAMS = (
    QPSOLVERS,
    _program("OSQP", "½ xᵀ P x + qᵀ x + r", "l ≤ A x ≤ u", "x, A: y", needs="P q A l u",
             aside={"n": "a number of columns", "m": "a number of rows"}),
    _program("quadprog", "½ xᵀ H x + fᵀ x", "A x ≤ b, Aeq x = beq, lb ≤ x ≤ ub",
             "x, A: ineqlin, Aeq: eqlin, x: upper −lower", aside=_START),
    _program("MATLAB-linprog", "fᵀ x", "A x ≤ b, Aeq x = beq, lb ≤ x ≤ ub",
             "x, A: ineqlin, Aeq: eqlin, x: upper −lower", any_of="A Aeq lb ub", aside=_START),
    _program("lsqlin", "½ ‖C x − d‖²", "A x ≤ b, Aeq x = beq, lb ≤ x ≤ ub", "x", aside=_START),
    _program("PIQP", "½ xᵀ P x + cᵀ x", "h_l ≤ G x ≤ h_u, A x = b, x_l ≤ x ≤ x_u",
             "x, G: z_u −z_l, A: y, x: z_bu −z_bl"),
    _program("PIQP-0.4", "½ xᵀ P x + cᵀ x", "G x ≤ h, A x = b, x_lb ≤ x ≤ x_ub", "x, G: z, A: y, x: z_ub −z_lb"),
    _program("ProxQP", "½ xᵀ H x + gᵀ x", "l ≤ C x ≤ u, A x = b, l_box ≤ x ≤ u_box", "x, C: z, A: y, x: z_box"),
    _program("qpOASES", "½ xᵀ H x + gᵀ x", "lbA ≤ A x ≤ ubA, lb ≤ x ≤ ub", "x, A: −yA, x: −yB"),
    _program("HPIPM", "½ xᵀ H x + gᵀ x", "lg ≤ C x ≤ ug, A x = b, lb ≤ x[idxb] ≤ ub",
             "x, C: lam_ug −lam_lg, A: −pi, x: lam_ub −lam_lb"),
    _program("DAQP", "½ xᵀ H x + fᵀ x", "blower ≤ A x ≤ bupper", "x, A: lam", any_of="blower bupper",
             more="blower s, bupper s, sense c2"),
    _program("HiGHS", "½ xᵀ Q x + col_costᵀ x + offset",
             "row_lower ≤ A x ≤ row_upper, col_lower ≤ x ≤ col_upper", "col_value, A: −row_dual, x: −col_dual",
             needs="col_cost"),
    _program("qpth", "½ xᵀ Q x + pᵀ x", "G x ≤ h, A x = b", "x, G: lam, A: nu"),
    _program("quadprog-Python", "½ xᵀ G x − aᵀ x", "Cᵀ x ≥ b", "x, C: −lagrangian", more="meq, factorized"),
    _program("quadprog-R", "½ xᵀ Dmat x − dvecᵀ x", "Amatᵀ x ≥ bvec", "solution, Amat: −Lagrangian",
             more="meq, factorized"),
    _program("linprog", "cᵀ x", "A_ub x ≤ b_ub, A_eq x = b_eq", "x, A_ub: −ineqlin, A_eq: −eqlin", needs="c",
             any_of="A_ub A_eq bounds", more="bounds n 2", aside=_START),
    _program("CVXOPT", "½ xᵀ P x + qᵀ x", "h − G x in cones, A x = b", "x, G: z, A: y", any_of="dims.l dims.q dims.s",
             more="dims.l, dims.q c, dims.s c2", aside=_START),
    _program("CVXOPT-conelp", "cᵀ x", "h − G x in cones, A x = b", "x, G: z, A: y", needs="c G h",
             more="dims.l, dims.q c, dims.s c2", aside=_START),
    _program("SCS", "½ xᵀ P x + cᵀ x", "b − A x in cones", "x, A: y", needs="c A b", any_of="z f l q",
             more=f"z, f, l, q c, {_CONES}"),
    _program("Clarabel", "½ xᵀ P x + qᵀ x", "b − A x in cones", "x, A: z", needs="P q A b cones", more="cones c"),
)  # fmt: skip
"""Quadratic programs, in the names that the packages have for their arguments."""
ENGINE = ArrayForm(
    "engine", "gfc",
    {"M": ("n", "n"), "J": ("m", "n"), "v": ("n",), "tau": ("n",),
     **dict.fromkeys(("dt", "mu", "phi", "restitution", "dimension", "order"), ())},
    frozenset(("M", "J", "v", "mu")),
)  # fmt: skip
DELASSUS = ArrayForm(
    "Delassus", "fcm",
    {"W": ("k", "k"), "q": ("k",), **dict.fromkeys(("mu", "joints", "dimension", "order"), ())},
    frozenset(("W", "q", "mu", "joints")),
)  # fmt: skip
OTHERS = (
    ArrayForm(
        "box QP", "qp",
        {"data": ("e",), "indices": ("e",), "indptr": ("r",), "shape": ("2",), "q": ("n",), "l": ("n",), "u": ("n",)},
        frozenset(("data", "indices", "indptr", "shape", *"qlu")), _START,
    ),
    ArrayForm("ContactBench", "fc", {"G": ("m", "m"), "g": ("m",), "mus": ("nc",)}, frozenset(("G", "g", "mus")),
              {"lam0": "a starting point"}),
    ArrayForm("boxed LCP", "avi", {"A": ("n", "n"), **dict.fromkeys(("b", "lo", "hi", "findex"), ("n",))},
              frozenset(("A", "b", "lo", "hi"))),
)  # fmt: skip
FOREIGN = (*PROGRAMS, *OTHERS, ENGINE, DELASSUS)
_QP = program("½ xᵀ Q x + pᵀ x", "A x ≥ b, C x = d, lb ≤ x ≤ ub")
"""Meanings of the names of cpbench's own programs, to be compared with those of packages."""

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
    meaning = _QP if cls.node == "qp" else None
    return ArrayForm(cls.node, cls.node, {**declared, **dict.fromkeys(plain, ())}, needs, own=True, meaning=meaning)


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
    known = {format_name(form): form for form in (*forms(), LEAST_SQUARES, GAME)}
    if text.casefold() not in known:
        raise UnknownName("form", text, known)
    return known[text.casefold()]


def fitting(names: Collection[str]) -> list[ArrayForm]:
    """Return the forms that have all of `names` and need no other; first the one with the fewest arrays more."""
    fits = [d for d in forms() if d.needs <= set(names) and not d.unknown(names) and not list(d.missing(names))]
    fits = fits or [d for d in forms() if d.needs <= set(names) and not d.unknown(names)]
    return sorted(fits, key=lambda d: len(set(d.arrays) - set(names)))


def ambiguity(fits: Collection[ArrayForm], names: Collection[str]) -> str:
    """Return why arrays of these names are not read where forms that fit mean different programs by them, else ""."""
    readings = {form.meaning.reading(names): form for form in reversed([*fits]) if form.meaning is not None}
    if len(readings) < 2:
        return ""
    texts = [f"{d.name} ({d.meaning.text})" for d in readings.values() if d.meaning is not None]
    options = " or ".join(f"--format {format_name(d)}" for d in readings.values())
    return f"{', '.join(sorted(names))} fit {' and '.join(texts)}, which differ: say which by {options}"


def format_name(form: ArrayForm) -> str:
    """Return the name of a form in small letters and with hyphens for blanks, as options take it."""
    return form.name.casefold().replace(" ", "-")


def has_needs(names: Collection[str]) -> bool:
    """Return whether some form has all that it needs among the names."""
    return any(d.needs <= set(names) for d in forms())


def nearest(names: Collection[str]) -> ArrayForm:
    """Return the form of which the fewest names are missing or unknown; of several that with names like the unknown."""

    def distance(d: ArrayForm) -> tuple[int, ...]:
        unknown = d.unknown(names)
        free = d.arrays.keys() - set(names)
        hints = sum(bool(alike(name, free)) for name in unknown)
        return len(d.needs - set(names)) + len(unknown), len(unknown), -hints, len(d.arrays)

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
        if name in group and (others := [other for other in group if other in known]):
            return others[0]
    letters = {other.casefold(): other for other in known}
    near = difflib.get_close_matches(name.casefold(), letters, n=1, cutoff=0.6)
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
        nearest_names = f", the nearest is {hints}" if hints else ""
        rest = f"; {absent} missing" if absent else ""
        return ", ".join(unknown), f"{verb} of {described}{nearest_names}{rest}: rename or remove {them}"
    if missing:
        return missing[0][0], f"is missing{' beside ' + missing[0][1] if missing[0][1] else ''}, expected {described}"
    return None
