"""The dual method of Goldfarb and Idnani (1983, Math. Programming 27:1, section 3) for min ½xᵀQx + pᵀx, Q ≻ 0.

Constraints are Nx ≥ b, the first `equations` of them equations. Every step inverts what it needs.
"""

import numpy as np

SMALL = 1e-10


def dual_active_set(Q, p, N, b, equations: int, most: int = 1000) -> tuple[np.ndarray | None, np.ndarray]:
    """Return x (n,) and the multipliers u (rows,), ≥ 0 beyond the equations; None in place of x where the constraints
    contradict each other."""
    inverse = np.linalg.inv(Q)
    x, u, active = -inverse @ p, np.zeros(b.size), []  # step 0: the unconstrained minimum
    for _ in range(most):
        s = N @ x - b
        broken = np.where(np.arange(b.size) < equations, np.abs(s), -s)
        broken[active] = 0.0
        missing = [i for i in range(equations) if i not in active]
        new = missing[0] if missing else int(broken.argmax())
        if not missing and broken[new] <= SMALL * (1 + abs(b[new])):  # step 1: nothing is violated
            return x, u
        sign = -1.0 if s[new] > 0 else 1.0  # only an equation may be violated from above
        while True:
            n = sign * N[new]
            A = N[active]
            # step 2a: z, the direction in x, and r, the infeasibility multipliers of the active ones
            gram = np.linalg.inv(A @ inverse @ A.T) if active else np.zeros((0, 0))
            r = gram @ A @ inverse @ n
            z = inverse @ (n - A.T @ r)
            # step 2b: t₁ keeps the multipliers feasible, t₂ reaches the constraint
            ratios = [u[i] / r[j] if i >= equations and r[j] > SMALL else np.inf for j, i in enumerate(active)]
            t1 = min(ratios, default=np.inf)
            t2 = -sign * (N[new] @ x - b[new]) / (z @ n) if z @ n > SMALL * (n @ inverse @ n) else np.inf
            t = min(t1, t2)
            if t == np.inf:  # step 2c(i): infeasible
                return None, u
            u[active] -= t * r
            u[new] += sign * t
            if t2 < np.inf:  # step 2c(iii), else (ii): a step in the dual space alone
                x = x + t * z
            if t == t2:
                active.append(new)
                break
            u[active.pop(int(np.argmin(ratios)))] = 0.0
    raise RuntimeError(f"{most} steps")
