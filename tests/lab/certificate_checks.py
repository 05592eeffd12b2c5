"""What tests of certificates share: the program that proves them again, and files that a forger seals again."""

from __future__ import annotations

import importlib
import importlib.util
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cpbench_lab
from cpbench.formulations.base import Problem
from cpbench_lab.certificates.certificate import Certificate
from cpbench_lab.certifying import save_certificate

CHECKER = Path(cpbench_lab.__file__).parent / "certificates" / "checker"
REFUSALS = (ValueError, KeyError, IndexError, ZeroDivisionError, TypeError, np.linalg.LinAlgError)
"""What the program raises on a file that is forged."""
SEEDS = pytest.mark.parametrize(
    "seed", [*range(6), *(pytest.param(k, marks=pytest.mark.nightly) for k in range(6, 60))]
)


def part(name: str) -> Any:
    """Return a module of the program, imported from its folder as the program does."""
    if str(CHECKER) not in sys.path:
        sys.path.append(str(CHECKER))
    return importlib.import_module(name)


@cache
def _program() -> Any:
    part("certificate_file")
    spec = importlib.util.spec_from_file_location("checking_program", CHECKER / "__main__.py")
    assert spec is not None
    assert spec.loader is not None
    program = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(program)
    return program


def check(path: Path) -> str:
    """Prove a file again in this process, and return what is proved."""
    return _program().check(str(path))


def checked(*paths: Path) -> tuple[int, str]:
    """Prove files again by the program itself: its exit code, and what it says."""
    done = subprocess.run([sys.executable, CHECKER, *paths], capture_output=True, text=True, timeout=120)
    assert not done.stderr
    return done.returncode, done.stdout


def save_and_check(certificate: Certificate, problem: Problem, folder: Path) -> str:
    """Write a certificate and prove it again."""
    save_certificate(certificate, problem, folder / "c.h5")
    return check(folder / "c.h5")


def reseal(own: Any) -> None:
    """Seal the group of a certificate again, as a forger does who knows how."""
    del own.attrs["seal"]
    own.attrs["seal"] = part("certificate_file").seal(own)
