"""OSQP replaces a right answer by a wrong one when it polishes, and says "solved".

The data are those of github.com/osqp/osqp/issues/790.
"""

from importlib.metadata import version

import numpy as np
import osqp
import scipy.sparse as sp

import cpbench as cp

P = np.array(
    [
        [4.1808645950911965, 0.44690128191460515, 1.8366797318100276, 1.790246466328951],
        [0.44690128191460515, 1.0017895414423332, 0.36306796713298567, -1.7084875079784945],
        [1.8366797318100276, 0.36306796713298567, 1.2136981891025493, 0.5144624591668353],
        [1.790246466328951, -1.7084875079784945, 0.5144624591668353, 5.390092402940427],
    ]
)
q = np.array([2.5229445413976057, -0.7641899948191101, 0.6813963386073322, -1.580571417946669])
A = np.array([[6802.195057324533, 859169.6071018894, 1307081.4281253067, 881514.7112147971]])
low, high = np.array([-490209.4743924113]), np.array([724880.97957331])
qp = cp.QP(Q=P, p=q, A=np.vstack([A, -A]), b=np.concatenate([low, -high]))
print("osqp", version("osqp"))
for polishing in (False, True):
    solver = osqp.OSQP()
    upper = sp.csc_matrix(np.triu(P))
    solver.setup(upper, q, sp.csc_matrix(A), low, high, eps_abs=1e-9, eps_rel=1e-9, polishing=polishing, verbose=False)
    answer = solver.solve()
    gradient = np.abs(P @ answer.x + q + A.T @ answer.y).max()
    error = cp.verify(qp, answer.x).error  # with the multipliers that fit x best
    said = f"{answer.info.status}, status_polish {answer.info.status_polish}"
    print(f"polishing={polishing}: {said}; dual residual {gradient:.1e}; error by cpbench {error:.3g}")
