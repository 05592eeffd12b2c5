"""Each bad plugin is caught by the check that is meant to catch it."""

from __future__ import annotations

import dataclasses
import importlib.util
import sys
from pathlib import Path

import pytest

from cpbench.formulations import LCP
from cpbench.storage import formats
from cpbench.testing import Case, cases, checks

pytest.importorskip("cpbench_solvers", reason="needs cpbench_solvers")
_path = Path(__file__).resolve().parents[1] / "broken" / "plugins.py"
_spec = importlib.util.spec_from_file_location("broken_plugins", _path)
assert _spec is not None
assert _spec.loader is not None
broken = importlib.util.module_from_spec(_spec)
sys.modules[_spec.name] = broken
_spec.loader.exec_module(broken)

CAUGHT = [
    ("conversion", "SignFlippedLift", "check_lift_undoes_push"),
    ("conversion", "EditsItsInput", "check_the_input_stays"),
    ("conversion", "IgnoresItsObstacle", "check_obstacles_are_kept"),
    ("conversion", "PromisesTooMuch", "check_promises_agree"),
    ("conversion", "ForgetsItsTrace", "check_lift_works_in_another_process"),
    ("conversion", "RefusesOnTheWay", "check_obstacles_are_kept"),
    ("conversion", "LooksAtTheStorage", "check_sparse_as_dense"),
    ("solver", "ClaimsZeros", "check_claims_are_true"),
    ("solver", "ClaimsZeros", "check_one_iteration_claims_nothing_false"),
    ("solver", "ClaimsZeros", "check_infeasibility_is_proved_or_not_claimed_solved"),
    ("solver", "ClaimsNaN", "check_claims_are_true"),
    ("solver", "WrongShape", "check_answers_have_their_shape"),
    ("solver", "SwallowsErrors", "check_some_case_is_solved"),
    ("solver", "RollsDice", "check_the_same_twice"),
    ("solver", "IgnoresItsStart", "check_warm_starts_are_taken"),
    ("solver", "CountsItsStartOnly", "check_warm_starts_are_taken"),
    ("solver", "CountsNothing", "check_warm_starts_are_taken"),
    ("solver", "SpoilsItsOwnAnswer", "check_warm_starts_are_taken"),
    ("solver", "RecordsItsOwnUnits", "check_histories_end_in_the_answer"),
    ("solver", "RecordsNothing", "check_histories_end_in_the_answer"),
    ("solver", "TriesHarderWhenWatched", "check_watching_changes_nothing"),
    ("solver", "TakesNoDefaults", "check_options_are_known_by_name"),
    ("solver", "EditsTheProblem", "check_the_problem_stays"),
    ("solver", "NeedsItsPackageToBeRead", "check_the_spec_is_read_without_the_package"),
    ("solver", "AsksForLess", "check_tolerances_are_no_looser"),
    ("solver", "IgnoresTheUnit", "check_claims_hold_in_other_units"),
    ("solver", "ExcusesWhatItCan", "check_known_failures_still_fail"),
    ("format", "LosesAField", "check_round_trip_is_exact"),
    ("format", "ForgetsWhoMadeIt", "check_annotations_are_kept"),
    ("format", "WritesNothing", "check_some_case_is_written"),
    ("format", "ReadsHalfAFile", "check_cut_files_are_refused"),
    ("formulation", "LooksAtTheFirst", "check_renumbering_changes_nothing"),
    ("formulation", "CanBeWritten", "check_data_are_read_only"),
    ("formulation", "HashesTheStorage", "check_fingerprint_is_of_the_content"),
    ("formulation", "IgnoresNaN", "check_nan_is_not_solved"),
    ("formulation", "AlwaysRight", "check_wrong_points_have_a_residual"),
]


def _cases(kind: str, plugin: type) -> list[Case]:
    """Copies: a plugin that edits its input must not spoil the cases of others."""
    if kind == "conversion":
        return [dataclasses.replace(c, problem=dataclasses.replace(c.problem)) for c in cases("mlcp")]
    node = plugin if kind == "formulation" else LCP
    made = [c for c in cases("lcp") if c.name != "trivial"]
    return [dataclasses.replace(c, problem=node(**c.problem.data(), name=c.name)) for c in made]


@pytest.mark.parametrize(("kind", "name", "check"), CAUGHT)
def test_caught_by_the_named_check(kind: str, name: str, check: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plugin = getattr(broken, name)
    subject = plugin if kind == "formulation" else plugin()
    if kind == "format":  # files are read and written by the name of their format
        formats.discover()
        monkeypatch.setitem(formats._items, plugin.name, subject)
    with pytest.raises(AssertionError):
        checks(kind)[check](subject, _cases(kind, plugin))


def test_every_broken_plugin_is_caught() -> None:
    wrong = {n for n, v in vars(broken).items() if isinstance(v, type) and v.__module__ == "broken_plugins"}
    assert {n for n in wrong if not n.startswith("_")} == {name for _, name, _ in CAUGHT}
