"""No option is dropped in silence: given twice it is a list, with the commas alike, or an error."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import pytest
from tiers import some_by_day

from cpbench import storage
from cpbench.bench.results.store import Store
from cpbench.cli import cli, main
from cpbench.cli.options import Command, ListOption
from cpbench.formulations import LCP

VALUES = {"integer": "8", "integer range": "8", "float": "0.5", "float range": "0.5", "duration": "5s", "size": "1G"}


def commands(command: click.Command, path: str = "cpbench") -> Iterator[tuple[str, click.Command]]:
    """Every command that does something, with its words."""
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            yield from commands(inner, f"{path} {name}")
    else:
        yield path, command


COMMANDS = dict(commands(cli))
OPTIONS = [
    (path, option.opts[-1])
    for path, command in COMMANDS.items()
    for option in command.params
    if isinstance(option, click.Option)
]


def option_of(path: str, flag: str) -> click.Option:
    return next(p for p in COMMANDS[path].params if isinstance(p, click.Option) and flag in p.opts)


def given(option: click.Option) -> list[str]:
    """The words of one use."""
    if option.is_flag:
        return [option.opts[-1]]
    kind = option.type
    value = next(iter(kind.choices)) if isinstance(kind, click.Choice) else VALUES.get(kind.name, "8")
    return [option.opts[-1], *[str(value)] * option.nargs]


def run(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr(sys, "argv", ["cpbench", *map(str, words)])
    try:
        main()
    except SystemExit as leave:
        return int(leave.code or 0)
    return 0


@pytest.mark.needs("cpbench_lab")
def test_the_tree_is_walked() -> None:
    """The commands of README, those of packages, and the nested ones."""
    assert {"cpbench run", "cpbench plot", "cpbench results merge"} <= COMMANDS.keys()
    assert len(OPTIONS) > 180


@pytest.mark.parametrize("path", COMMANDS)
def test_every_command_counts_its_options(path) -> None:
    assert isinstance(COMMANDS[path], Command)


@pytest.mark.parametrize(("path", "flag"), some_by_day(OPTIONS, 80))
def test_every_option_given_twice(monkeypatch, capsys, path, flag) -> None:
    """One of a single value is an error that names it, before anything else is looked at; a list has both."""
    option = option_of(path, flag)
    words = given(option)
    if not option.multiple:
        assert run(monkeypatch, *path.split()[1:], *words, *words) == 2
        assert f"{'/'.join((flag, *option.secondary_opts))} is given twice" in capsys.readouterr().err
        return
    command = COMMANDS[path]
    context = click.Context(command)
    pair = ("8", "16")
    repeated = [word for value in pair for word in (flag, value)]
    parsed, _, _ = command.make_parser(context).parse_args(repeated)
    assert option.name is not None
    both = option.type_cast_value(context, parsed[option.name])
    assert list(both) == [one for value in pair for one in option.type_cast_value(context, [value])]
    assert len(set(map(str, both))) == 2
    if isinstance(option, ListOption):
        parsed, _, _ = command.make_parser(context).parse_args([flag, "8,16"])
        assert option.type_cast_value(context, parsed[option.name]) == both


def test_a_flag_and_its_opposite(monkeypatch, capsys) -> None:
    assert run(monkeypatch, "run", "--history", "--no-history") == 2
    assert "is given twice" in capsys.readouterr().err


@pytest.fixture
def problem(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A problem with two starting points and a solution in its file, z = (4/3, 7/3)."""
    monkeypatch.chdir(tmp_path)
    lcp = LCP(M=np.array([[2.0, 1], [1, 2]]), q=[-5.0, -6.0], name="deudeu")
    at = [lcp.point_from_vector(x) for x in ([4 / 3, 7 / 3], [1.0, 1], [2.0, 2])]
    storage.save_answer(tmp_path / "p.h5", lcp, at[0], {}, with_problem=True, guesses=at[1:])
    return tmp_path / "p.h5"


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("once", "twice", "column", "expected"),
    some_by_day(
        [
            (["-t", "1e-4,1e-8"], ["-t", "1e-4", "-t", "1e-8"], "tolerance", {1e-4, 1e-8}),
            (["-s", "lemke,newton-min"], ["-s", "lemke", "-s", "newton-min"], "solver", {"lemke", "newton-min"}),
            (["--start", "file,file:2"], ["--start", "file", "--start", "file:2"], "start", {"file", "file:2"}),
        ],
        1,
    ),
)
def test_both_ways_plan_both_rows(monkeypatch, problem, once, twice, column, expected) -> None:
    for name, words in (("once", once), ("twice", twice)):
        solver = [] if "-s" in words else ["-s", "psor[omega=1.0]"]
        out = f"{name}.sqlite"
        assert run(monkeypatch, "run", problem, *words, *solver, "--repeats", 1, "-o", out, "--no-report", "-q") == 0
        with Store(Path(out)) as store:
            assert {getattr(row, column) for row in store.rows()} == expected


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["solve", "p.h5", "-s", "psor[omega=1,omega=1.5]"], "omega is given twice, as 1 and 1.5"),
        (["run", "p.h5", "-s", "psor[omega=1,omega=1.5]"], "omega is given twice, as 1 and 1.5"),
        (["convert", "p.h5", "x.h5", "--set", "s=1", "--set", "s=2"], "s is 1 and 2: give it once"),
    ],
)
def test_two_values_within_one_option(monkeypatch, capsys, problem, words, said) -> None:
    assert run(monkeypatch, *words) == 2
    assert said in capsys.readouterr().err
