"""What a plain installation brings, and that messages name the extra that brings the rest."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

from cpbench.solvers import solvers

ROOT = Path(__file__).resolve().parents[2]
TOML = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PROJECT = TOML["project"]
OTHER_NAMES = {
    "pin": "pinocchio",
    "drake": "pydrake",
    "sip-qp-python": "sip_qp_python",
    "highspy-extras": "highspy_extras",
}
"""Packages that are imported by another name than they are installed by."""
BLOCKED = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in GUESTS:
            raise ImportError(f"{name} is blocked")

sys.meta_path.insert(0, Blocked())
import numpy as np
from cpbench.conversions import make
from cpbench.formulations.expressions.recording import recorded
from cpbench.formulations import NCP

problem = NCP(F=recorded(2, lambda z: np.exp(z) - 2.0), start=[1.0, 1.0])
micp, _ = make("ncp-micp").apply(problem)
for name in ("min", "fb", "pfb", "ep", "normal"):
    equation, _ = make(f"micp-equation-{name}").apply(micp)
    equation.F.jacobian(equation.start)
print(equation.F(equation.start).size)
"""


def _packages(texts: list[str]) -> set[str]:
    """Names by which they are imported, of packages and of those in the extras among them."""
    found: set[str] = set()
    for text in texts:
        if text.startswith("cpbench["):
            for extra in text[len("cpbench[") : -1].split(","):
                found |= _packages(PROJECT["optional-dependencies"][extra])
        else:
            name = re.split(r"[<>=\[ ]", text)[0]
            found.add(OTHER_NAMES.get(name, name))
    return found


CORE = _packages(PROJECT["dependencies"])


def test_an_extra_that_a_message_names_brings_the_guest() -> None:
    named = [solver.spec for solver in solvers if "cpbench[" in solver.spec.install]
    assert len(named) > 15
    for spec in named:
        (extra,) = re.findall(r"cpbench\[(\w+)\]", spec.install)
        assert spec.requires[-1] in _packages([f"cpbench[{extra}]"]), spec.name  # the others it brings itself


def test_type_checkers_take_the_types_of_each_package() -> None:
    packages = TOML["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert "cpbench" in packages
    assert [name for name in packages if not (ROOT / name / "py.typed").is_file()] == []


def test_what_is_heavy_is_an_extra() -> None:
    everything = _packages(["cpbench[all]"])
    for name in ("casadi", "proxsuite"):
        assert name not in CORE
        assert name in everything


def test_extras_are_what_the_registered_solvers_require() -> None:
    """Both ways, so that no package is typed by hand that no solver names, and no solver is without its extra."""
    extras = _packages(["cpbench[solvers,hipo,commercial]"])
    required = {package for solver in solvers for package in solver.spec.requires}
    assert required <= CORE | extras
    assert extras <= required


def test_maps_are_made_converted_and_differentiated_without_casadi() -> None:
    code = f"GUESTS = {{'casadi'}}\n{BLOCKED}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "2\n"), done.stderr[-2000:]
