"""The command line in the test's own process: a new one takes a second or two to import everything.

Not for what a process of its own is part of: plugins (a registry keeps them), variables that workers see, signals.
"""

from __future__ import annotations

import contextlib
import io
import sys
from pathlib import Path
from subprocess import CompletedProcess
from unittest import mock

from cpbench.cli import main


def cpbench(folder: Path, *arguments: str) -> CompletedProcess[str]:
    """What `cpbench` with these arguments, called in a folder, ends with and prints."""
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
    return CompletedProcess(list(arguments), code, out.getvalue(), err.getvalue())
