"""How time grows with size: log t = a + b log x, where a timeout says "longer than the limit", not "no answer".

With y = log t, z = log x and normal errors of deviation σ, a solved problem has the density of its time and one that
was stopped at the limit c the probability of being above it (Tobin, Econometrica 26, 1958; Lawless, Statistical
Models and Methods for Lifetime Data, 2nd ed. 2003, §6.4, the lognormal regression for right-censored times):

    ℓ(a, b, σ) = Σ_solved [log φ((y − a − b z) / σ) − log σ] + Σ_stopped log Φ(−(log c − a − b z) / σ)

In θ = 1/σ, α = a/σ, β = b/σ this is concave (Olsen, Econometrica 46, 1978), so that its only maximum is found:

    ℓ = Σ_solved [log θ − (θ y − α − β z)² / 2] + Σ_stopped log Φ(−(θ log c − α − β z)) + constant

The standard error of b is the observed information's, times √(m / (m − 2)) for m solved problems; the interval takes
the t quantile of m − 2 degrees of freedom. Without a timeout both are exactly those of least squares
(`scipy.stats.linregress`). They take the problems as independent. Those of one family are not: `family_low` and
`family_high` take only the families as independent (sandwich of the scores summed by family, Liang and Zeger,
Biometrika 73, 1986; t of G − 1 degrees for G families) and are NaN for fewer than `FAMILIES`. Neither sees a law
that is no power: mind `least` and `largest`, the range of x.

Other failures say nothing of the time that an answer would have taken: they are left out and counted (`excluded`).
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from scipy import optimize, special, stats

from cpbench.analysis import table as rows_of
from cpbench.analysis.summary import size_ranges
from cpbench.verification import Status

SPAN, POINTS, FAMILIES = 4.0, 5, 8
"""Least ratio of sizes and least number of solved problems for a slope, least number of families for their interval."""
COLUMNS = (
    "label", "slope", "low", "high", "error", "family_low", "family_high", "intercept", "scatter", "solved", "stopped",
    "excluded", "unsized", "families", "least", "largest", "reason",
)  # fmt: skip
_OF_A_LINE = ("slope", "low", "high", "error", "intercept", "scatter")

Floats: TypeAlias = np.ndarray[tuple[int], np.dtype[np.float64]]
Bools: TypeAlias = np.ndarray[tuple[int], np.dtype[np.bool_]]


@dataclass(frozen=True)
class Line:
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


def scaling(
    group: pd.DataFrame, symbol: str, features: pd.DataFrame | None = None, level: float = 0.95
) -> pd.DataFrame:
    """One row a label of a group, in order of label: how its time grows with a size of the problems.

    Columns: slope b with its interval (low, high), standard error, interval over families; intercept (log seconds at
    x = 1), scatter (σ of log t), solved and stopped (the problems fitted), excluded (other failures, and times or
    limits that are not known), unsized (without a positive x), families fitted, least and largest x fitted. Where
    sizes differ by less than a factor `SPAN`, or fewer than `POINTS` were solved, the numbers are NaN and `reason`
    says why.

    Parameters
    ----------
    symbol : a dimension (n, nc, m, ...) or a column of `features`.
    features : facts of the problems by fingerprint, as nnz; a symbol is looked up there first.

    >>> rows = pd.DataFrame({"fingerprint": list("abcdef"), "label": "s", "family": "", "seconds": 9.0,
    ...                      "sizes": [f'{{"n": {2**k}}}' for k in range(6)], "convert": 0.0, "setup": 0.0,
    ...                      "lift": 0.0, "solve": [1.0, 2.1, 3.8, 8.3, math.nan, math.nan],
    ...                      "status": ["solved"] * 4 + ["timeout"] * 2})
    >>> scaling(rows, "n")["reason"].tolist()
    ['4 solved problems, at least 5 are needed']
    >>> longer = pd.concat([rows, rows.assign(fingerprint=list("uvwxyz"))])
    >>> round(scaling(longer, "n")["slope"].item(), 2)
    1.0
    """
    x, seconds, stopped, known, sized = _measured(group, symbol, features)
    label, labels = pd.factorize(group["label"], sort=True)
    family, _ = pd.factorize(group["family"].where(group["family"] != "", group["fingerprint"]))
    records: list[dict[str, Any]] = []
    order = np.argsort(label, kind="stable")
    for name, places in zip(labels, np.split(order, np.cumsum(np.bincount(label))[:-1]), strict=True):
        at = places[(known & sized)[places]]
        record: dict[str, Any] = {
            "label": str(name),
            "solved": int((~stopped[at]).sum()),
            "stopped": int(stopped[at].sum()),
            "excluded": int((~known[places]).sum()),
            "unsized": int((known & ~sized)[places].sum()),
            "families": len(np.unique(family[at])),
            "least": float(x[at].min()) if len(at) else math.nan,
            "largest": float(x[at].max()) if len(at) else math.nan,
        }
        record["reason"] = _refusal(record, x[at][~stopped[at]], symbol)
        if not record["reason"]:
            try:
                line = fit(np.log(x[at]), np.log(seconds[at]), stopped[at], family[at], level)
            except ValueError as cause:
                record["reason"] = str(cause)
            else:
                record |= {name: getattr(line, name) for name in _OF_A_LINE}
                record |= {"family_low": line.group_low, "family_high": line.group_high}
        records.append(record)
    return pd.DataFrame(records, columns=list(COLUMNS))


def line(record: pd.Series[Any]) -> tuple[Floats, Floats]:
    """Both ends (size, seconds) of the line of a row of `scaling` that has one.

    >>> ends = line(pd.Series({"intercept": math.log(2.0), "slope": 1.0, "least": 1.0, "largest": 8.0}))
    >>> ends[0].tolist(), ends[1].round(9).tolist()
    ([1.0, 8.0], [2.0, 16.0])
    """
    sizes = np.array([record["least"], record["largest"]], dtype=float)
    return sizes, np.exp(float(record["intercept"]) + float(record["slope"]) * np.log(sizes))


def widest(group: pd.DataFrame) -> str:
    """The dimension whose largest value is the most times its least one; the first by name among equals; '' of none.

    >>> widest(pd.DataFrame({"sizes": ['{"m": 3, "n": 1}', '{"m": 6, "n": 9}']}))
    'n'
    """
    ratios = {s: b / a for s, (a, b) in size_ranges(group).items() if a > 0}
    return max(sorted(ratios), key=ratios.__getitem__, default="")


def dimensions(group: pd.DataFrame) -> list[str]:
    """The dimensions that some problem of the group has."""
    return list(size_ranges(group))


def points(group: pd.DataFrame, symbol: str) -> pd.DataFrame:
    """What `scaling` fits, one row a pair: label, x, seconds, and whether that is a limit at which it was `stopped`."""
    x, seconds, stopped, known, sized = _measured(group, symbol, None)
    found = pd.DataFrame({"label": group["label"].to_numpy(), "x": x, "seconds": seconds, "stopped": stopped})
    return found[known & sized].reset_index(drop=True)


def _measured(
    group: pd.DataFrame, symbol: str, features: pd.DataFrame | None
) -> tuple[Floats, Floats, Bools, Bools, Bools]:
    """Of each row: size, seconds to the answer or (`stopped`) the limit, whether these and the size are known."""
    x = sizes_of(group, symbol, features)
    timed = rows_of.with_time(group)
    stopped = (group["status"] == str(Status.TIMEOUT)).to_numpy(dtype=bool)
    seconds = np.where(stopped, group["seconds"].to_numpy(dtype=float), timed["time"].to_numpy(dtype=float))
    return x, seconds, stopped, np.isfinite(seconds) & (seconds > 0), np.isfinite(x) & (x > 0)


def sizes_of(group: pd.DataFrame, symbol: str, features: pd.DataFrame | None = None) -> Floats:
    """A size of each row's problem, NaN where it has none of that name.

    >>> sizes_of(pd.DataFrame({"sizes": ['{"n": 3}', "", '{"m": 1}']}), "n").tolist()
    [3.0, nan, nan]
    """
    if features is not None and symbol in features.columns:
        return group["fingerprint"].map(features[symbol]).to_numpy(dtype=float)
    codes, texts = pd.factorize(group["sizes"])
    values = [float((json.loads(text) if text else {}).get(symbol, math.nan)) for text in texts]
    return np.array([*values, math.nan])[codes]


def fit(z: Floats, y: Floats, censored: Bools, groups: np.ndarray[Any, Any] | None = None, level: float = 0.95) -> Line:
    """The line of greatest likelihood through (z, y), y being a lower bound where `censored`.

    Raises ValueError when fewer than three values are known, when those have one z only, and when they lie on a line
    exactly while others are censored (the likelihood then has no maximum).

    >>> z = np.array([0.0, 1.0, 2.0, 3.0])
    >>> round(fit(z, np.array([0.1, 0.9, 2.1, 2.9]), np.zeros(4, dtype=bool)).slope, 12)
    0.96
    """
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
    reach = float(stats.t.ppf(0.5 + level / 2, observed - 2)) * error
    group_reach = math.nan
    if groups is not None and len(np.unique(groups)) >= FAMILIES:
        group_reach = _sandwich(covariance, scores, groups, level) / unit
    return Line(
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
    """Maximum in (α, β, θ), from there (a, b), σ, the covariance of (a, b, σ) and every value's score by them."""
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
        """Gradient of log-likelihood by (α, β, θ), a row a value."""
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

    found = optimize.minimize(
        loss,
        np.array([*(start / sigma), 1 / sigma]),
        jac=lambda p: -gradients(p).sum(axis=0),
        hess=curvature,
        method="trust-exact",
        options={"gtol": 1e-8 * len(y), "initial_trust_radius": 1.0, "max_trust_radius": 1e6},
    )
    p = found.x
    # d(a, b, σ) / d(α, β, θ), by which covariances go there and scores come back
    theta = p[2]
    jacobian = np.array([[1 / theta, 0, -p[0] / theta**2], [0, 1 / theta, -p[1] / theta**2], [0, 0, -1 / theta**2]])
    covariance = jacobian @ np.linalg.inv(curvature(p)) @ jacobian.T
    return p[:2] / theta, 1 / theta, covariance, gradients(p) @ np.linalg.inv(jacobian)


def _sandwich(covariance: Any, scores: Any, groups: np.ndarray[Any, Any], level: float) -> float:
    """Half the interval of the slope when only the groups are independent."""
    code, names = pd.factorize(groups)
    summed = np.zeros((len(names), scores.shape[1]))
    np.add.at(summed, code, scores)
    many = len(names)
    variance = (covariance @ (summed.T @ summed) @ covariance)[1, 1] * many / (many - 1)
    return float(stats.t.ppf(0.5 + level / 2, many - 1)) * math.sqrt(variance)


def _refusal(record: dict[str, Any], solved: Floats, symbol: str) -> str:
    """Why there is no slope; '' when there is one."""
    if record["solved"] < POINTS:
        return f"{record['solved']} solved problems, at least {POINTS} are needed"
    if record["largest"] < SPAN * record["least"]:
        return f"{symbol} from {record['least']:g} to {record['largest']:g}, a factor of {SPAN:g} is needed"
    if np.ptp(solved) == 0:
        return f"all solved problems have {symbol} = {solved[0]:g}"
    return ""
