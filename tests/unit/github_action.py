"""A composite action run as GitHub's runner runs it: inputs, expressions, the files behind GITHUB_OUTPUT, ….

Steps that `uses:` another action are not run: their inputs are evaluated and kept. An expression may have what the
action of this repository needs: contexts, strings, == != && || ! and the functions format and always.
"""

from __future__ import annotations

import os
import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

_TOKEN = re.compile(r"'(?:[^']|'')*'|&&|\|\||!=|==|!|[A-Za-z_][\w.-]*|[(),]|\s+")
_WORDS = {"&&": " and ", "||": " or ", "!": " not ", "true": "True", "false": "False", "null": "None"}


def load(path: Path) -> dict[str, Any]:
    """A YAML file; `on`, which YAML 1.1 reads as a truth value, is the text again."""
    found = yaml.safe_load(path.read_text(encoding="utf-8"))
    return {"on" if key is True else key: value for key, value in found.items()}


def expressions(value: Any) -> list[str]:
    """What stands in ${{ }} anywhere in a value."""
    if isinstance(value, dict):
        return [found for item in value.values() for found in expressions(item)]
    if isinstance(value, list):
        return [found for item in value for found in expressions(item)]
    return re.findall(r"\$\{\{(.*?)\}\}", value) if isinstance(value, str) else []


def evaluate(expression: str, contexts: dict[str, Any], ok: bool = True) -> Any:
    """The value of an expression; raises AssertionError on what is none, KeyError on an unknown context."""
    parts, at, always = [], 0, False
    for token in _TOKEN.finditer(expression):
        assert token.start() == at, f"no expression: {expression}"
        at, text = token.end(), token[0]
        if text[0] == "'":
            parts.append(repr(text[1:-1].replace("''", "'")))
        elif re.match(r"[A-Za-z_]", text) and text not in (*_WORDS, "format", "always"):
            parts.append(repr(_looked_up(text, contexts)))
        else:
            always |= text == "always"
            parts.append(_WORDS.get(text, text))
    assert at == len(expression), f"no expression: {expression}"
    names = {"always": lambda: True, "format": lambda text, *values: text.format(*values), "__builtins__": {}}
    value = eval("".join(parts).strip(), names)
    return value if always or ok else False


def _looked_up(name: str, contexts: dict[str, Any]) -> Any:
    """The value of a.b.c; what is not there below a context is empty."""
    first, *rest = name.split(".")
    value = contexts[first]
    for key in rest:
        value = value.get(key, "") if isinstance(value, dict) else ""
    return value


def _filled(value: Any, contexts: dict[str, Any]) -> str:
    return re.sub(r"\$\{\{(.*?)\}\}", lambda found: str(evaluate(found[1].strip(), contexts)), str(value))


@dataclass
class Done:
    """An action that has run: exit code of the first step that failed, what was written, `uses` -> its inputs."""

    code: int
    summary: str
    outputs: dict[str, str]
    log: str
    used: dict[str, dict[str, str]] = field(default_factory=dict)


def run_action(
    action: Path, checkout: Path, temp: Path, inputs: dict[str, str], github: dict[str, Any], env: dict[str, str]
) -> Done:
    """Run the steps of an action in order; `github` is the context of that name."""
    table = load(action)
    given = {name: inputs.get(name, told.get("default", "")) for name, told in table["inputs"].items()}
    assert set(inputs) <= set(given), f"no such inputs: {set(inputs) - set(given)}"
    assert all(given[name] for name, told in table["inputs"].items() if told.get("required"))
    temp.mkdir()
    contexts: dict[str, Any] = {"inputs": given, "github": github, "steps": {}, "runner": {"temp": str(temp)}}
    places = {
        name: temp / name.lower() for name in ("GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY", "GITHUB_ENV", "GITHUB_PATH")
    }
    done = Done(0, "", {}, "")
    for step in table["runs"]["steps"]:
        if not evaluate(step.get("if", "true").strip(), contexts, done.code == 0):
            continue
        if "uses" in step:
            done.used[step["uses"]] = {key: _filled(value, contexts) for key, value in step.get("with", {}).items()}
            continue
        for place in places.values():
            place.write_text("")
        here = {"GITHUB_ACTIONS": "true", "GITHUB_ACTION_PATH": str(action.parent), "RUNNER_TEMP": str(temp), **env}
        here |= {name: str(place) for name, place in places.items()}
        here |= {name: _filled(value, contexts) for name, value in step.get("env", {}).items()}
        script = temp / "step.sh"
        script.write_text(_filled(step["run"], contexts))
        assert step["shell"] == "bash"
        ran = subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", str(script)],  # what `shell: bash` is
            cwd=checkout,
            env={**os.environ, **here},
            capture_output=True,
            text=True,
            timeout=600,
        )
        done.log += ran.stdout + ran.stderr
        done.code = done.code or ran.returncode
        done.summary += places["GITHUB_STEP_SUMMARY"].read_text()
        pairs = [line.partition("=")[::2] for line in places["GITHUB_OUTPUT"].read_text().splitlines()]
        if "id" in step:
            contexts["steps"][step["id"]] = {"outputs": dict(pairs)}
    done.outputs = {name: _filled(told["value"], contexts) for name, told in table["outputs"].items()}
    return done
