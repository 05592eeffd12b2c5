"""A plugin that works, written from templates to be changed, and the commands to go on with."""

from __future__ import annotations

import os
import shlex
import tempfile
from collections.abc import Mapping
from pathlib import Path

from cpbench.errors import CpbenchError, DuplicateName, FormatError
from cpbench.formulations import formulations
from cpbench.testing import new_templates


def plugin_texts(kind: str, name: str, lang: str, node: str) -> dict[str, str]:
    """Return the files of a plugin by name.

    Parameters
    ----------
    kind : solver, conversion or problem. name : of letters, digits, - and _. lang : language of a solver.
    node : its formulation.

    Raises CpbenchError where there is no such template, DuplicateName where the name is taken, UnknownName.
    """
    if kind != "solver" and lang != "python":
        raise CpbenchError(f"a {kind} is written in Python; --lang is for solvers")
    formulations.get(node)
    words = new_templates.words(kind, name)
    _require_free(kind, words["EDGE"] if kind == "conversion" else name)
    return new_templates.texts(kind, words, lang, node)


def _require_free(kind: str, name: str) -> None:
    """Raise DuplicateName when the name belongs to something that is registered."""
    from cpbench.testing.conduct import REGISTRIES

    if name in REGISTRIES[kind]:
        raise DuplicateName(f"the {kind} '{name}' exists already: take another name")


def write_files(folder: Path, texts: Mapping[str, str], force: bool) -> None:
    """Write all files or none; raises FormatError where one exists (unless `force`) or cannot be written."""
    for file in texts:
        if (folder / file).exists() and not force:
            raise FormatError(folder / file, "", "exists already; --force replaces it, -o FOLDER writes elsewhere")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".new-") as place:
            for file, text in texts.items():
                fresh = Path(place, file)
                fresh.parent.mkdir(parents=True, exist_ok=True)
                fresh.write_text(text, encoding="utf-8")
                if text.startswith("#!"):
                    fresh.chmod(0o755)
            for file in texts:
                (folder / file).parent.mkdir(parents=True, exist_ok=True)
                os.replace(Path(place, file), folder / file)
    except OSError as cause:
        raise FormatError(folder, "", f"cannot be written ({cause.strerror or cause})") from None


def next_steps(lang: str, folder: Path, texts: Mapping[str, str]) -> list[str]:
    """Return the commands to go on with."""
    plugin = next(file for file in sorted(texts) if file.endswith(".py" if lang == "python" else ".toml"))
    check = shlex.join(["cpbench", "check", str(folder / plugin)])
    if lang == "cpp":
        return [shlex.join(["make", "-C", str(folder)]), check]
    if lang == "julia":
        return [f"install Julia and the packages, as the first line of {folder / plugin} says", check]
    return [check]
