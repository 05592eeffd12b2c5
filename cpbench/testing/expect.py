"""Answers of checks besides yes: an expected refusal, and a check that does not apply. No test framework needed."""

from __future__ import annotations

import re
from collections.abc import Generator
from contextlib import contextmanager
from unittest import SkipTest


@contextmanager
def refused(cause: type[Exception], pattern: str, where: str) -> Generator[None]:
    """Require that the block raises `cause` with a message that matches `pattern`; `where` says what was asked.

    Another exception passes through: a plugin that crashes is not one that refuses.
    """
    try:
        yield
    except cause as refusal:
        if re.search(pattern, str(refusal)) is None:
            raise AssertionError(f"{where}: refused, but '{refusal}' does not say '{pattern}'") from refusal
        return
    raise AssertionError(f"{where}: expected {cause.__name__}, nothing was raised")


def only_for(does: bool, whom: str) -> None:
    """Skip, so that the table of a run tells a check that ran from one that had nothing to say."""
    if not does:
        raise SkipTest(f"does not apply: only for {whom}")
