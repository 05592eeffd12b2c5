"""The Python interface: what `import cpbench` offers, and what the commands stand on.

`problems` loads, converts and measures, `solving` solves here and now, `runs` benchmarks in processes of their own and
reads results. All of it is reached as `cpbench.NAME`.
"""

from __future__ import annotations

from cpbench.formulations.base import Problem


def _notebook_view(problem: Problem) -> str:
    """Return what a notebook shows of a problem."""
    from cpbench.report.show import problem_html

    return problem_html(problem)


Problem.notebook_view = _notebook_view
