"""The sections as one offline page, and the problems that its command lines name."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from importlib import resources
from pathlib import Path

from cpbench import __version__, storage
from cpbench.errors import FormatError
from lecture import (
    beyond,
    cones,
    contact,
    facets,
    friction,
    linear,
    markup,
    misprints,
    nonlinear,
    nonsmooth,
    overview,
    quadratic,
    variational,
)
from lecture.blocks import Section
from lecture.numerics.examples import problems
from lecture.references import REFERENCES

TITLE = "Complementarity, from quadratic programs to friction"
EQUATIONS = range(1, 50)
SECTIONS: tuple[Callable[[], Section], ...] = (
    overview.section,
    quadratic.section,
    nonlinear.section,
    linear.section,
    cones.section,
    variational.section,
    nonsmooth.section,
    contact.section,
    facets.section,
    friction.section,
    beyond.section,
    misprints.section,
)


def write(folder: Path, sections: tuple[Callable[[], Section], ...] | None = None) -> Path:
    """Write `index.html` and `problems.h5` into `folder`; raises FormatError when they cannot be written.

    `sections` are all of them unless given.
    """
    page = html([make() for make in sections or SECTIONS])
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "index.html"
        path.write_text(page, encoding="utf-8")
    except OSError as cause:
        raise FormatError(folder, "", f"cannot be written ({cause.strerror or cause})") from None
    storage.save_pack(problems(), folder / "problems.h5", force=True)
    return path


def html(sections: list[Section]) -> str:
    """The whole document; nothing in it comes from anywhere else."""
    body = "\n".join(markup.section(section) for section in sections)
    style = resources.files("lecture").joinpath("assets/lecture.css").read_text(encoding="utf-8")
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta name="generator" content="cpbench {escape(__version__)}">
<title>{escape(TITLE)}</title>
<link rel="icon" href="data:,">
<style>
{style}</style>
</head>
<body>
<a class="skip" href="#map">Skip to the first section</a>
<header>
<h1>{escape(TITLE)}</h1>
<p class="lead">A walk through the forty-nine equations of Vincent Acary's lecture on solvers for time-discretized
problems {markup.inline("[^lecture]", {})}: each one on a problem small enough to write out, converted, solved, carried
back and drawn.</p>
<p>Every <data>number set like this</data> was computed by the library when the page was built; no one typed it. The
problems are in <code>problems.h5</code> beside the page, and the commands under <em>Try it</em> run on them.</p>
</header>
<nav aria-label="Contents">
<details open><summary>Contents</summary>
<ol>
{_contents(sections)}
</ol>
<p class="index-title" id="index-title">Equations</p>
<p class="index" aria-labelledby="index-title">{_index()}</p>
</details>
</nav>
<main>
{body}
{_references()}
</main>
<footer><p>Built by <code>python docs/generate</code>. Facts and formulas follow the lecture, the words are
ours.</p></footer>
</body>
</html>
"""


def _contents(sections: list[Section]) -> str:
    rows = [f'<li><a href="#{section.slug}">{escape(section.title)}</a></li>' for section in sections]
    return "\n".join([*rows, '<li><a href="#references">References</a></li>'])


def _index() -> str:
    """A link to every equation."""
    return " ".join(f'<a href="#eq-{k}" aria-label="equation {k}">{k}</a>' for k in EQUATIONS)


def _references() -> str:
    rows = "\n".join(f'<li id="ref-{key}">{escape(told)}</li>' for key, told in REFERENCES.items())
    return (
        '<section id="references" aria-labelledby="references-title">\n'
        f'<h2 id="references-title">References</h2>\n<ol>\n{rows}\n</ol>\n</section>'
    )
