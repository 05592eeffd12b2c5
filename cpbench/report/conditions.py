"""Under which conditions a run was made: limits, machine, versions, and how quiet the machine was."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cpbench.analysis.quotation import quotation
from cpbench.report.html.columns import KEPT, WHOLE
from cpbench.report.run import Run
from cpbench.report.text import code, counted, plain, seconds

DRIFT = 1.1
"""A machine that was this many times slower at one time than at another spoils ratios."""
MANY = (
    "numbers and curves are of all of them; lists of pairs are cut short, and `report.html` has the facts of single "
    f"pairs for at most {KEPT} failures"
)
"""Sentence where rows are too many to show each."""


def conditions(run: Run) -> Iterator[str]:
    """Yield tolerances, limits, start and command, then the machine."""
    yield "## Limits and machine"
    yield _settings(run)
    yield from _machine(run)


def _settings(run: Run) -> str:
    meta = run.meta
    facts = {
        "tolerance": ", ".join(f"{t:g}" for t in sorted(run.rows["tolerance"].unique())),
        "limit": _all_of(run, "seconds", "{:g} s a solve"),
        "threads": _all_of(run, "threads", "{:g}"),
        "repeats": _all_of(run, "repeats_asked", "{:g} of short solves"),
        "start": ", ".join(sorted(set(run.rows["start"].unique()) - {""})),
        "collection": quotation(meta),
        "run on": meta.get("date", ""),
        "random order": f"seed {meta['seed']}" if meta.get("seed") is not None else "",
        "rows": f"{run.all_rows}, one a pair" if len(run.rows) else "",
        "results file": f"SHA-256 {meta['sha256']}" if meta.get("sha256") else "",
        "many rows": MANY if len(run.rows) > WHOLE else "",
    }
    lines = [f"- {name}: {value}" for name, value in facts.items() if str(value)]
    command = str(meta.get("command", "")).replace(str(Path.cwd()) + os.sep, "")
    return "\n".join([*lines, f"- command: {code(command)}"])


def _all_of(run: Run, column: str, form: str) -> str:
    """Return the values of a limit over all rows; "none" stands for an infinite one."""
    values = sorted(run.rows[column].dropna().unique())
    return ", ".join(form.format(v) if math.isfinite(v) else "none" for v in values)


def _machine(run: Run) -> Iterator[str]:
    facts: dict[str, Any] = {**(run.meta.get("machine") or {})}
    memory = sorted(run.rows["memory"].dropna().unique())
    if memory:
        facts["memory limit of a solve"] = ", ".join(f"{m / 2**30:.3g} GiB" if m else "none" for m in memory)
    hosts = sorted(set(run.rows["host"].unique()) - {""})
    if hosts:
        facts["hosts"] = ", ".join(hosts)
    facts |= {f"{name} (package)": version for name, version in sorted((run.meta.get("versions") or {}).items())}
    yield "\n".join(f"- {plain(name)}: {plain(value)}" for name, value in facts.items()) or "- machine: not recorded"
    yield from _quiet(run)


def _quiet(run: Run) -> Iterator[str]:
    """Yield whether the machine was fit for measuring."""
    jobs = run.rows["jobs"].dropna()
    shared = int((jobs > 1).sum())
    if shared:
        side = f"while up to {jobs.max():.0f} solves ran side by side"
        yield (
            f"**{counted(shared, 'time was', 'times were')} taken {side}** (column `jobs`): they share caches and "
            "memory, and are longer and less certain than times of one at a time."
        )
    took = [float(r["seconds"]) for r in run.meta.get("references") or [] if r["seconds"] == r["seconds"]]
    if len(took) > 1:
        spread = max(took) / min(took)
        yield (
            f"A solve that is always the same was repeated {len(took)} times during the run: it took "
            f"{seconds(min(took))} to {seconds(max(took))}, a drift of the machine by a factor {spread:.2f}"
            + (f". **Time ratios below {spread:.2g} are within this machine's noise.**" if spread > DRIFT else ".")
        )
    loads = run.rows["loadavg"].dropna()
    if len(loads):
        yield f"Load of the machine during the run: median {loads.median():.2f}, at most {loads.max():.2f}."
