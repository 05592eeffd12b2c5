"""Known minima of Hock and Schittkowski's programs, and their multipliers.

The book prints z* and f* to some ten digits, without multipliers. These are the Karush–Kuhn–Tucker points of the active
constraints found there by Newton's method in 60 digits (mpmath), rounded once; where the minimum is a round point, it
is that point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple


class Known(NamedTuple):
    """f*, z*, multipliers of g ≥ 0, of h = 0 and of the bounds; () where all are 0."""

    objective: float
    z: Sequence[float]
    lam: Sequence[float] = ()
    mu: Sequence[float] = ()
    nu: Sequence[float] = ()


POINTS: Mapping[int, Known] = {
    1: Known(0.0, (1.0, 1.0)),
    3: Known(0.0, (0.0, 0.0), (), (), (0.0, 1.0)),
    5: Known(-1.9132229549810364, (-0.5471975511965977, -1.5471975511965979)),
    6: Known(0.0, (1.0, 1.0)),
    7: Known(-1.7320508075688772, (0.0, 1.7320508075688772), (), (-0.28867513459481287,)),
    21: Known(-99.96, (2.0, 0.0), (), (), (0.04, 0.0)),
    24: Known(-1.0000000000000002, (3.0, 1.7320508075688774), (0.8660254037844388, 0.0, 0.5000000000000001)),
    26: Known(0.0, (1.0, 1.0, 1.0)),
    28: Known(0.0, (0.5, -0.5, 0.5)),
    35: Known(0.1111111111111111, (1.3333333333333333, 0.7777777777777778, 0.4444444444444444), (0.2222222222222222,)),
    39: Known(-1.0, (1.0, 1.0, 0.0, 0.0), (), (1.0, 1.0)),
    43: Known(-44.0, (0.0, 1.0, 2.0, -1.0), (1.0, 0.0, 2.0)),
    49: Known(0.0, (1.0, 1.0, 1.0, 1.0, 1.0)),
    71: Known(
        17.014017289156303,
        (1.0, 4.742999637264417, 3.8211499841848737, 1.3794082931726723),
        (0.5522936601207268,),
        (-0.16146856677050583,),
        (1.087871228666941, 0.0, 0.0, 0.0),
    ),
    76: Known(
        -4.681818181818182,
        (0.2727272727272727, 2.090909090909091, 0.0, 0.5454545454545454),
        (0.45454545454545453, 0.0, 0.0),
        (),
        (0.0, 0.0, 1.7272727272727273, 0.0),
    ),
}
