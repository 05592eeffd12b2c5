"""ProxQP calls programs of one unknown with two rows infeasible that have a solution, with default settings.

Minimize cx where -100 ≤ x ≤ -1 and -100 ≤ x ≤ u, u > -1: x = -1 meets both rows, and is the solution where c = -1.
Of Maros and Mészáros' set it calls eleven infeasible as qpsolvers hands them over (Gx <= h), HS118 among them, with
each backend and tolerance; HS118 with its rows as -Gx >= -h it solves.

    proxsuite 0.8.0
    c = -1, u = 10: PROXQP_PRIMAL_INFEASIBLE, 2 iterations; x = -1 violates rows by 0
    c = 0, u = 0: PROXQP_PRIMAL_INFEASIBLE, 1 iterations; x = -1 violates rows by 0
"""

from importlib.metadata import version

import numpy as np
from proxsuite import proxqp

print("proxsuite", version("proxsuite"))
for c, u in ((-1.0, 10.0), (0.0, 0.0)):
    solver = proxqp.dense.QP(1, 0, 2)  # one unknown, no equation, two rows
    low, high = np.array([-100.0, -100.0]), np.array([-1.0, u])
    solver.init(np.zeros((1, 1)), np.array([c]), None, None, np.ones((2, 1)), low, high)
    solver.solve()
    found = solver.results.info
    violation = max(0.0, *(low + 1.0), *(-1.0 - high))  # both rows are x itself
    print(f"c = {c:g}, u = {u:g}: {found.status.name}, {found.iter} iterations; x = -1 violates rows by {violation:g}")
