"""Commands that a command tells its user to go on with, as they can be typed."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from cpbench.registry import PLUGIN_FILES


def line(*words: str) -> str:
    """Return `cpbench WORDS`, quoted for a shell, with the plugins that this command was given: names come from
    them."""
    given = [path for path in os.environ.get(PLUGIN_FILES, "").split(os.pathsep) if path]
    plugins = [word for path in dict.fromkeys(given) for word in ("--plugin", near(path))]
    return shlex.join(["cpbench", *words, *plugins])


def near(path: str) -> str:
    """Return a path from this folder on where it lies below it, else as it is."""
    place, here = Path(path), Path.cwd()
    return str(place.relative_to(here)) if place.is_absolute() and place.is_relative_to(here) else path
