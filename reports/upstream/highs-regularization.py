"""HiGHS says "Optimal" of another convex QP: by default Q gets 1e-7 on its diagonal, which moves a large optimum.

Minimize -0.007 x1 + ½x2² with 0.001 x1 - 0.05 x2 <= 2000, x1 >= 0. The row binds, x2 = 0.35, x1 = 2,000,017.5. Found in
PRIMALC1 of Maros and Mészáros (n = 230), reduced. The largest entry is 0.007/1e-7; where the program is unbounded it
is "Optimal" at such a point, too (highs-unbounded.py).

    highspy 1.16.0, qp_regularization_value 1e-07: Optimal, x = (70000, 0), objective -490
    highspy 1.16.0, qp_regularization_value 0: Optimal, x = (2000017.5, 0.35), objective -14000.06125
    exact: x = (2000017.5, 0.35), objective -14000.06125
"""

import highspy
import numpy as np

model = highspy.HighsModel()
model.lp_.num_col_, model.lp_.num_row_, model.lp_.col_cost_ = 2, 1, np.array([-0.007, 0.0])
model.lp_.col_lower_, model.lp_.col_upper_ = np.array([0.0, -highspy.kHighsInf]), np.full(2, highspy.kHighsInf)
model.lp_.row_lower_, model.lp_.row_upper_ = np.array([-highspy.kHighsInf]), np.array([2000.0])
model.lp_.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
model.lp_.a_matrix_.start_, model.lp_.a_matrix_.index_, model.lp_.a_matrix_.value_ = [0, 2], [0, 1], [0.001, -0.05]
model.hessian_.dim_, model.hessian_.format_ = 2, highspy.HessianFormat.kTriangular
model.hessian_.start_, model.hessian_.index_, model.hessian_.value_ = [0, 0, 1], [1], [1.0]


def told(x):
    return f"x = ({x[0]:.8g}, {abs(x[1]):.2g}), objective {-0.007 * x[0] + 0.5 * x[1] ** 2:.10g}"


for regularization in (1e-7, 0.0):
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("qp_regularization_value", regularization)
    solver.passModel(model)
    solver.run()
    status = solver.modelStatusToString(solver.getModelStatus())
    x = np.round(solver.getSolution().col_value, 9)
    print(f"highspy {solver.version()}, qp_regularization_value {regularization:g}: {status}, {told(x)}")
print(f"exact: {told((2000017.5, 0.35))}")
