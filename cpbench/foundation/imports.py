"""Imports that take less time: without a search for garbage, of which they make none, or beside something else."""

from __future__ import annotations

import contextlib
import gc
import importlib
import threading
from collections.abc import Generator


@contextlib.contextmanager
def uncollected() -> Generator[None]:
    """Collect no garbage meanwhile. The owner of the process may want to `gc.freeze` what is there then."""
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()


def import_ahead(*modules: str) -> None:
    """Import them in a thread of their own, while this one waits for something else; a user of one waits for it, and
    learns why it cannot be imported.
    """
    threading.Thread(target=_import, args=(modules,)).start()


def _import(modules: tuple[str, ...]) -> None:
    with uncollected(), contextlib.suppress(Exception):
        for module in modules:
            importlib.import_module(module)
