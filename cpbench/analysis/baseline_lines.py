"""Fields of a line of a baseline, and the check of one that was written by hand."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from cpbench.analysis.table import STATUSES
from cpbench.errors import FormatError
from cpbench.verification import Status

PLACE = ("node", "problem")
KEY = ("fingerprint", "solver", "route", "tolerance", "start", "threads", "measure", "sequence")
OUTCOME = ("status", "error", "counters")
COLUMNS = (*PLACE, *KEY, *OUTCOME, "known")
UNMEASURED = (str(Status.UNAVAILABLE), str(Status.NOT_RUN))
_KEPT = [status for status in STATUSES if status not in UNMEASURED]
_ERROR = re.compile(r"|inf|(<=)?\d+(\.\d+)?e[-+]\d+")


def check(cells: Sequence[str], place: str, number: int) -> None:
    """Raise FormatError where the cells of this line of the file `place` are none of a baseline."""

    def wrong(cause: str) -> FormatError:
        return FormatError(place, f"line {number}", cause)

    first = cells[0]
    if re.match(r"<{7}|={7}|>{7}|\|{7}", first):
        raise wrong("is a mark of a merge conflict; take one side, or write the file again from results")
    if first.startswith("#"):
        raise wrong("is a comment, which --update would lose; the column known is for reasons")
    if len(cells) != len(COLUMNS):
        raise wrong(f"has {len(cells)} cells, expected {len(COLUMNS)}; a reason with a comma needs quotes")
    line = dict(zip(COLUMNS, cells, strict=True))
    if not line["fingerprint"] or not line["solver"]:
        raise wrong("has no fingerprint or no solver")
    if line["status"] not in STATUSES or line["status"] in UNMEASURED:
        raise wrong(f"has status {line['status'][:40]!r}, expected one of {', '.join(_KEPT)}")
    if line["tolerance"] and not _positive(line["tolerance"]):
        raise wrong(f"has tolerance {line['tolerance'][:40]!r}, expected a positive number")
    if not line["threads"].isdecimal():
        raise wrong(f"has threads {line['threads'][:40]!r}, expected a whole number")
    if not _ERROR.fullmatch(line["error"]):
        raise wrong(f"has error {line['error'][:40]!r}, expected 1e-03, <=1e-06 or inf")
    if line["sequence"] and not re.fullmatch(r".*#\d+", line["sequence"]):
        raise wrong(f"has sequence {line['sequence'][:40]!r}, expected NAME#STEP")
    for item in line["counters"].split():
        if not re.fullmatch(r"[^=]+=-?\d+", item):
            raise wrong(f"has counter {item[:40]!r}, expected name=number")


def _positive(written: str) -> bool:
    try:
        return 0 < float(written) < math.inf
    except ValueError:
        return False
