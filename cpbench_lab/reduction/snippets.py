"""A reduced problem as a program in Python, C and Julia: its data, a claimed and a true answer, and the check of both.

The programs need nothing but their language: whoever gets one can put the data into the solver at hand. They print how
far each answer is from meeting the conditions, and end with 0 where that is what was found here.
"""

from __future__ import annotations

from collections.abc import Mapping
from string import Template
from textwrap import indent
from typing import Any

import numpy as np

from cpbench.foundation.matrices import Dense, Vector
from cpbench_lab.reduction.forms import Form

MET = 1e-6
"""Error of an answer up to which it counts as true: of the order of the tolerances of solvers."""


def snippets(form: Form, title: str, answers: Mapping[str, Any]) -> dict[str, str]:
    """Return the programs by file name.

    Parameters
    ----------
    title : a line about the problem and the solver. answers : name -> point, `claimed` and `true`, as far as known.
    """
    vectors = {name: form.vector(point) for name, point in answers.items()}
    conditions = _CONDITIONS.format(names=_names(form))
    writers = {"snippet.py": ("", _PYTHON, _python), "snippet.c": ("   ", _C, _c), "snippet.jl": ("# ", _JULIA, _julia)}
    found: dict[str, str] = {}
    for name, (margin, template, write) in writers.items():
        data = write(form, vectors)
        found[name] = Template(template).substitute(
            title=title, met=repr(MET), conditions=indent(conditions, margin), **data
        )
    return found


def _names(form: Form) -> str:
    return ", ".join(f"{name} ({size})" for name, size in form.names.items() if size)


def _number(x: float, infinite: str) -> str:
    if np.isfinite(x):
        return f"{int(x)}.0" if x == int(x) and abs(x) < 1e15 else repr(float(x))
    return f"-{infinite}" if x < 0 else infinite if x > 0 else "NAN"


def _list(values: Any, infinite: str, brackets: str = "[]") -> str:
    return brackets[0] + ", ".join(_number(float(x), infinite) for x in np.ravel(values)) + brackets[1]


def _blocks(form: Form) -> list[list[float]]:
    return [[b.start, b.slides, b.rolls, b.mu, b.mu_r] for b in form.blocks]


def _python(form: Form, vectors: Mapping[str, Vector]) -> dict[str, str]:
    rows = ",\n     ".join(_list(row, "inf") for row in form.K)
    return {
        "K": f"[{rows}]",
        "k": _list(form.k, "inf"),
        "lo": _list(form.lo, "inf"),
        "hi": _list(form.hi, "inf"),
        "blocks": "[" + ", ".join(f"({b[0]}, {b[1]}, {b[2]}, {b[3]!r}, {b[4]!r})" for b in _blocks(form)) + "]",
        "friction": str(form.friction),
        "answers": "{" + ", ".join(f"{n!r}: {_list(x, 'inf')}" for n, x in vectors.items()) + "}",
    }


def _c(form: Form, vectors: Mapping[str, Vector]) -> dict[str, str]:
    blocks = _blocks(form)
    rows = ",\n    ".join(_list(row, "INFINITY", "{}") for row in form.K)
    return {
        "n": str(form.k.size),
        "K": f"{{{rows}}}",
        "k": _list(form.k, "INFINITY", "{}"),
        "lo": _list(form.lo, "INFINITY", "{}"),
        "hi": _list(form.hi, "INFINITY", "{}"),
        "count": str(len(blocks)),
        "blocks": "{" + ", ".join(_list(b, "INFINITY", "{}") for b in blocks or [[0.0] * 5]) + "}",
        "friction": str(int(form.friction)),
        "answers": "{" + ", ".join(_list(x, "INFINITY", "{}") for x in vectors.values() or [form.k]) + "}",
        "labels": "{" + ", ".join(f'"{name}"' for name in vectors or ["none"]) + "}",
        "number": str(len(vectors)),
    }


def _julia(form: Form, vectors: Mapping[str, Vector]) -> dict[str, str]:
    return {
        "K": _julia_matrix(form.K),
        "k": _list(form.k, "Inf"),
        "lo": _list(form.lo, "Inf"),
        "hi": _list(form.hi, "Inf"),
        "blocks": "[" + ", ".join(f"({b[0] + 1}, {b[1]}, {b[2]}, {b[3]!r}, {b[4]!r})" for b in _blocks(form)) + "]",
        "friction": str(form.friction).lower(),
        "answers": "[" + ", ".join(f'"{name}" => {_list(x, "Inf")}' for name, x in vectors.items()) + "]",
    }


def _julia_matrix(K: Dense) -> str:
    if K.size == 1:
        return f"fill({_number(float(K[0, 0]), 'Inf')}, 1, 1)"
    return "[" + ";\n     ".join(" ".join(_number(float(x), "Inf") for x in row) for row in K) + "]"


_CONDITIONS = """\
Unknowns x: {names}. F = Kx + k. Outside the blocks x is in [lo, hi] with F = 0 inside, F >= 0 at lo, F <= 0 at hi.
In a block (start, slides, rolls, mu, mu_r): |x_T| <= mu x_N, |x_M| <= mu_r x_N, and F (with friction
F + (mu|F_T| + mu_r|F_M|)e_N) is in the dual cone and orthogonal to x."""
"""Explanation at the head of each program."""
_PYTHON = '''"""$title

$conditions
"""
from math import inf, sqrt

K = $K
k = $k
lo = $lo
hi = $hi
blocks = $blocks
friction = $friction
answers = $answers


def error(x):
    """Largest violation of the conditions."""
    if any(v != v for v in x):
        return inf
    F = [k[i] + sum(a * b for a, b in zip(K[i], x)) for i in range(len(k))]
    inside = {i for s, t, m, _, _ in blocks for i in range(s, s + 1 + t + m)}
    worst = max([abs(x[i] - min(max(x[i] - F[i], lo[i]), hi[i])) for i in range(len(k)) if i not in inside] or [0.0])
    for s, t, m, mu, mu_r in blocks:
        T, M = range(s + 1, s + 1 + t), range(s + 1 + t, s + 1 + t + m)
        size = lambda v, rows: sqrt(sum(v[i] ** 2 for i in rows))
        reach = mu * size(F, T) + mu_r * size(F, M)
        normal = F[s] + (reach if friction else 0.0)
        work = x[s] * normal + sum(x[i] * F[i] for i in (*T, *M))
        worst = max(worst, -x[s], size(x, T) - mu * x[s], size(x, M) - mu_r * x[s], reach - normal, abs(work))
    return worst


errors = {name: error(x) for name, x in answers.items()}
for name, value in errors.items():
    print(name, "answer: error", value)
raise SystemExit(errors.get("claimed", inf) <= $met or errors.get("true", 0.0) > $met)
'''

_C = """/* $title

$conditions

   cc snippet.c -lm && ./a.out */
#include <math.h>
#include <stdio.h>
#include <string.h>
#define N $n
#define BLOCKS $count
#define ANSWERS $number

static const double K[N][N] = $K;
static const double k[N] = $k;
static const double lo[N] = $lo;
static const double hi[N] = $hi;
static const double blocks[][5] = $blocks;
static const int friction = $friction;
static const double answers[][N] = $answers;
static const char *names[] = $labels;

static double size(const double *v, int from, int to) {
  double sum = 0.0;
  for (int i = from; i < to; i++) sum += v[i] * v[i];
  return sqrt(sum);
}

/* Largest violation of the conditions. */
static double error(const double *x) {
  double F[N], worst = 0.0;
  int inside[N] = {0};
  for (int i = 0; i < N; i++) {
    F[i] = k[i];
    for (int j = 0; j < N; j++) F[i] += K[i][j] * x[j];
  }
  for (int b = 0; b < BLOCKS; b++) {
    int s = (int)blocks[b][0], t = s + 1 + (int)blocks[b][1], m = t + (int)blocks[b][2];
    double mu = blocks[b][3], mu_r = blocks[b][4];
    double reach = mu * size(F, s + 1, t) + mu_r * size(F, t, m);
    double normal = F[s] + (friction ? reach : 0.0), work = x[s] * normal;
    for (int i = s; i < m; i++) inside[i] = 1;
    for (int i = s + 1; i < m; i++) work += x[i] * F[i];
    worst = fmax(worst, fmax(-x[s], fmax(reach - normal, fabs(work))));
    worst = fmax(worst, fmax(size(x, s + 1, t) - mu * x[s], size(x, t, m) - mu_r * x[s]));
  }
  for (int i = 0; i < N; i++)
    if (!inside[i]) worst = fmax(worst, fabs(x[i] - fmin(fmax(x[i] - F[i], lo[i]), hi[i])));
  for (int i = 0; i < N; i++)
    if (isnan(x[i])) worst = INFINITY;
  return worst;
}

int main(void) {
  int as_found = 1;
  for (int a = 0; a < ANSWERS; a++) {
    double value = error(answers[a]);
    printf("%s answer: error %g\\n", names[a], value);
    if (!strcmp(names[a], "claimed")) as_found &= value > $met;
    else as_found &= value <= $met;
  }
  return !as_found;
}
"""

_JULIA = """# $title
#
$conditions
K = $K
k = $k
lo = $lo
hi = $hi
blocks = $blocks
friction = $friction
answers = $answers

size2(v) = sqrt(sum(abs2, v; init = 0.0))

"Largest violation of the conditions."
function violation(x)
    any(isnan, x) && return Inf
    F = K * x + k
    outside = trues(length(k))
    worst = 0.0
    for (s, t, m, mu, mu_r) in blocks
        T, M = s+1:s+t, s+t+1:s+t+m
        outside[s:s+t+m] .= false
        reach = mu * size2(F[T]) + mu_r * size2(F[M])
        normal = F[s] + (friction ? reach : 0.0)
        work = x[s] * normal + sum(x[i] * F[i] for i in s+1:s+t+m; init = 0.0)
        worst = max(worst, -x[s], size2(x[T]) - mu * x[s], size2(x[M]) - mu_r * x[s], reach - normal, abs(work))
    end
    for i in findall(outside)
        worst = max(worst, abs(x[i] - min(max(x[i] - F[i], lo[i]), hi[i])))
    end
    return worst
end

for (name, x) in answers
    println(name, " answer: error ", violation(x))
end
"""
