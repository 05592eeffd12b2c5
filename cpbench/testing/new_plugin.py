"""A plugin that works, written from the templates beside this file to be changed, and the commands to go on with.

A solver is a frame for its language, the method of its formulation (LANG/NODE.part) and what is said of both
(nodes.toml). Conversions and problems are whole files.
"""

from __future__ import annotations

import keyword
import os
import shlex
import tempfile
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path, PurePath

from cpbench.errors import CpbenchError, DuplicateName, FormatError
from cpbench.formulations import formulations

PART = ".part"
ONLY = "lcp"
"""The formulation of the templates that have no parts."""


def plugin_texts(kind: str, name: str, lang: str, node: str) -> dict[str, str]:
    """Return the files of a plugin by name.

    Parameters
    ----------
    kind : solver, conversion, problem or engine. name : of letters, digits, - and _. lang : language of a solver.
    node : its formulation.

    Raises CpbenchError where there is no such template, DuplicateName where the name is taken, UnknownName.
    """
    if kind != "solver" and lang != "python":
        raise CpbenchError(f"a {kind} is written in Python; --lang is for solvers")
    formulations.get(node)
    words = _words(kind, name)
    _require_free(kind, words["EDGE"] if kind == "conversion" else name)
    return _texts(kind, words, lang, node)


def _require_free(kind: str, name: str) -> None:
    """Raise DuplicateName when the name belongs to something that is registered."""
    from cpbench.testing.conduct import REGISTRIES

    if kind in REGISTRIES and name in REGISTRIES[kind]:
        raise DuplicateName(f"the {kind} '{name}' exists already: take another name")


def write_files(folder: Path, texts: Mapping[str, str], force: bool) -> None:
    """Write all files or none; raises FormatError where one exists (unless `force`) or cannot be written."""
    for file in texts:
        if (folder / file).exists() and not force:
            raise FormatError(folder / file, "", "exists already; --force replaces it, -o FOLDER writes elsewhere")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".new-") as temporary:
            for file, text in texts.items():
                fresh = Path(temporary, file)
                fresh.parent.mkdir(parents=True, exist_ok=True)
                fresh.write_text(text, encoding="utf-8")
                if text.startswith("#!"):
                    fresh.chmod(0o755)
            for file in texts:
                (folder / file).parent.mkdir(parents=True, exist_ok=True)
                os.replace(Path(temporary, file), folder / file)
    except OSError as cause:
        raise FormatError(folder, "", f"cannot be written ({cause.strerror or cause})") from None


def next_steps(kind: str, name: str, lang: str, folder: Path, texts: Mapping[str, str]) -> list[str]:
    """Return the commands to go on with."""
    plugin = next(file for file in sorted(texts) if file.endswith(".py" if lang == "python" else ".toml"))
    if kind == "engine":
        return [shlex.join(["cpbench", "--plugin", str(folder / plugin), "audit", name, "pile", "--steps", "200"])]
    check = shlex.join(["cpbench", "check", str(folder / plugin)])
    if lang == "cpp":
        return [shlex.join(["make", "-C", str(folder)]), check]
    if lang == "julia":
        return [f"install Julia and the packages, as the first line of {folder / plugin} says", check]
    return [check]


def _texts(kind: str, words: Mapping[str, str], lang: str, node: str) -> dict[str, str]:
    """Return the texts by name of the file, for a plugin with the names in `words`; raises CpbenchError where there is
    none."""
    folder = files("cpbench.testing") / "templates" / kind
    own = folder / lang
    nodes = _nodes(own)
    if node not in nodes:
        which = f"a {kind} in {lang}" if kind == "solver" else f"a {kind}"
        refusal = f"there is no template of {which} for '{node}', but for {', '.join(nodes)}"
        raise CpbenchError(f"{refusal}: take --node {nodes[0]}, and change it")
    templates = {file.name: file for file in own.iterdir()}
    if f"{node}{PART}" in templates:
        part = templates[f"{node}{PART}"].read_text("utf-8").rstrip()
        words = {**_of_node(folder / "nodes.toml", node), "PART": part, **words}
    whole = {_filled(name, words, "{}"): file for name, file in templates.items() if not name.endswith(PART)}
    return {name.removesuffix(".in"): _filled(file.read_text("utf-8"), words, "@{}@") for name, file in whole.items()}


def _words(kind: str, name: str) -> dict[str, str]:
    """Return what is filled into a template of a plugin; raises CpbenchError when `name` cannot be one."""
    module = name.replace("-", "_")
    if not (module.isidentifier() and name.isascii() and name[0].isalpha() and name[-1] not in "-_"):
        raise CpbenchError(f"'{name}' cannot be a name: take letters, digits, - and _, and a letter first")
    if keyword.iskeyword(module):
        raise CpbenchError(f"'{name}' is a word of Python: take another name")
    title = "".join(part[0].upper() + part[1:] for part in module.split("_") if part)
    edge = name if name.startswith("lcp-lcp-") else f"lcp-lcp-{name}"
    return {"NAME": name, "MODULE": module, "CLASS": title, "EDGE": edge, "FILE": f"{module}.py"}


def _nodes(folder: Traversable) -> list[str]:
    """Return the formulations that a folder has templates for."""
    return sorted(PurePath(file.name).stem for file in folder.iterdir() if file.name.endswith(PART)) or [ONLY]


def _of_node(file: Traversable, node: str) -> dict[str, str]:
    facts = tomllib.loads(file.read_text("utf-8"))[node]
    return {"NODE": node, **{key.upper(): str(value).strip() for key, value in facts.items()}}


def _filled(text: str, words: Mapping[str, str], mark: str) -> str:
    """Return `text` with every word in place of its mark; those that hold marks themselves come first in `words`."""
    for word, value in words.items():
        text = text.replace(mark.format(word), value)
    return text
