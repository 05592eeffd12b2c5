"""Options: which values those of a solver may have, and lists of a command, repeated or between commas."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Literal

import click
import numpy as np
import pytest
from command_line import cpbench

from cpbench import storage
from cpbench.cli import cli
from cpbench.cli.options import ListOption
from cpbench.errors import UnknownName
from cpbench.formulations import LCP
from cpbench.solvers.base import SolverSpec, choices, parse_options


class Order(StrEnum):
    FORWARD = "forward"
    BACKWARD = "backward"


@dataclass(frozen=True)
class Options:
    omega: float = 1.0
    order: Order = Order.FORWARD
    norm: Literal["2", "inf"] = "2"
    name: str = "free"


def test_enums_and_literals_limit_an_option() -> None:
    assert choices(Options, "order") == (Order.FORWARD, Order.BACKWARD)
    assert choices(Options, "norm") == ("2", "inf")
    assert choices(Options, "omega") == choices(Options, "name") == ()


def test_other_values_are_refused_by_name() -> None:
    spec = SolverSpec(name="mine", node="lcp", summary="", method="", options=Options)
    assert parse_options(spec, {"omega": "7"}).omega == 7.0
    assert parse_options(spec, {"order": "backward"}).order is Order.BACKWARD
    with pytest.raises(UnknownName, match="inf"):
        parse_options(spec, {"norm": "1"})
    with pytest.raises(UnknownName, match="forward"):
        parse_options(spec, {"order": "sideways"})


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


LISTS = [
    (path, option) for path, command in commands(cli) for option in command.params if isinstance(option, ListOption)
]


@pytest.mark.parametrize(("path", "option"), LISTS, ids=lambda value: getattr(value, "name", value))
def test_repeated_is_the_same_as_between_commas(path: str, option: ListOption) -> None:
    context = click.Context(click.Command(path))
    both = option.type_cast_value(context, ["8", "16"])
    assert len(set(map(str, both))) == 2
    assert both == option.type_cast_value(context, ["8,16"]) == option.type_cast_value(context, ["8", "16,8"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["solve", "p.h5", "-s", "psor[omega=1,omega=1.5]"], "omega is given twice, as 1 and 1.5"),
        (["run", "p.h5", "-s", "psor[omega=1,omega=1.5]"], "omega is given twice, as 1 and 1.5"),
        (["convert", "p.h5", "x.h5", "--set", "s=1", "--set", "s=2"], "s is 1 and 2: give it once"),
    ],
)
def test_two_values_within_one_option(tmp_path: Path, words: list[str], said: str) -> None:
    storage.save(LCP(M=np.eye(2), q=[-1.0, -1.0], name="p"), tmp_path / "p.h5")
    done = cpbench(tmp_path, *words)
    assert (done.returncode, said in done.stderr) == (2, True), done.stderr
