"""Error of an answer to a contact problem: by which velocities contacts miss the law, over those that the data give.

At every contact Signorini's and Coulomb's law are equations (Alart and Curnier 1991),

    min(r_N/ρ, u_N) = 0,    r_T/ρ − P(r_T/ρ − u_T) = 0,    P the projection on the ball of radius μ r_N/ρ,

ρ the effective mass of the contact, d/tr W_cc. What an answer leaves of them are velocities. They are compared with the
free velocities q of the connected part, and with nothing that the answer says: where a reaction obeys the law, friction
takes energy and normal reactions do no work but that of q, so that no true velocity is larger than q makes it in the
metric of W. What an answer adds, in reactions that cancel, buys nothing. Where the rounding of the terms of u is more
than the tolerance leaves of q, the answer is `unresolvable`.

A contact counts by a tenth of its own terms, too: by q or by what its reaction alone changes, r/ρ. Its free velocity
alone would say too much: that of a contact which bears others may be any small number.

The same is measured of every formulation: u as the answer has it, and as an error of u what the equations of motion and
of joints leave. So a scene has one verdict, whichever way it is written.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.foundation.matrices import Dense, Vector
from cpbench.verification.projections import row_norms
from cpbench.verification.rows import FAR_BELOW, AnswerError, Groups

OWN = 0.1
"""Share by which a contact is compared with its own terms: it misses the law by at most 10 ε of them."""
SMALL = 1e-4
"""Share of the largest free velocity of the part below which the terms of a contact say nothing."""


@dataclass(frozen=True, eq=False)
class ContactAnswer:
    """An answer at its contacts, in one unit of length: impulses over those of moments, velocities times them.

    Attributes
    ----------
    r, u : (nc, d) reactions and velocities. q : (nc, d) free velocities. rho : (nc,) effective masses.
    balls : components of friction, and of rolling friction, with the radius of each ball over r_N.
    noise : (nc, d) rounding of u. off : (nc, d) sizes of what is between u and what the reactions make it.
    part : the connected part of each contact.
    others : errors of joints and of bodies without contacts, over what the data give.
    """

    r: Dense
    u: Dense
    q: Dense
    rho: Vector
    balls: tuple[tuple[slice, Vector], ...]
    noise: Dense
    part: Groups
    off: Dense | float = 0.0
    others: Vector | None = None


def contact_error(at: ContactAnswer, problem: Groups | None = None) -> AnswerError:
    """Measure an answer, contact by contact; of several problems side by side, each by itself.

    problem : the problem that each contact belongs to, None where there is one.
    """
    problem = problem or Groups.one(at.rho.size)
    speed, radius = at.r / at.rho[:, None], np.maximum(at.r[:, 0], 0.0) / at.rho
    missed = [(np.abs(np.minimum(speed[:, 0], at.u[:, 0])), slice(0, 1))]
    missed += [(_slip(speed[:, some], at.u[:, some], mu * radius), some) for some, mu in at.balls]
    free = row_norms(at.q)
    size, most = at.part.spread(at.part.largest(free)), problem.spread(problem.largest(free))
    size = np.where(size > FAR_BELOW * most, size, most)  # a part at rest has 1e-16 for 0 where others move
    absolute = size == 0
    unit = 1.0 / np.where(absolute, 1.0, size)
    error = floor = np.zeros(at.rho.size)
    for miss, some in missed:
        noise = row_norms(at.noise[:, some])
        miss = miss + row_norms(at.off[:, some]) if isinstance(at.off, np.ndarray) else miss
        norm = np.maximum(row_norms(at.q[:, some]), row_norms(speed[:, some]))
        over, counts = np.maximum(miss - noise, 0.0), norm * unit > SMALL
        by_norm = OWN * np.divide(over, norm, out=np.zeros_like(norm), where=counts)
        error, floor = np.maximum(error, np.maximum(miss * unit, by_norm)), np.maximum(floor, noise * unit)
    if at.others is not None:
        error, floor = np.append(error, at.others), np.append(floor, np.zeros_like(at.others))
    return AnswerError(error, floor, bool(absolute.any()), strict=True)


def _slip(r: Dense, u: Dense, radius: Vector) -> Vector:
    """Return ‖r − P(r − u)‖ of every row, P the projection on the ball of its radius."""
    y = r - u
    size = row_norms(y)
    slides = size > radius  # within the ball it is u, which must not be lost beside r
    share = np.divide(radius, size, out=np.zeros_like(size), where=slides)
    return row_norms(np.where(slides[:, None], r - share[:, None] * y, u))
