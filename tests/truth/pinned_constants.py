"""Constants of the verdict, each doubled and halved: whether the tests that are named for it notice.

A constant that decides is pinned: with twice and with half of it, a named test fails. The others say how far a
computation goes: with twice and with half of each the named tests pass, as the same number comes out.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from typing import Any

import cpbench

PACKAGE = Path(next(iter(cpbench.__path__)))
FILES = {file.stem: file for room in ("verification", "proofs") for file in sorted((PACKAGE / room).glob("*.py"))}
TESTS = Path(__file__).resolve().parents[1]
CONSTANTS, MARGINS, JUDGE = "unit/test_verdict_constants.py::", "unit/test_margins.py::", "unit/test_judge.py::"
PROVED = "unit/test_certificates.py"
PINNED = {
    "certificates.TOLERANCE": f"{MARGINS}test_the_tolerance_is_1e6_where_none_is_given",
    "contacts.OWN": f"{CONSTANTS}test_a_contact_counts_by_a_tenth_of_its_own_free_velocity",
    "contacts.SMALL": f"{CONSTANTS}test_a_contact_counts_by_its_own_free_velocity_from_1e4_of_the_largest",
    "linear.BALANCED": f"{CONSTANTS}test_an_idle_constant_counts_from_a_tenth",
    "rows.ALIKE": "tests/unit/test_alike_rows.py::test_rows_that_differ_by_more_are_not_alike",
    "rows.ILL_POSED": "tests/unit/test_alike_rows.py::test_two_digits_of_a_difference_must_be_known",
    "linear.OWN": f"{CONSTANTS}test_a_bound_counts_by_a_tenth_of_its_own_terms",
    "linear.SMALL": f"{CONSTANTS}test_a_bound_counts_by_its_own_terms_from_1e5_of_the_largest",
    "polyhedra.IDLE": f"{MARGINS}test_limits_that_nothing_asks_for_count_by_a_millionth",
    "polyhedra.REACH": f"{MARGINS}test_solutions_up_to_ten_times_what_is_asked_are_excluded",
    "polyhedra.ROUNDING": "tests/unit/test_certificates.py::test_a_changed_proof_holds_no_more",
    "rows.FAR_BELOW": f"{CONSTANTS}test_a_part_moves_from_2_to_the_minus_40_of_the_fastest",
    "rows.ROUNDINGS": f"{CONSTANTS}test_eight_roundings_of_the_terms_decide_whether_velocities_are_known",
    "sets.INFINITE": f"{CONSTANTS}test_bounds_from_1e19_on_are_none",
    "sets.NEAR": f"{CONSTANTS}test_an_unknown_is_at_its_bound_within_half_of_it",
    "status.INACCURATE_FACTOR": f"{CONSTANTS}test_a_claim_is_wrong_beyond_a_hundred_tolerances",
    "verdict.DIRECTION_DEGREES": f"{CONSTANTS}test_a_direction_off_by_5_degrees_is_flagged",
}
"""Constants that decide, and the test of each."""
EFFORT = {
    "certificates.SECONDS": PROVED,
    "rows.BESIDE": "tests/unit/test_alike_rows.py::test_rows_that_differ_by_more_are_not_alike",
    "equilibration.ENOUGH": f"{JUDGE}test_equilibrated_rows_and_columns_have_the_mean_one",
    "equilibration.GUESSED": f"{JUDGE}test_equilibrated_rows_and_columns_have_the_mean_one",
    "equilibration.LARGEST": f"{JUDGE}test_equilibrated_rows_and_columns_have_the_mean_one",
    "equilibration.STEPS": f"{JUDGE}test_equilibrated_rows_and_columns_have_the_mean_one",
    "equilibration.SWEEPS": f"{JUDGE}test_equilibrated_rows_and_columns_have_the_mean_one",
    "certificates.LARGEST": PROVED,
    "certificates.NEARLY": PROVED,
    "hints.CURVED": PROVED,
    "hints.LARGEST": PROVED,
    "hints.STEPS": PROVED,
    "stacked.ENTRIES": "unit/test_solve_many.py",
}
"""Constants of how a number is computed or a proof looked for."""
GIVEN = ("hints.ACCURACY",)
"""What others set: tolerances of HiGHS."""


class Changed(SourceFileLoader):
    """Loads a module with other source, past its compiled file."""

    source = ""

    def get_code(self, fullname: str) -> Any:
        return compile(self.source, self.path, "exec")


def constants() -> Iterator[tuple[str, ast.expr]]:
    """Yield the name (module.NAME) and the value of every numeric constant of the verdict's and the proofs' modules."""
    for file in FILES.values():
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and _numbers(node.value):
                yield f"{file.stem}.{node.targets[0].id}", node.value


def _numbers(value: ast.expr) -> list[ast.Constant]:
    """Return the numbers of a constant; none of what is no number, or 0."""
    if isinstance(value, ast.Constant | ast.Tuple | ast.BinOp | ast.UnaryOp):
        return [n for n in ast.walk(value) if isinstance(n, ast.Constant) and type(n.value) in (int, float)]
    return []


def changed(name: str, factor: float) -> str:
    """Return the source of the constant's module with the constant times a factor."""
    source = FILES[name.partition(".")[0]].read_text()
    value = dict(constants())[name]
    text = str(ast.get_source_segment(source, value))
    whole = isinstance(ast.literal_eval(text) if "*" not in text else eval(text), int)
    if isinstance(value, ast.Tuple):
        other = f"tuple({factor} * x for x in {text})"
    else:
        other = f"int({factor} * ({text}))" if whole else f"{factor} * ({text})"
    own = f"\n{name.partition('.')[2]} = "
    return source.replace(f"{own}{text}\n", f"{own}{other}\n", 1)


def install(name: str, factor: float) -> None:
    """Let the module of a constant be loaded with the constant times a factor, in this process."""
    file = FILES[name.partition(".")[0]]
    module = f"cpbench.{file.parent.name}.{file.stem}"
    source = changed(name, factor)

    class Finder(PathFinder):
        @classmethod
        def find_spec(cls, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
            spec = PathFinder.find_spec(fullname, path, target) if fullname == module else None
            if spec is not None and spec.origin is not None:
                spec.loader = Changed(fullname, spec.origin)
                spec.loader.source = source
            return spec

    for loaded in [key for key in sys.modules if key.startswith("cpbench")]:
        del sys.modules[loaded]
    sys.meta_path.insert(0, Finder)


def passes(name: str, factor: float) -> bool:
    """Run the tests that are named for a constant with the constant times a factor; return whether all pass."""
    program = (
        "import sys, pinned_constants, pytest; "
        f"pinned_constants.install({name!r}, {factor}); "
        f"sys.exit(pytest.main(['-q', '-x', '-p', 'no:cacheprovider', {str(TESTS / (PINNED | EFFORT)[name])!r}]))"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"{name}: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.returncode == 0
