"""The command line in the test's own process: a new one takes a second or two to import everything.

Not for what a process of its own is part of: signals, imports, how an interpreter ends.
"""

from __future__ import annotations

import contextlib
import io
import logging
import os
import sys
from pathlib import Path
from subprocess import CompletedProcess
from unittest import mock

import pytest

from cpbench import registry as plugged
from cpbench.cli import main
from cpbench.registry import DECLARED, PLUGIN_FILES
from cpbench.solvers.external import declared
from cpbench.testing import conduct


def cpbench(folder: Path, *words: object) -> CompletedProcess[str]:
    """What `cpbench` with these arguments, called in a folder, ends with and prints."""
    arguments = [*map(str, words)]
    out, err, code = io.StringIO(), io.StringIO(), 0
    with (
        mock.patch.object(sys, "argv", ["cpbench", *arguments]),
        contextlib.chdir(folder),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as leave:
            code = int(leave.code or 0)
        for handler in logging.getLogger("cpbench.run").handlers:  # a process closes its log when it ends
            handler.close()
    return CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


def exit_code(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    """The exit code of `cpbench` with these arguments, whose output is left to `capsys`."""
    monkeypatch.setattr(sys, "argv", ["cpbench", *map(str, words)])
    try:
        main()
    except SystemExit as leave:
        return int(leave.code or 0)
    return 0


def with_plugins(folder: Path, *words: object, **variables: str) -> CompletedProcess[str]:
    """The same for a command that loads plugins, which are forgotten after it, and with variables of its own."""
    with contextlib.ExitStack() as stack:
        for registry in conduct.REGISTRIES.values():
            registry.discover()
            ours = {name: item for name, item in registry._items.items() if not of_others(item)}
            stack.enter_context(mock.patch.object(registry, "_items", ours))
            stack.enter_context(mock.patch.object(registry, "_imported", set()))
        stack.enter_context(mock.patch.object(plugged, "_environment", ("", "")))
        stack.enter_context(mock.patch.object(plugged, "_read", set()))
        stack.enter_context(mock.patch.object(declared, "_declared", {}))
        stack.enter_context(mock.patch.dict(os.environ, {PLUGIN_FILES: "", DECLARED: "", **variables}))
        return cpbench(folder, *words)


def of_others(item: object) -> bool:
    """Whether an earlier test of this process loaded it from a plugin, or declared it."""
    home = getattr(item, "__module__", "") or type(item).__module__
    return home.startswith((plugged.PLUGIN_MODULE, "cpbench.solvers.external."))
