"""The licence of GAMS: what it says of itself, and how many rows it allows."""

from __future__ import annotations

import os
import subprocess
import tempfile
from functools import cache
from pathlib import Path

LICENSING = 7
"""Return code of GAMS for a licence that it refuses."""
DEMO_ROWS = 1000
"""Most rows and columns of a nonlinear or complementarity model under the demo licence."""
ADVICE = "pip install --upgrade gamspy gamspy_base for a newer demo licence, or: gamspy install license CODE"
PUBLISHING = (
    "GAMS' licence: benchmarks may be published with the methodology documented, unless COPT, CPLEX, Gurobi, Knitro, "
    "LINDO or Xpress take part, which needs written consent"
)


def refusal() -> tuple[int, str]:
    """Return GAMS' return code and complaints when it is started on an empty file (20 ms); (0, '') when all is well."""
    with tempfile.TemporaryDirectory(prefix="gams-") as folder:
        empty = Path(folder) / "empty.gms"
        empty.touch()
        command = [str(system_directory() / "gams"), str(empty), f"license={licence_file()}", "logOption=3"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace", timeout=60)
    if done.returncode == 0:
        return 0, ""
    complaints = [line.removeprefix("***").strip() for line in done.stdout.splitlines() if line.startswith("***")]
    return done.returncode, "; ".join(complaints[:2]) or f"GAMS ended with return code {done.returncode}"


def system_directory() -> Path:
    """Return where gamspy takes GAMS from."""
    import gamspy

    return Path(gamspy.get_option("GAMS_SYSDIR"))


def licence_file() -> Path:
    """Return the licence that gamspy uses: GAMSPY_LICENSE_PATH, an installed one, the demo licence in the package."""
    from gamspy.utils import _get_license_path

    return Path(_get_license_path(os.fspath(system_directory())))


@cache
def most_rows() -> int | None:
    """Return rows and columns that the licence allows, None for a licence without that limit."""
    try:
        text = licence_file().read_text(errors="replace")
    except (ImportError, OSError):
        return DEMO_ROWS  # the caller cannot solve anyway; without gamspy the demo licence is what comes with it
    return DEMO_ROWS if "GAMS_Demo" in text else None
