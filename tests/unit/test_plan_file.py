"""Plan files: what they may say, what wins, and how a mistake is told."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import pytest

from cpbench.bench.planning import plan_file, run_plan
from cpbench.bench.planning.plan import Limits
from cpbench.bench.planning.run_plan import SETTINGS, ProblemSet, RunPlan
from cpbench.cli.run_command import SECTIONS, command

NIGHT = """
output = "night.sqlite"
report = false
jobs = 2
timeout = "1m"                 # of every set
fail_on = ["wrong", "crash"]

[[set]]
name = "contacts"
problems = ["scenes/*.hdf5", "builtin"]
solvers = ["nsgs[omega=0.8:1.4:0.2]", "newton-*"]
tolerance = [1e-4, 1e-8]
where = "nc > 100"
start = "file:2"

[[set]]
name = "small"
problems = "lcp.h5"
timeout = 0.5
memory = "1G"
tolerance = 1e-6
history = true
"""


def write(folder: Path, text: str, name: str = "cpbench.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def made(path: Path, **given: object) -> RunPlan:
    file = plan_file.read(path)
    return run_plan.make({k: SETTINGS[k].read(v) for k, v in given.items()}, file.top, file.sets)


@pytest.mark.needs("cpbench_solvers")
def test_a_file_makes_a_plan(tmp_path) -> None:
    plan = made(write(tmp_path, NIGHT))
    contacts, small = plan.sets
    assert plan == RunPlan(
        sets=(contacts, small), output=str(tmp_path / "night.sqlite"), report=None, jobs=2, fail_on=("wrong", "crash")
    )
    assert contacts == ProblemSet(
        name="contacts",
        problems=(str(tmp_path / "scenes/*.hdf5"), "builtin"),
        solvers=("nsgs[omega=0.8:1.4:0.2]", "newton-*"),
        tolerance=(1e-4, 1e-8),
        timeout=60.0,
        where="nc > 100",
        start=("file:2",),
    )
    assert (small.timeout, small.memory, small.tolerance) == (0.5, 2**30, (1e-6,))
    assert small.limits(2) == Limits(0.5, 2**30, 2, 3, True)


@pytest.mark.needs("cpbench_solvers")
def test_the_command_line_wins_over_a_set_and_a_set_over_the_top(tmp_path) -> None:
    path = write(tmp_path, NIGHT)
    plan = made(path, timeout="3h", jobs=1, tolerance=(1e-3,), output="here.sqlite")
    assert [part.timeout for part in plan.sets] == [10800.0, 10800.0]
    assert [part.tolerance for part in plan.sets] == [(1e-3,), (1e-3,)]
    assert (plan.jobs, plan.output) == (1, "here.sqlite")
    assert [part.timeout for part in made(path).sets] == [60.0, 0.5]


def test_a_file_without_sets_is_one_set(tmp_path) -> None:
    plan = made(write(tmp_path, 'problems = "a.h5"\nseed = 3\n'))
    assert plan == RunPlan(sets=(ProblemSet(problems=(str(tmp_path / "a.h5"),)),), seed=3)


def test_results_have_the_name_of_a_plan_that_is_not_the_folders(tmp_path) -> None:
    assert made(write(tmp_path, "jobs = 3\n")).output == ""
    assert made(write(tmp_path, "", "night.toml")).output == "night.sqlite", "beside the caller"


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("tolerances = 1e-6", "cpbench.toml: tolerances = 1e-06: unknown key, did you mean tolerance?"),
        ("fail-on = 3", "fail-on = 3: unknown key, did you mean fail_on?"),
        ("zzz = 3", "zzz = 3: unknown key, known: cluster, "),
        ("sets = []", "sets = []: unknown key, did you mean set?"),
        ("shard = '1/4'", "shard = '1/4': unknown key"),
        ('[[set]]\nname = "a"\noutput = "x"', "[[set]] 1 'a': output = 'x': unknown key"),
        ("[set]\nname = 'a'", "write [[set]] above each"),
        ("[[set]]\n[[set]]", "[[set]] 1: has no name"),
        ("[[set]]\nname='a'\n[[set]]\nname='a'", "[[set]] 2: name = 'a': is the name of [[set]] 1 too"),
        ("[[set]]\ntimeout = true", "[[set]] 1: timeout = True: expected a text, found a truth value"),
        ("timeout = '10 parsecs'", "timeout = '10 parsecs': '10 parsecs' is no duration; write 500ms"),
        ("timeout = -1", "timeout = -1: '-1.000000' is no duration"),
        ("memory = '4X'", "'4X' is no size"),
        ("tolerance = 'small'", "expected a number or a list of numbers, found a text"),
        ("tolerance = [1e-6, 0]", "the tolerance 0 is not positive"),
        ("tolerance = [nan]", "the tolerance nan is not positive"),
        ("tolerance = []", "expected a number or a list"),
        ("problems = []", "problems = []: is empty"),
        ("problems = [1]", "expected a text or a list of texts, found a list"),
        ("solvers = ['lemka']", "solvers = ['lemka']: unknown solver 'lemka': did you mean lemke"),
        ("solvers = 'nsgs[omga=1]'", "did you mean omega?"),
        ("via = 'inne'", "inner"),
        ("via = 'compliant[complianc=1]'", "did you mean compliance?"),
        ("via = 'compliant[compliance=1'", "the bracket is not closed"),
        ("facets = [8, 9]", "9 facets: the number must be even"),
        ("routes = 'al'", "unknown choice 'al'"),
        ("where = 'nc >> 3'", "at 'nc >> 3': cannot be read"),
        ("where = 'zzz > 3'", "unknown fact 'zzz': known: "),
        ("start = 'warm'", "unknown start 'warm'"),
        ("format = 'siconos-fc4d'", "siconos-fc3d"),
        ("repeats = 0", "must be at least 1"),
        ("jobs = 1.5", "expected a whole number, found a number"),
        ("jobs = true", "expected a whole number, found a truth value"),
        ("history = 1", "expected true or false, found a number"),
        ("fail_on = ['wrongly']", "unknown status 'wrongly': did you mean wrong?"),
        ("keep = 'some'", "unknown choice 'some'"),
        ("output = {}", "expected a text, found a table"),
        ("report = true", "expected a text, found a truth value"),
        ("jobs = ?", "is not valid TOML: Invalid value (at line 1, column 8)"),
        ("x = " + "[" * 5000, "is not valid TOML"),
    ],
)
def test_a_mistake_is_one_line_with_file_table_key_and_value(tmp_path, text: str, told: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(plan_file.PlanError) as refusal:
        made(path)
    message = str(refusal.value)
    assert message.startswith(f"{path}: ")
    assert told in message
    assert "\n" not in message


def test_bytes_that_are_no_text_and_files_that_are_not_there(tmp_path) -> None:
    (tmp_path / "cpbench.toml").write_bytes(b"\xff\xfe")
    for path, told in ((tmp_path / "cpbench.toml", "is not valid TOML"), (tmp_path / "none.toml", "No such file")):
        with pytest.raises(plan_file.PlanError, match=told):
            plan_file.read(path)


def test_most_settings_are_options_each_in_a_section() -> None:
    options = {p.name for p in command.params}
    assert SETTINGS.keys() - options == {"name", "facets", "format", "measure", "repeat_below", "report", "threads"}
    shown = {name for names in SECTIONS.values() for name in names} | {"problems"}
    assert {p.name for p in command.params} <= shown, "every option has its section in the help"


def test_the_defaults_that_the_help_shows_are_those_of_the_plan() -> None:
    """As texts they are read again to the values of the plan."""
    shown = {key: setting for key, setting in SETTINGS.items() if setting.default_text()}
    assert {"timeout", "memory", "tolerance", "start", "keep", "seed"} <= shown.keys()
    for key, setting in shown.items():
        assert setting.from_texts(setting.default_text().split(",")) == setting.default, key


@pytest.mark.needs("cpbench_solvers")
def test_the_effective_plan_is_json_and_reads_as_it_was_written(tmp_path) -> None:
    plan = made(write(tmp_path, NIGHT), timeout="none")
    kept = json.loads(json.dumps(plan.effective({"contacts": ["aa", "bb"], "small": []}), allow_nan=False))
    first = kept["sets"][0]
    assert first["problems"] == [str(tmp_path / "scenes/*.hdf5"), "builtin"], "globs as they were given"
    assert first["found"] == ["aa", "bb"]
    assert first["timeout"] == "none"
    assert math.isinf(plan.sets[0].timeout)
    again = ProblemSet(**{k: SETTINGS[k].read(v) for k, v in first.items() if k != "found" and v not in (None, "")})
    assert dataclasses.replace(again, format=None) == plan.sets[0]
