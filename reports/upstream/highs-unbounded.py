"""HiGHS says "Optimal" of a convex QP of three unknowns that is unbounded below, with default settings.

Minimize ½xᵀQx - x₂ without constraints, Q = BᵀB: Qv = 0 for v = (-1, 1, 1), so that it is -t at tv for every t.
The point is that of Q + 1e-7 I (the default of qp_regularization_value: highs-regularization.py).

    highspy 1.16.0 Optimal
    objective -3.33333e+06, largest entries of x 3.3e+06, of the gradient 0.33
    Qv = [0. 0. 0.], cᵀv = -1; objective at 1e9 v: -1e+09
"""

import highspy
import numpy as np

Q, c, v = np.array([[2.0, 1, 1], [1, 1, 0], [1, 0, 1]]), np.array([0.0, -1, 0]), np.array([-1.0, 1, 1])
model = highspy.HighsModel()
model.lp_.num_col_, model.lp_.num_row_, model.lp_.col_cost_ = 3, 0, c
model.lp_.col_lower_, model.lp_.col_upper_ = np.full(3, -highspy.kHighsInf), np.full(3, highspy.kHighsInf)
model.hessian_.dim_, model.hessian_.format_ = 3, highspy.HessianFormat.kTriangular
model.hessian_.start_, model.hessian_.index_, model.hessian_.value_ = [0, 3, 4, 5], [0, 1, 2, 1, 2], [2, 1, 1, 1, 1]
solver = highspy.Highs()
solver.setOptionValue("output_flag", False)
solver.passModel(model)
solver.run()
x = np.array(solver.getSolution().col_value)
print("highspy", solver.version(), solver.modelStatusToString(solver.getModelStatus()))
print(f"objective {x @ Q @ x / 2 + c @ x:.6g}, largest entries of x {np.abs(x).max():.1e}, of the gradient", end=" ")
print(f"{np.abs(Q @ x + c).max():.2g}")
print(f"Qv = {Q @ v}, cᵀv = {c @ v:g}; objective at 1e9 v: {1e18 * (v @ Q @ v) / 2 + 1e9 * (c @ v):g}")
