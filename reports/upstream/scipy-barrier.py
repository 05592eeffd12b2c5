"""SciPy's trust-constr ends with success while its barrier parameter is 3200 times its own limit, with default options.

Minimize x²/100 where 1 ≤ x ≤ 50; the solution is x = 1. SciPy's page says of `barrier_tol`, 1e-8 by default: "When
inequality constraints are present, the algorithm will terminate only when the barrier parameter is less than
`barrier_tol`." Its test of `gtol` does not look at it.

    scipy 1.17.1
    {}: success True, `gtol` termination condition is satisfied.
      x - 1 = 1.7e-03, barrier_parameter 3.2e-05, 12 iterations
    {'gtol': 0.0}: success True, `xtol` termination condition is satisfied.
      x - 1 = 6.6e-12, barrier_parameter 2.6e-14, 60 iterations
"""

import numpy as np
import scipy
from scipy.optimize import Bounds, minimize

print("scipy", scipy.__version__)
for options in ({}, {"gtol": 0.0}):
    found = minimize(
        lambda x: x[0] ** 2 / 100,
        [3.0],
        jac=lambda x: x / 50,
        hess=lambda x: np.array([[0.02]]),
        bounds=Bounds([1.0], [50.0]),
        method="trust-constr",
        options=options,
    )
    print(f"{options}: success {found.success}, {found.message}")
    print(f"  x - 1 = {found.x[0] - 1:.1e}, barrier_parameter {found.barrier_parameter:.1e}, {found.nit} iterations")
