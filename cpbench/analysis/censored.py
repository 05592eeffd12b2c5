"""A line through values of which some are known only from below: times of solves that were stopped at the limit.

With y = log t, z = log x and normal errors of deviation σ, a solved problem has the density of its time and one that
was stopped at the limit c the probability of being above it (Tobin, Econometrica 26, 1958; Lawless, Statistical
Models and Methods for Lifetime Data, 2nd ed. 2003, §6.4, the lognormal regression for right-censored times):

    ℓ(a, b, σ) = Σ_solved [log φ((y − a − b z) / σ) − log σ] + Σ_stopped log Φ(−(log c − a − b z) / σ)

In θ = 1/σ, α = a/σ, β = b/σ this is concave (Olsen, Econometrica 46, 1978), so that its only maximum is found:

    ℓ = Σ_solved [log θ − (θ y − α − β z)² / 2] + Σ_stopped log Φ(−(θ log c − α − β z)) + constant

The standard error of b is the observed information's, times √(m / (m − 2)) for m solved problems; the interval takes
the t quantile of m − 2 degrees of freedom. Without a timeout both are exactly those of least squares
(`scipy.stats.linregress`). Both take the values as independent. Where only groups of them are, as problems of different
families, the interval is from the sandwich of the scores summed by group (Liang and Zeger, Biometrika 73, 1986; t of
G − 1 degrees for G groups).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

FEWEST = 8
"""Least number of groups for an interval over them."""

Floats: TypeAlias = np.ndarray[tuple[int], np.dtype[np.float64]]
Bools: TypeAlias = np.ndarray[tuple[int], np.dtype[np.bool_]]


@dataclass(frozen=True)
class FittedLine:
    """y = intercept + slope z with normal errors, some y known only from below.

    Attributes
    ----------
    error : standard error of the slope, problems independent. low, high : interval of the slope from it.
    group_low, group_high : interval with only the groups of problems independent, NaN where it was not asked for or
    they are too few. scatter : σ̂ of maximum likelihood, divided by m and not by m − 2.
    """

    slope: float
    intercept: float
    scatter: float
    error: float
    low: float
    high: float
    group_low: float = math.nan
    group_high: float = math.nan


def fit(
    z: Floats, y: Floats, censored: Bools, groups: np.ndarray[Any, Any] | None = None, level: float = 0.95
) -> FittedLine:
    """Fit the line of greatest likelihood through (z, y), y being a lower bound where `censored`.

    Raises ValueError when fewer than three values are known, when those have one z only, and when they lie on a line
    exactly while others are censored (the likelihood then has no maximum).

    >>> z = np.array([0.0, 1.0, 2.0, 3.0])
    >>> round(fit(z, np.array([0.1, 0.9, 2.1, 2.9]), np.zeros(4, dtype=bool)).slope, 12)
    0.96
    """
    from scipy import special  # here, and below, what takes a tenth of a second to import

    observed = int((~censored).sum())
    if observed < 3 or np.ptp(z[~censored]) == 0:
        raise ValueError(f"{observed} values at {len(np.unique(z[~censored]))} places: no line")
    # The fit is of standardised data: the information is then well conditioned whatever the units.
    centre, unit = float(z.mean()), float(z.std())
    design = np.column_stack([np.ones(len(z)), (z - centre) / unit])
    start = np.linalg.lstsq(design[~censored], y[~censored], rcond=None)[0]
    sigma = float(np.sqrt(np.mean((y[~censored] - design[~censored] @ start) ** 2)))
    if sigma <= 1e-10 * max(1.0, float(np.ptp(y))):
        if censored.any():
            raise ValueError("the known values lie on a line exactly: no scatter to judge the censored ones by")
        sigma = 0.0
    if censored.any():
        start, sigma, covariance, scores = _censored(design, y, censored, start, sigma)
    else:
        covariance = sigma**2 * np.linalg.inv(design.T @ design)
        scores = (design * (y - design @ start)[:, None]) / sigma**2 if sigma else np.zeros_like(design)
    slope, error = start[1] / unit, math.sqrt(covariance[1, 1] * observed / (observed - 2)) / unit
    reach = float(special.stdtrit(observed - 2, 0.5 + level / 2)) * error
    group_reach = math.nan
    if groups is not None and len(np.unique(groups)) >= FEWEST:
        group_reach = _sandwich(covariance, scores, groups, level) / unit
    return FittedLine(
        slope=float(slope),
        intercept=float(start[0] - slope * centre),
        scatter=sigma,
        error=error,
        low=float(slope - reach),
        high=float(slope + reach),
        group_low=float(slope - group_reach),
        group_high=float(slope + group_reach),
    )


def _censored(design: Any, y: Floats, censored: Bools, start: Any, sigma: float) -> tuple[Any, float, Any, Any]:
    """Maximise over (α, β, θ) and return (a, b), σ, the covariance of (a, b, σ) and every value's score by them."""
    from scipy import optimize, special

    known, bound = design[~censored], design[censored]
    above, limits = y[~censored], y[censored]

    def parts(p: Floats) -> tuple[Floats, Floats, Floats]:
        residual, beyond = p[2] * above - known @ p[:2], p[2] * limits - bound @ p[:2]
        mills = np.exp(-0.5 * beyond**2 - 0.5 * math.log(2 * math.pi) - special.log_ndtr(-beyond))
        return residual, beyond, mills

    def loss(p: Floats) -> float:
        if p[2] <= 0:
            return math.inf
        residual, beyond, _ = parts(p)
        return float(-len(above) * np.log(p[2]) + 0.5 * residual @ residual - special.log_ndtr(-beyond).sum())

    def gradients(p: Floats) -> Any:
        """Return the gradient of the log-likelihood by (α, β, θ), a row a value."""
        residual, _, mills = parts(p)
        rows = np.empty((len(y), 3))
        rows[~censored] = np.column_stack([known * residual[:, None], 1 / p[2] - residual * above])
        rows[censored] = np.column_stack([bound * mills[:, None], -mills * limits])
        return rows

    def curvature(p: Floats) -> Any:
        _, beyond, mills = parts(p)
        whole = np.column_stack([-known, above])
        over = np.column_stack([-bound, limits])
        hessian = whole.T @ whole + (over * (mills * (mills - beyond))[:, None]).T @ over
        hessian[2, 2] += len(above) / p[2] ** 2
        return hessian

    fit = optimize.minimize(
        loss,
        np.array([*(start / sigma), 1 / sigma]),
        jac=lambda p: -gradients(p).sum(axis=0),
        hess=curvature,
        method="trust-exact",
        options={"gtol": 1e-8 * len(y), "initial_trust_radius": 1.0, "max_trust_radius": 1e6},
    )
    p = fit.x
    # d(a, b, σ) / d(α, β, θ), by which covariances go there and scores come back
    theta = p[2]
    jacobian = np.array([[1 / theta, 0, -p[0] / theta**2], [0, 1 / theta, -p[1] / theta**2], [0, 0, -1 / theta**2]])
    covariance = jacobian @ np.linalg.inv(curvature(p)) @ jacobian.T
    return p[:2] / theta, 1 / theta, covariance, gradients(p) @ np.linalg.inv(jacobian)


def _sandwich(covariance: Any, scores: Any, groups: np.ndarray[Any, Any], level: float) -> float:
    """Return half the interval of the slope when only the groups are independent."""
    from scipy import special

    code, names = pd.factorize(groups)
    summed = np.zeros((len(names), scores.shape[1]))
    np.add.at(summed, code, scores)
    many = len(names)
    variance = (covariance @ (summed.T @ summed) @ covariance)[1, 1] * many / (many - 1)
    return float(special.stdtrit(many - 1, 0.5 + level / 2)) * math.sqrt(variance)
