"""The text of a bundle for its reader: how to run it again, what to expect, what is not in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from cpbench.bench.results.rows import Row
from cpbench.report.text import code, plain, seconds

HEADING = """The plan of this bundle: cpbench reproduce runs it and compares. By hand, in this folder:
cpbench run --plan plan.toml, with --plugin for each file in plugins/ that is told in REPRODUCE.md."""


def text(about: Mapping[str, Any], report: bool) -> str:
    """Write `REPRODUCE.md`."""
    loaded: list[str] = about["plugins"]
    plugin = "".join(f" --plugin {name}" for name in loaded)
    ask = (
        " It asks before it runs the code of " + _listed(loaded) + "." if loaded else " It runs no code of this bundle."
    )
    statuses = ", ".join(f"{count} {status}" for status, count in about["statuses"].items())
    lines = [
        "# How to run this again",
        "",
        "1. Install cpbench in the version that `BUNDLE.json` tells, and the packages of `versions.txt`.",
        f"2. `cpbench reproduce BUNDLE.zip`: checks all files, runs `plan.toml`, compares.{ask}",
        f"3. Or by hand, in the unpacked folder: {code(f'cpbench{plugin} run --plan plan.toml -o again.sqlite')}, then "
        "`cpbench compare results.sqlite again.sqlite`.",
        f"4. Expect: {about['pairs']} pairs ({statuses or 'none'}), about {seconds(about['seconds'])} where it was "
        "made. Statuses must agree; times are compared, and need not.",
        "5. A pair that ran into a limit of time or memory may end otherwise on a faster or a slower machine "
        "(`machine.json`).",
        "",
        "## What is in it",
        "",
        "- `plan.toml`: the plan. `results.sqlite`: its rows, answers and histories."
        + (" `report/`: their report." if report else ""),
        f"- `problems/`: {_problems(about['problems'])}.",
        *(
            ["- `plugins/`: code that is not cpbench's, which made solvers known: read it before you run it."]
            * bool(loaded)
        ),
    ]
    missing = [*_withheld(about["problems"]), *(f"- {plain(item)}" for item in about["absent"])]
    if missing:
        lines += ["", "## What is not in it", "", *missing]
    if about["restricted"]:
        lines += ["", "## Restrictions", ""]
        lines += [
            f"- publishing figures of {plain(name)}: {plain(term)}"
            for name, term in sorted(about["restricted"].items())
        ]
    return "\n".join(lines) + "\n"


def versions(meta: Mapping[str, Any], rows: Iterable[Row]) -> str:
    """Write `versions.txt`: Python, the system, packages as `pip freeze` has them, what each solver said of itself."""
    machine: Mapping[str, Any] = meta.get("machine") or {}
    listed = sorted({(row.solver, row.version) for row in rows if row.version})
    return "\n".join(
        [
            f"# Python {machine.get('python', 'not told')}, {machine.get('os', 'system not told')}",
            *(f"{name}=={version}" for name, version in sorted((meta.get("versions") or {}).items())),
            "# versions that the solvers told in the run",
            *(f"# {solver} {version}" for solver, version in listed),
            "",
        ]
    )


def _problems(places: Iterable[Mapping[str, Any]]) -> str:
    kinds = Counter("withheld" if p["withheld"] else "builtin" if _builtin(p) else "file" for p in places)
    wording = {
        "file": "in files",
        "builtin": "built into cpbench, found by name and fingerprint",
        "withheld": "withheld",
    }
    return ", ".join(f"{kinds[kind]} {words}" for kind, words in wording.items() if kinds[kind]) or "none"


def _builtin(place: Mapping[str, Any]) -> bool:
    return str(place["address"]).startswith("builtin/")


def _withheld(places: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return a line each; who has the problem gives its folder to `cpbench reproduce --problems`."""
    return [
        f"- {code(p['address'])} ({plain(p['node'])}, fingerprint {plain(p['fingerprint'])}): {plain(p['withheld'])}"
        + (f"; from {plain(p['source'])}" if p["source"] else "")
        + (f"; {plain(p['citation'])}" if p["citation"] else "")
        + "; `--problems FOLDER` finds it by its fingerprint"
        for p in places
        if p["withheld"]
    ]


def _listed(names: list[str]) -> str:
    return ", ".join(map(code, names))
