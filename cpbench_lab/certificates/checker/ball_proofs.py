"""Check that a box holds a solution: Krawczyk's test (Computing 4, 1969) in balls of 256 bits, all of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from certificate_file import Matrix, exact, require
from flint import arb, arb_mat, ctx, fmpq_mat
from map_values import DualBall, dependent, duals, rationals

ctx.prec = 256
OPEN, STICK, SLIDE, SMOOTH = 0, 1, 2, 3


def krawczyk(F: Callable[[list[Any]], list[DualBall]], evidence: dict[str, Any], rows: list[int]) -> list[Any]:
    """Return the box as balls; raises ValueError unless some rows of F vanish in it for the unknowns with a radius."""
    centre = [sum(map(arb, parts), arb(0)) for parts in evidence["centre"].tolist()]
    radius = evidence["radius"].tolist()
    require(len(radius) == len(centre) and all(r >= 0 for r in radius), "the box has no radius")
    free = [j for j, r in enumerate(radius) if r > 0]
    require(len(free) == len(rows), "the equations do not belong to the unknowns")
    box = [c + arb(0, r) if r > 0 else c for c, r in zip(centre, radius, strict=True)]
    if not free:
        return box
    slopes, values = F([DualBall.of(v, j) for j, v in enumerate(box)]), F([DualBall.of(v, -1) for v in centre])
    place = {j: k for k, j in enumerate(free)}
    table = [[slopes[i].d.get(j, arb(0)) for j in place] for i in rows]
    require(all(v.is_finite() for row in table for v in row), "the system is not smooth in the box")
    units = [2.0 ** int(np.frexp(radius[j])[1]) for j in free]
    J = arb_mat([[v * u for v, u in zip(row, units, strict=True)] for row in table])
    middle, one = arb_mat([[v.mid() for v in row] for row in J.tolist()]), arb_mat(np.eye(len(free)).tolist())
    residual, width = (arb_mat([[v] for v in part]) for part in (
        [values[i].v for i in rows], [(box[j] - centre[j]) / u for j, u in zip(free, units, strict=True)]))  # fmt: skip
    # any C may be tried: one in doubles is quick, one in balls has more digits
    for inverse in (lambda: np.linalg.inv([[float(v) for v in row] for row in middle.tolist()]), middle.inv):
        try:
            C = arb_mat([[arb(v).mid() for v in row] for row in inverse().tolist()])
        except (np.linalg.LinAlgError, ZeroDivisionError):
            continue
        # in units: K = −C·F(centre) + (I − C·J)·(box − centre)
        moved = (one - C * J) * width - C * residual
        if all(box[j].contains_interior(centre[j] + moved[k, 0] * units[k]) for k, j in enumerate(free)):
            return box
    raise ValueError("Krawczyk's test fails")


def distance(answer: list[float], box: list[Any], claimed: float) -> None:
    """Raise ValueError unless the answer is as near as claimed to every point of the box."""
    require(len(answer) == len(box), "the answer has the wrong size")
    size = max((v.abs_lower() for v in box), default=arb(0))
    size = size if size > 0 else arb(1)
    near = all(abs(v - arb(a)) <= arb(claimed) * size * (1 + arb(2) ** -40) for v, a in zip(box, answer, strict=True))
    require(near, "the answer is farther from the box")


class ContactEquations:
    """u = Vx + q, Lx + a = 0, x = (y, r), of a contact problem."""

    def __init__(self, node: str, d: dict[str, Any]) -> None:
        self.mu = d["mu"].tolist()
        if node == "gfc":
            size, joints = d["f"].size, d["b"].size
            own = [(0, 0, d["M"], 1), (0, size, d["G"], -1), (0, size + joints, d["H"], -1), (size, 0, d["G"].T, 1)]
            u, a, q = [(0, d["H"].T)], np.concatenate([-d["f"], d["b"]]), d["w"]
        elif node == "fcm":
            own = [(0, 0, d["R"], 1), (0, d["s"].size, d["V"].T, 1)]
            u, a, q = [(0, d["V"]), (d["s"].size, d["W"])], d["s"], d["q"]
        else:
            own, u, a, q = [], [(0, d["W"])], np.zeros(0), d["q"]
        self.k, self.a, self.q = a.size, a.tolist(), q.tolist()
        self.L: list[dict[int, float]] = [{} for _ in self.a]
        self.V: list[dict[int, float]] = [{} for _ in self.q]
        for i, j, block, sign in own:
            _put(self.L, i, j, block, sign)
        for j, block in u:
            _put(self.V, 0, j, block, 1)

    def apply(self, x: list[Any], number: Callable[[float], Any]) -> tuple[list[Any], list[Any]]:
        """Lx + a and Vx + q."""
        return tuple(  # type: ignore[return-value]
            [sum((x[j] * number(v) for j, v in row.items()), number(c)) for row, c in zip(rows, constants, strict=True)]
            for rows, constants in ((self.L, self.a), (self.V, self.q))
        )

    def system(self, states: list[int]) -> Callable[[list[Any]], list[DualBall]]:
        """Return the equations of these states."""

        def F(x: list[Any]) -> list[DualBall]:
            found, u = self.apply(x, lambda v: DualBall(arb(v), {}))
            for c, state in enumerate(states):
                v, r = u[3 * c : 3 * c + 3], x[self.k + 3 * c : self.k + 3 * c + 3]
                if state == SLIDE:
                    speed = (v[1] * v[1] + v[2] * v[2]).sqrt()
                    limit = r[0] * DualBall(arb(self.mu[c]), {})
                    found += [v[0], speed * r[1] + limit * v[1], speed * r[2] + limit * v[2]]
                else:
                    found += r if state == OPEN else v if state == STICK else [v[0], r[1], r[2]]
            return found

        return F

    def lawful(self, states: list[int], box: list[Any]) -> bool:
        """Return whether what the equations leave open holds for certain."""
        _, u = self.apply(box, arb)
        for c, state in enumerate(states):
            v, r, mu = u[3 * c : 3 * c + 3], box[self.k + 3 * c : self.k + 3 * c + 3], arb(self.mu[c])
            rub, slip, limit = r[1] * r[1] + r[2] * r[2], v[1] * v[1] + v[2] * v[2], mu * r[0] * mu * r[0]
            if state not in (OPEN, STICK, SLIDE, SMOOTH) or (state == SMOOTH and mu != 0):
                return False
            if not (v[0] >= 0 if state == OPEN else r[0] >= 0 and (state != STICK or rub <= limit)):
                return False
            if state == SLIDE and not slip > 0:
                return False
        return True

    def implied(self, states: list[int], dropped: list[int]) -> bool:
        """Return whether the equations that are dropped follow exactly from the others, by ranks over the rationals."""
        linear = [3 * c + i for c, s in enumerate(states) for i in range(3) if s == STICK or (s != OPEN and i == 0)]
        kept = [i for i in linear if self.k + i not in dropped]
        if not all(i - self.k in linear for i in dropped):
            return False
        width, some = self.k + len(self.q), kept + [i - self.k for i in dropped]
        rows = [[*(exact(self.V[i].get(j, 0.0)) for j in range(width)), exact(self.q[i])] for i in some]
        return fmpq_mat(rows).rank() == fmpq_mat(rows[: len(kept)]).rank() if kept else False


def _put(K: list[dict[int, float]], row: int, column: int, block: Matrix, sign: float) -> None:
    for i, entries in enumerate(block.rows):
        K[row + i].update({column + j: sign * v for j, v in entries.items()})


def contacts(own: dict[str, Any], data: dict[str, Any], answer: Any, evidence: dict[str, Any]) -> None:
    """Check a box, or an exact point, of a contact problem in space."""
    scene = ContactEquations(own["node"], data)
    require(len(scene.q) == 3 * len(scene.mu), "is no contact in space")
    start = data["f"].size if own["node"] == "gfc" else 0
    given = answer[start : start + len(scene.q)].tolist()
    if "point" in evidence:
        x = [exact(v) for v in evidence["point"].tolist()]
        equations, u = scene.apply(x, exact)
        require(not any(equations), "an equation does not hold")
        for c, mu in enumerate(map(exact, scene.mu)):
            (u_N, u_1, u_2), (r_N, r_1, r_2) = u[3 * c : 3 * c + 3], x[scene.k + 3 * c : scene.k + 3 * c + 3]
            room = mu * mu * r_N * r_N - r_1 * r_1 - r_2 * r_2
            opposite = room == 0 and u_1 * r_2 == u_2 * r_1 and u_1 * r_1 + u_2 * r_2 <= 0
            lawful = u_N >= 0 and r_N >= 0 and u_N * r_N == 0 and (opposite or (room >= 0 and u_1 == u_2 == 0))
            require(bool(lawful), f"contact {c} breaks its law")
        return distance(given, [arb(v) for v in evidence["point"].tolist()[scene.k :]], own["distance"])
    states, dropped = evidence["states"].tolist(), evidence["dropped"].tolist()
    require(len(states) == len(scene.mu), "some contacts have no state")
    require(not dropped or scene.implied(states, dropped), "an equation was dropped that the others do not imply")
    apart = {scene.k + 3 * c + i for c, state in enumerate(states) if state == OPEN for i in range(3)}
    still = all(not evidence["centre"][j].any() and evidence["radius"][j] == 0 for j in apart)
    require(still, "an open contact has a force")
    rows = [i for i in range(scene.k + len(scene.q)) if i not in apart.union(dropped)]
    box = krawczyk(scene.system(states), evidence, rows)
    require(scene.lawful(states, box), "a contact may break its law in the box")
    return distance(given, box[scene.k :], own["distance"])


def maps(own: dict[str, Any], data: dict[str, Any], answer: Any, evidence: dict[str, Any]) -> None:
    """Check a box, or an exact point, of an NCP, a MiCP or an equation."""
    F, n, inf = data["F"], answer.size, float("inf")
    lo, hi = {"ncp": ([0.0] * n, [inf] * n), "equation": ([-inf] * n, [inf] * n)}.get(own["node"], (None, None))
    lo, hi = (lo, hi) if lo else (data["lb"].tolist(), data["ub"].tolist())
    if "point" in evidence:
        x = evidence["point"].tolist()
        for v, f, low, high in zip(x, rationals(F, [exact(v) for v in x]), lo, hi, strict=True):
            fits = low == high or f == 0 or (f > 0 and v == low) or (f < 0 and v == high)
            require(bool(fits and low <= v <= high), "a condition does not hold")
        return distance(answer.tolist(), [arb(v) for v in x], own["distance"])
    states, dropped = evidence["states"].tolist(), set(evidence["dropped"].tolist())
    centre, radius = evidence["centre"].tolist(), evidence["radius"].tolist()
    basic = [i for i, s in enumerate(states) if s == 0]
    held = {i: (lo if s < 0 else hi)[i] for i, s in enumerate(states) if s}
    require(
        all(centre[i][0] == v and not any(centre[i][1:]) and radius[i] == 0 for i, v in held.items()),
        "an unknown is not at its bound",
    )
    require(not dropped or dropped <= dependent(F, basic, held), "an equation was dropped that others do not imply")
    box = krawczyk(lambda x: duals(F, x), evidence, [i for k, i in enumerate(basic) if k not in dropped])
    for i, f in enumerate(duals(F, [DualBall(v, {}) for v in box])):
        s, v = states[i], box[i]
        fine = lo[i] <= v <= hi[i] if s == 0 else lo[i] == hi[i] or (f.v >= 0 if s < 0 else f.v <= 0)
        require(bool(fine), f"a condition at unknown {i} is not certain")
    return distance(answer.tolist(), box, own["distance"])
