"""The dual active set of a strictly convex quadratic program, in the coordinates where its Hessian is the identity.

min ½‖v − v₀‖² subject to lower ≤ Mv ≤ upper, the rows of M of length 1. With multipliers y (positive at lower bounds,
negative at upper ones) v = v₀ + Mᵀy. W is the working set, K = M_W M_Wᵀ = RᵀR its Gram matrix with the factor R, which
is updated as rows come and go. One pass goes from y towards the maximiser of the dual function over W as far as signs
allow, and drops the rows whose multiplier reaches 0. When W is optimal the worst violated row joins (Goldfarb and
Idnani 1983), or several at once: a pass then goes the whole way and drops every row of the wrong sign. Where that did
not raise the dual function it is taken back.

Reference in plain NumPy: `tests/solvers/references/dual_active_set.py`.
"""

import numpy as np

from cpbench.foundation.kernels import boolean, float64, helper, int64, kernel, read_only, void
from cpbench_solvers.kernels.qp_dense import dot
from cpbench_solvers.kernels.vectors import put

SOLVED, LIMIT, INFEASIBLE, STALLED = 0, 1, 2, 3
JOINED, GONE, RAY = 0, 1, 2
"""What `_enter` did."""
FREE = -1
"""The place of a row outside W."""
LEAVING = -2
"""The place of a row that is about to leave W."""
COUNT, PASSES, INNER, TOGETHER, ALONE, PART, STUCK, REFINED = 0, 1, 2, 3, 4, 5, 6, 7
OPERATIONS, BUILT, LEFT, ROOM, STATES = 8, 9, 10, 11, 12
"""Places of `state`: rows in W, passes done, whether W is not yet optimal, whether rows joined together, whether the
next joins alone, the part of the free places that rows may take, how often the dual function did not gain, passes for
accuracy alone. Operations of this call. What a call may leave to the next one: rows of M that were looked at for the
first W, places of W that are not yet searched for leaving rows, rows that may still join together. Their number."""
PATIENCE = 50
"""So often the dual function may stand still, rows joining one at a time, before the method gives up."""
FIRST_PART = 5
"""Rows that join together take a fifth of the free places at most; a half of that whenever it did not pay."""
PARALLEL = 1e-7
"""A row whose part outside the span of W is shorter than this depends on W."""
CANCELS = 0.01
"""Squares of lengths below this are not taken from a difference."""
APART = 1e-3
"""The same for a row that joins together with others."""
SHARE = 0.3
"""Rows join together when their violation is at least this times the greatest one."""
ABREAST = 8
"""So many of them are projected on the span of W in one reading of its rows: numbers of one vector of the processor."""

_VECTOR = read_only(float64)
_MATRIX = read_only(float64, 2)
_OUT = float64[::1]
_OUT2 = float64[:, ::1]
_INT = int64[::1]


@kernel(void(_OUT2, _OUT))
def normalise(M, norms):
    """Scale the rows of M to length 1; norms : (N,) what they were, 0 for rows that are zero."""
    for i in range(M.shape[0]):
        row = M[i]
        length = np.sqrt(dot(row, row))
        norms[i] = length
        if length > 0.0:
            for j in range(row.size):
                row[j] /= length


@helper(void(_OUT2, int64, int64, _OUT))
def _forward(R, first, count, x):
    """Set x ← R⁻ᵀx, R and x from `first` to `count`."""
    for j in range(first, count):
        row = R[j]
        x[j] /= row[j]
        for i in range(j + 1, count):
            x[i] -= row[i] * x[j]


@helper(void(_OUT2, int64, _OUT))
def _backward(R, count, x):
    """Set x ← R⁻¹x."""
    for j in range(count - 1, -1, -1):
        x[j] = (x[j] - dot(R[j, j + 1 : count], x[j + 1 : count])) / R[j, j]


@helper(float64(_MATRIX, _OUT2, _INT, int64, int64, _OUT))
def _outside(M, R, W, count, p, work):
    """Return length of the part of row p outside the span of W; work[:count] : R⁻ᵀM_W m_p. work : (3n,)

    Where it is small, 1 − ‖R⁻ᵀM_W m_p‖² cancels: the part itself is computed then, and once more from itself.
    """
    m, n = M[p], M.shape[1]
    column = work[:count]
    for j in range(count):
        column[j] = dot(M[W[j]], m)
    _forward(R, 0, count, column)
    square = 1.0 - dot(column, column)  # rows have length 1
    if square > CANCELS:
        return np.sqrt(square)
    rest, change = work[n : 2 * n], work[2 * n : 2 * n + count]
    column[:] = 0.0
    put(rest, m)
    for _ in range(2):  # twice is enough (Parlett 1980, section 6.9, after Kahan)
        for j in range(count):
            change[j] = dot(M[W[j]], rest)
        _forward(R, 0, count, change)
        for j in range(count):
            column[j] += change[j]
        _backward(R, count, change)
        for j in range(count):
            row, by = M[W[j]], change[j]
            for k in range(n):
                rest[k] -= by * row[k]
    return np.sqrt(dot(rest, rest))


@helper(void(_OUT2, _INT, _INT, int64, float64, _OUT, int64))
def _join(R, W, where, p, length, column, count):
    """Add row p to W as its last; column, length : what `_outside` found."""
    for j in range(count):
        R[j, count] = column[j]
    R[count, count] = length
    W[count] = p
    where[p] = count


@helper(void(_OUT2, _INT, _INT, int64, int64))
def _drop(R, W, where, k, count):
    """Remove the row at place k from W: its column goes, rotations of two rows make R triangular again."""
    where[W[k]] = FREE
    for j in range(k, count - 1):
        W[j] = W[j + 1]
        where[W[j]] = j
    for i in range(count):
        row = R[i]
        for j in range(max(k, i - 1), count - 1):
            row[j] = row[j + 1]
    for j in range(k, count - 1):
        a, b = R[j, j], R[j + 1, j]
        h = np.hypot(a, b)  # never 0: R has a positive diagonal
        c, s = a / h, b / h
        first, second = R[j], R[j + 1]
        first[j] = h  # the rotation makes second[j] 0, where nothing is read
        for i in range(j + 1, count - 1):
            f, g = first[i], second[i]
            first[i] = c * f + s * g
            second[i] = c * g - s * f


@helper(boolean(_OUT2, _INT, _INT, _INT, int64))
def _leave(R, W, where, state, most):
    """Remove the rows that are to leave W; return whether `most` operations were enough."""
    while state[LEFT] > 0:
        if state[OPERATIONS] > most:
            return False
        state[LEFT] -= 1  # from the last: what moves up has been looked at
        k, count = state[LEFT], state[COUNT]
        if where[W[k]] == LEAVING:
            _drop(R, W, where, k, count)
            state[COUNT] = count - 1
            state[OPERATIONS] += 3 * (count - k) ** 2 + count
    return True


@helper(void(_MATRIX, _VECTOR, _VECTOR, _INT, int64, _OUT))
def _primal(M, v0, y, W, count, v):
    """Set v = v₀ + Mᵀy."""
    for k in range(v.size):
        v[k] = v0[k]
    for j in range(count):
        row, by = M[W[j]], y[W[j]]
        for k in range(v.size):
            v[k] += by * row[k]


@helper(int64(_MATRIX, int64, float64, float64, _OUT, _OUT2, _INT, _INT, _INT, _INT, _OUT))
def _enter(M, p, sign, most, y, R, W, where, side, state, work):
    """Add row p to W. While it depends on W, v does not notice when its multiplier goes up (`sign` 1) or down
    (-1) at the cost of the others': it does so, by `most` at most, until one of those is 0 and leaves.

    Returns JOINED; GONE after `most`, its multiplier then counts as 0; RAY when nothing blocks and `most` is infinite:
    y is then a direction along which the dual function grows for ever.
    """
    while True:
        count = state[COUNT]
        length = _outside(M, R, W, count, p, work)
        state[OPERATIONS] += count * (count + M.shape[1]) + M.shape[1]
        if length > PARALLEL and count < M.shape[1]:  # a full W spans all: what is new then is rounding
            _join(R, W, where, p, length, work, count)
            state[COUNT] = count + 1
            return JOINED
        r = work
        _backward(R, count, r)
        top = 0.0
        for j in range(count):
            top = max(top, abs(r[j]))
        step, leaving = most, -1
        for j in range(count):
            i = W[j]
            # an entry of the size of rounding would block by a step of any length
            if side[i] * sign * r[j] > 1e-11 * top and abs(y[i]) < step * abs(r[j]):
                step, leaving = abs(y[i] / r[j]), j
        if step == np.inf:  # no multiplier falls: y grows along r for ever, and the constraints contradict each other
            y[:] = 0.0
            y[p] = sign
            for j in range(count):
                y[W[j]] = -sign * r[j]
            return RAY
        for j in range(count):
            y[W[j]] -= sign * step * r[j]
        if leaving < 0:
            y[p] = 0.0
            return GONE
        most -= step  # one row has left: the rest of the way goes with a smaller W
        y[p] += sign * step
        y[W[leaving]] = 0.0
        _drop(R, W, where, leaving, count)
        state[COUNT] = count - 1
        state[OPERATIONS] += 3 * (count - leaving) ** 2 + count


@kernel(void(_MATRIX, _VECTOR, _OUT, _OUT, _INT, _INT))
def begin(M, v0, v, y, where, state):
    """Begin again from y, W empty: `advance` builds it.

    Arrays as for `advance`.
    """
    where[:] = FREE
    state[COUNT] = state[BUILT] = state[LEFT] = state[ROOM] = 0
    for k in range(v.size):
        v[k] = v0[k]
    for i in range(y.size):
        if y[i] != 0.0:
            row, by = M[i], y[i]
            for k in range(v.size):
                v[k] += by * row[k]


@helper(boolean(*(_MATRIX, _VECTOR, _VECTOR, _VECTOR, _OUT, _OUT, _OUT2, _INT, _INT, _INT, _INT, _OUT), int64))
def _build(M, lower, upper, v0, v, y, R, W, where, side, state, work, most):
    """Build W from the equalities and the rows of which y is not 0, less those that depend on others: their share of y
    goes to the others where signs allow it. Return whether `most` operations were enough."""
    while state[BUILT] < y.size:
        if state[OPERATIONS] > most:
            return False
        p = state[BUILT]
        equal = lower[p] == upper[p]
        if equal or y[p] != 0.0:  # equations always hold, whatever their multiplier
            side[p] = 0 if equal else (1 if y[p] > 0.0 else -1)
            _enter(M, p, -1.0 if y[p] > 0.0 else 1.0, abs(y[p]), y, R, W, where, side, state, work)
        state[BUILT] = p + 1
        if state[BUILT] == y.size:
            state[INNER] = 1 if state[COUNT] > 0 else 0
            _primal(M, v0, y, W, state[COUNT], v)
    return True


@helper(void(_MATRIX, _VECTOR, _VECTOR, _VECTOR, _OUT, _OUT, _OUT2, _INT, _INT, _INT, _INT, _OUT))
def _towards_maximiser(M, lower, upper, v0, v, y, R, W, where, side, state, work):
    """Make one pass; the rows that are to leave W are marked."""
    count = state[COUNT]
    state[OPERATIONS] += count * (count + 2 * v.size) + v.size
    change = work
    for j in range(count):
        i = W[j]
        # what v misses of the bounds of W, as if all were equations
        change[j] = (upper[i] if side[i] < 0 else lower[i]) - dot(M[i], v)
    _forward(R, 0, count, change)
    _backward(R, count, change)
    step = 1.0
    for j in range(count):
        i = W[j]
        # the first multiplier that reaches 0 ends the step; equations have side 0
        if not state[TOGETHER] and side[i] * (y[i] + change[j]) < 0.0:
            step = min(step, -y[i] / change[j])
    state[INNER], state[LEFT] = 0, count
    for j in range(count):
        i = W[j]
        after = y[i] + step * change[j]
        if side[i] * (y[i] + change[j]) < 0.0 and (-y[i] / change[j] <= step or side[i] * after <= 0.0):
            y[i] = 0.0
            where[i] = LEAVING
            state[INNER] = 1
        else:
            y[i] = after
    _primal(M, v0, y, W, count, v)


@helper(int64(_OUT, float64, _INT, _OUT))
def _take_worst(violation, least, rows, signs):
    """Write the rows of the greatest violations above `least`, and the signs of these, which are 0 then; return their
    number."""
    for k in range(rows.size):
        p, worst = -1, least
        for i in range(violation.size):
            if abs(violation[i]) > worst:
                p, worst = i, abs(violation[i])
        if p < 0:
            return k
        rows[k], signs[k] = p, np.sign(violation[p])
        violation[p] = 0.0
    return rows.size


@helper(void(_MATRIX, _OUT2, _INT, int64, _INT, int64, _OUT2))
def _project(M, R, W, count, rows, many, X):
    """Write as column k of X what `_outside` has as a column for row k, for many rows at once."""
    X[:] = 0.0
    for j in range(count):
        row = M[W[j]]
        for k in range(many):
            X[j, k] = dot(row, M[rows[k]])
    for j in range(count):
        row, from_one = R[j], X[j]
        for k in range(ABREAST):
            from_one[k] /= row[j]
        for i in range(j + 1, count):
            to, by = X[i], row[i]
            for k in range(ABREAST):
                to[k] -= by * from_one[k]


@helper(boolean(*(_MATRIX, float64, _OUT, _VECTOR, _VECTOR, _OUT2, _INT, _INT, _INT, _INT, _OUT, int64)))
def _join_others(M, least, violation, lower, upper, R, W, where, side, state, work, most):
    """Add the rows violated by `least` at least to W, the worst first; those that nearly depend on it do not. Return
    whether `most` operations were enough."""
    n, rows, signs = M.shape[1], np.empty(ABREAST, np.int64), np.empty(ABREAST)
    columns = np.empty((n, ABREAST))
    while state[ROOM] > 0:
        if state[OPERATIONS] > most:
            return False
        many, first = _take_worst(violation, least, rows[: state[ROOM]], signs), state[COUNT]
        if many == 0:
            state[ROOM] = 0
            return True
        _project(M, R, W, first, rows, many, columns[:first])
        state[OPERATIONS] += many * (first * (first + n) + violation.size)
        for k in range(many):
            p, count, column = rows[k], state[COUNT], work[: state[COUNT]]
            state[ROOM] -= 1
            for j in range(first):
                column[j] = columns[j, k]
            for j in range(first, count):  # those that have joined before it
                column[j] = dot(M[W[j]], M[p])
            for i in range(first):
                row, by = R[i], column[i]
                for j in range(first, count):
                    column[j] -= row[j] * by
            _forward(R, first, count, column)
            square = 1.0 - dot(column, column)
            length = np.sqrt(square) if square > CANCELS else _outside(M, R, W, count, p, work)
            if length > APART:  # nearly dependent rows that join at once would make R useless
                side[p] = 0 if lower[p] == upper[p] else int(signs[k])
                _join(R, W, where, p, length, work, count)
                state[COUNT] = count + 1
                state[TOGETHER] = 1
    return True


@kernel(
    int64(
        *(_MATRIX, _VECTOR, _VECTOR, _VECTOR, _OUT, _OUT, _OUT2, _INT, _INT, _INT, _INT, _OUT, _OUT, _OUT),
        *(int64, int64, float64),
    )
)
def advance(M, lower, upper, v0, v, y, R, W, where, side, state, gained, before, work, max_passes, most, tolerance):
    """Make passes until v is feasible, or `max_passes` are done, or soon after `most` operations: the next call goes on
    where this one has stopped, and v and y belong together all the time. On INFEASIBLE y is the ray that proves it.

    Parameters
    ----------
    M : (N, n). lower, upper : (N,), equal for equalities. v0, v : (n,). y : (N,). R : (n, n). W : (n,).
    where : (N,) place in W, FREE or LEAVING. side : (N,) of rows in W: 1 lower, -1 upper, 0 equality. state :
    (STATES,). gained : (2,) value of the dual function when rows joined last, and the violation with which others join
    them. before : (N,) y then. work : (3n + N,), kept between calls.
    tolerance : on violations, relative to the bound and to v.
    """
    N, n = M.shape
    violation = work[3 * n :]
    # rounding of v, which is made from v0: a violation below it cannot be mended
    floor = 4.0 * np.finfo(np.float64).eps * np.sqrt(float(n)) * np.sqrt(dot(v0, v0))
    state[OPERATIONS] = 0
    while True:
        if not _build(M, lower, upper, v0, v, y, R, W, where, side, state, work, most):
            return LIMIT
        if not _join_others(M, gained[1], violation, lower, upper, R, W, where, side, state, work, most):
            return LIMIT
        if not _leave(R, W, where, state, most):
            return LIMIT
        while state[INNER]:
            if state[PASSES] >= max_passes or state[OPERATIONS] > most:
                return LIMIT
            state[PASSES] += 1
            _towards_maximiser(M, lower, upper, v0, v, y, R, W, where, side, state, work)
            if not _leave(R, W, where, state, most):
                return LIMIT
        if state[OPERATIONS] > most:
            return LIMIT
        state[OPERATIONS] += N * n
        size = np.sqrt(dot(v, v))
        if not size < np.inf:
            return STALLED
        worst, p, inaccurate = 0.0, -1, False
        for i in range(N):
            value = dot(M[i], v)
            over = max(lower[i] - value, value - upper[i])
            bound = lower[i] if lower[i] > value else upper[i]
            allowed = tolerance * max(size, abs(bound)) + floor
            if where[i] >= 0:
                inaccurate = inaccurate or over > allowed
                violation[i] = 0.0
                continue
            violation[i] = (over if lower[i] > value else -over) if over > allowed else 0.0
            if abs(violation[i]) > worst:
                worst, p = abs(violation[i]), i
        if inaccurate and state[REFINED] < 3:
            state[REFINED] += 1
            state[INNER] = 1
            continue
        if p < 0:
            return SOLVED
        if state[PASSES] >= max_passes:
            return LIMIT
        value = 0.0
        for k in range(n):
            value += (v[k] - v0[k]) ** 2  # the dual function at its maximum over W, twice
        if not value > gained[0] * (1.0 + 1e-14):
            if state[TOGETHER]:  # rows that joined at once went too far: back to before, and half as many from then on
                put(y, before)
                state[PART] *= 2
                state[TOGETHER] = 0
                begin(M, v0, v, y, where, state)
                state[ALONE] = 1
                continue
            state[STUCK] += 1
            if state[STUCK] > PATIENCE:
                return STALLED
        gained[0] = max(gained[0], value)
        put(before, y)
        sign = 1.0 if violation[p] > 0.0 else -1.0
        side[p] = 0 if lower[p] == upper[p] else int(sign)
        state[REFINED], state[INNER], state[TOGETHER] = 0, 1, 0
        if _enter(M, p, sign, np.inf, y, R, W, where, side, state, work) == RAY:
            return INFEASIBLE
        if y[p] != 0.0:
            _primal(M, v0, y, W, state[COUNT], v)
        elif not state[ALONE]:  # the worst joins first; others of its size may be right too
            violation[p] = 0.0
            gained[1], state[ROOM] = SHARE * worst, (n - state[COUNT]) // state[PART]
        state[ALONE] = 0
