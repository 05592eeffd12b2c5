"""Nonlinear maps: their values over the rationals, and with derivatives in balls."""

from __future__ import annotations

from typing import Any

from certificate_file import exact, require
from flint import arb, fmpq, fmpq_mat

UNARY = [
    "neg", "abs", "sqrt", "exp", "log", "expm1", "log1p", "sin", "cos", "tan", "asin", "acos", "atan", "sinh",
    "cosh", "tanh", "asinh", "acosh", "atanh", "erf", "floor", "ceil", "not",
]  # fmt: skip
BINARY = [
    "add", "sub", "mul", "div", "pow", "atan2", "min", "max", "lt", "le", "eq", "and", "or", "choose",
]  # fmt: skip
NAN = arb("nan")


class DualBall:
    """A ball with its derivatives, by the number of the unknown."""

    def __init__(self, v: Any, d: dict[int, Any]) -> None:
        self.v, self.d = v, d

    @classmethod
    def of(cls, v: Any, number: int) -> DualBall:
        """Return an unknown, or a constant where the number is negative."""
        return cls(v, {number: arb(1)} if number >= 0 else {})

    def chain(self, value: Any, slope: Any) -> DualBall:
        """Return a function of it."""
        return DualBall(value, {j: slope * d for j, d in self.d.items()})

    def __add__(self, other: Any) -> DualBall:
        """Sum, of a number too."""
        if not isinstance(other, DualBall):
            return DualBall(self.v + other, self.d)
        d = dict(self.d)
        for j, slope in other.d.items():
            d[j] = d[j] + slope if j in d else slope
        return DualBall(self.v + other.v, d)

    __radd__ = __add__

    def __mul__(self, other: DualBall) -> DualBall:
        """Product."""
        return self.chain(self.v * other.v, other.v) + other.chain(arb(0), self.v)

    def sqrt(self) -> DualBall:
        """Square root, differentiable where it is positive."""
        root = self.v.sqrt() if self.v >= 0 else NAN
        return self.chain(root, 1 / (2 * root) if self.v > 0 else NAN)


def operations(F: dict[str, Any]) -> list[tuple[str, int, int]]:
    """Names and arguments, in order; raises ValueError where an argument comes after its use."""
    found, first = [], int(F["inputs"]) + F["constants"].size
    for k, (head, a, b) in enumerate(zip(F["heads"].tolist(), F["left"].tolist(), F["right"].tolist(), strict=True)):
        name = BINARY[head - 32] if head >= 32 else UNARY[head]
        require(0 <= a < first + k and (0 <= b < first + k) == (head >= 32), "a map is no list of operations")
        found.append((name, a, b))
    return found


def duals(F: dict[str, Any], x: list[DualBall]) -> list[DualBall]:
    """Return F(x) with derivatives; not finite where F may have a kink or be undefined."""
    known = [*x, *(DualBall(arb(v), {}) for v in F["constants"].tolist())]
    for name, a, b in operations(F):
        known.append(unary(name, known[a]) if b < 0 else binary(name, known[a], known[b]))
    return [known[k] for k in F["outputs"].tolist()]


def unary(name: str, a: DualBall) -> DualBall:
    """Return an operation with one argument."""
    v, one = a.v, arb(1)
    if name == "sqrt":
        return a.sqrt()
    if name == "abs":
        return a.chain(abs(v), one if v > 0 else -one if v < 0 else NAN)
    if name == "log1p":
        return a.chain((1 + v).log() if v > -1 else NAN, 1 / (1 + v))
    if name in ("floor", "ceil", "not"):
        value = (arb(0) if truth(v) else arb(1)) if name == "not" and truth(v) is not None else NAN
        value = value if name == "not" else getattr(v, name)()
        return a.chain(value, arb(0) if value.is_exact() else NAN)
    f = -v if name == "neg" else getattr(v, name)()
    slope = {
        "neg": lambda: -one, "exp": lambda: f, "log": lambda: 1 / v if v > 0 else NAN, "expm1": lambda: v.exp(),
        "sin": lambda: v.cos(), "cos": lambda: -v.sin(), "tan": lambda: 1 + f * f, "sinh": lambda: v.cosh(),
        "asin": lambda: 1 / (1 - v * v).sqrt(), "acos": lambda: -1 / (1 - v * v).sqrt(), "cosh": lambda: v.sinh(),
        "atan": lambda: 1 / (1 + v * v), "tanh": lambda: 1 - f * f, "asinh": lambda: 1 / (1 + v * v).sqrt(),
        "acosh": lambda: 1 / (v * v - 1).sqrt(), "atanh": lambda: 1 / (1 - v * v),
        "erf": lambda: 2 / arb.pi().sqrt() * (-v * v).exp(),
    }[name]  # fmt: skip
    return a.chain(f, slope())


def binary(name: str, a: DualBall, b: DualBall) -> DualBall:
    """Return an operation with two arguments."""
    v, w = a.v, b.v
    if name in ("add", "sub"):
        return a + (b if name == "add" else b.chain(-w, arb(-1)))
    if name == "mul":
        return a * b
    if name == "div":
        return a * b.chain(1 / w, -1 / (w * w)) if not w.contains(0) else a.chain(NAN, NAN)
    if name == "pow":
        whole = int(w.unique_fmpz()) if not b.d and w.is_exact() and w.is_integer() and abs(w) < 100 else None
        if whole is None:
            f = v**w if v > 0 else NAN
            return a.chain(f, w * f / v) + b.chain(arb(0), f * v.log() if v > 0 else NAN)
        if whole == 0:
            return DualBall(arb(1), {})
        fine = whole > 0 or not v.contains(0)
        return a.chain(power(v, whole), whole * power(v, whole - 1)) if fine else a.chain(NAN, NAN)
    if name == "atan2":
        square, fine = v * v + w * w, w > 0 or v < 0 or v > 0
        return a.chain(arb.atan2(v, w) if fine else NAN, w / square) + b.chain(arb(0), -v / square)
    if name in ("min", "max"):
        chosen = None if not (v < w or v >= w) else a if (v < w) == (name == "min") else b
        return chosen or (a + b).chain(NAN, NAN)
    if name == "choose":
        return (a + b).chain(NAN, NAN) if truth(v) is None else b if truth(v) else DualBall(arb(0), {})
    known = decided(name, v, w)
    return (a + b).chain(NAN if known is None else arb(int(known)), NAN if known is None else arb(0))


def power(v: Any, n: int) -> Any:
    """Return a whole power, by products: FLINT takes the logarithm of a ball that holds 0."""
    found = arb(1)
    for _ in range(abs(n)):
        found *= v
    return found if n >= 0 else 1 / found


def truth(v: Any) -> bool | None:
    """Return whether a ball is not 0, None where that is open."""
    return False if v.is_zero() else True if v > 0 or v < 0 else None


def decided(name: str, v: Any, w: Any) -> bool | None:
    """Return a comparison, None where the balls leave it open."""
    if name in ("and", "or"):
        known, end = (truth(v), truth(w)), name == "or"
        return end if end in known else None if None in known else not end
    if name == "eq":
        return True if v.is_exact() and w.is_exact() and v == w else False if v < w or v > w else None
    yes, no = (v < w, v >= w) if name == "lt" else (v <= w, v > w)
    return True if yes else False if no else None


def rationals(F: dict[str, Any], x: list[Any]) -> list[Any]:
    """Return F(x) over the rationals; raises KeyError where an operation leaves them."""
    known = [*x, *(exact(v) for v in F["constants"].tolist())]
    for name, i, j in operations(F):
        a, b = known[i], known[j] if j >= 0 else fmpq(0)
        if name == "exp":
            require(a == 0, "an exponential is irrational")
        if name == "pow":
            require(b.q == 1 and abs(b) < 1000, "a power is irrational")
        known.append(
            {
                "neg": lambda a=a: -a, "abs": lambda a=a: abs(a), "exp": lambda: fmpq(1),
                "add": lambda a=a, b=b: a + b, "sub": lambda a=a, b=b: a - b, "mul": lambda a=a, b=b: a * b,
                "div": lambda a=a, b=b: a / b, "pow": lambda a=a, b=b: a ** int(b.p), "min": lambda a=a, b=b: min(a, b),
                "max": lambda a=a, b=b: max(a, b),
            }[name]()
        )  # fmt: skip
    return [known[k] for k in F["outputs"].tolist()]


def dependent(F: dict[str, Any], rows: list[int], held: dict[int, float]) -> set[int]:
    """Places of rows that are combinations of the other rows, as exact sums of what is not linear."""
    ops, inputs, constants = operations(F), int(F["inputs"]), F["constants"].tolist()
    sums: list[dict[int, Any]] = []
    for number in range(inputs + len(constants) + len(ops)):
        k = number - inputs - len(constants)
        fixed = held.get(number) if number < inputs else constants[number - inputs] if k < 0 else None
        own = {number: fmpq(1)} if fixed is None else {-1: exact(fixed)} if fixed else {}
        if k >= 0:
            name, a, b = ops[k]
            left, right = sums[a], sums[b] if b >= 0 else {}
            if name in ("add", "sub", "neg"):
                sign = 1 if name == "add" else -1
                own = {j: left.get(j, fmpq(0)) + sign * right.get(j, fmpq(0)) for j in left.keys() | right.keys()}
                own = {j: -v for j, v in left.items()} if name == "neg" else own
            elif name in ("mul", "div") and right.keys() == {-1}:
                own = {j: v * right[-1] if name == "mul" else v / right[-1] for j, v in left.items()}
            elif name == "mul" and left.keys() == {-1}:
                own = {j: v * left[-1] for j, v in right.items()}
        sums.append({j: v for j, v in own.items() if v != 0})
    chosen = [sums[F["outputs"].tolist()[i]] for i in rows]
    terms = sorted({j for own in chosen for j in own})
    table, rank = fmpq_mat([[own.get(j, fmpq(0)) for own in chosen] for j in terms]).rref()
    pivots = {next(j for j, v in enumerate(row) if v != 0) for row in table.tolist()[: int(rank)]}
    return set(range(len(rows))) - pivots
