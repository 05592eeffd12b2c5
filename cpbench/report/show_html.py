"""A problem as HTML, for notebooks: its law, its sizes, and its data in numbers or as block structure."""

from __future__ import annotations

import html

from cpbench.formulations.base import Problem
from cpbench.report import show


def problem_html(problem: Problem) -> str:
    """Return what `cpbench show` prints, the law above the rest, which keeps its columns."""
    head = html.escape(f"{problem.name or problem.node}: {problem.title}")
    # dots and frame are aligned where one font has both
    style = "line-height:1.15;font-family:DejaVu Sans Mono,monospace"
    return f'<b>{head}</b><pre style="{style}">{html.escape(show.text(problem))}</pre>'
