r"""Performance profiles as pgfplots: a column wide, each solver with its own colour and mark in all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from cpbench.analysis.profiles import Curve, Profile
from cpbench.report.figures import INEXACT, right_end, shorten
from cpbench.report.legend import PALETTE
from cpbench_lab.document.escape import text

CORNERS = 300
"""The most corners of a curve: TeX reads every one."""
PROFILES = Path(__file__).parent / "profiles.tex"
"""Axes of a profile and of a panel."""
MARKS = ("*", "square*", "triangle*", "diamond*", "x", "pentagon*", "+", "o", "square", "triangle")
"""Those of the looks; curves of one colour differ in them, and most others, so that grey and a printer's black do."""


def styles() -> str:
    """Write the colours and sizes."""
    colours = "\n".join(f"\\definecolor{{cpbench{chr(65 + k)}}}{{HTML}}{{{c[1:]}}}" for k, c in enumerate(PALETTE))
    return f"{colours}\n{PROFILES.read_text(encoding='utf-8')}"


def figure(
    profile: Profile, labels: Sequence[str], kinds: Mapping[str, str], looks: Mapping[str, int], caption: str, key: str
) -> str:
    """Write the curves of `labels` in one column, with their legend below."""
    upto = right_end(profile)
    body = "\n".join(_plot(curve, upto, kinds, looks, legend=True) for curve in _chosen(profile, labels))
    return (
        "\\begin{figure}[!htbp]\n\\centering\n\\begin{tikzpicture}\n"
        f"\\begin{{axis}}[xmode=log, cpbench profile, xmax={upto:g}]\n{body}\n\\end{{axis}}\n\\end{{tikzpicture}}\n"
        f"\\caption{{{caption}}}\\label{{{key}}}\n\\end{{figure}}"
    )


def panels(
    profiles: Mapping[str, Profile],
    labels: Sequence[str],
    kinds: Mapping[str, str],
    looks: Mapping[str, int],
    caption: str,
    key: str,
) -> str:
    """Write small multiples two columns wide: a panel a profile, by its title in TeX, all with the same curves and
    axes.
    """
    upto = max((right_end(profile) for profile in profiles.values()), default=2.0)
    parts: list[str] = []
    last = len(profiles) - 1
    for k, (title, profile) in enumerate(profiles.items()):
        style = [f"title={{{title}}}", *(["ylabel={}"] if k % 3 else []), *(["xlabel={}"] if k + 3 <= last else [])]
        named = ["legend to name=" + key.replace(":", ""), "legend columns=4"] if k == last else []
        parts.append(f"\\nextgroupplot[{', '.join([*style, *named])}]")
        parts += [_plot(curve, upto, kinds, looks, legend=k == last) for curve in _chosen(profile, labels)]
    rows = -(-len(profiles) // 3)
    return (
        "\\begin{figure*}[!htbp]\n\\centering\n\\begin{tikzpicture}\n\\begin{groupplot}[xmode=log, cpbench panel, xmax="
        f"{upto:g}, group style={{group size=3 by {rows}, horizontal sep=3.2em, vertical sep=4.2em}}]\n"
        + "\n".join(parts)
        + "\n\\end{groupplot}\n\\end{tikzpicture}\\\\[1ex]\n"
        f"\\pgfplotslegendfromname{{{key.replace(':', '')}}}\n\\caption{{{caption}}}\\label{{{key}}}\n\\end{{figure*}}"
    )


def _chosen(profile: Profile, labels: Sequence[str]) -> list[Curve]:
    """Return the curves in the order of the labels; flat ones at 0 among them."""
    found = {curve.label: curve for curve in profile.curves}
    return [found[label] for label in labels]


def _plot(curve: Curve, upto: float, kinds: Mapping[str, str], looks: Mapping[str, int], *, legend: bool) -> str:
    place = looks[curve.label]
    colour = f"cpbench{chr(65 + place % len(PALETTE))}"
    mark = MARKS[(place + place // len(PALETTE)) % len(MARKS)]
    corners = list(zip(*curve.outline(upto, CORNERS), strict=True))
    points = "".join(f"({x:.5g},{y:.5g})" for x, y in corners)
    dashed = ", dashed" if kinds.get(curve.label, "") in INEXACT else ""
    marks = f"mark repeat={max(1, len(corners) // 6)}"
    entry = f"\n\\addlegendentry{{\\texttt{{{text(shorten(curve.label, 24))}}}}}" if legend else ""
    return f"\\addplot[{colour}, mark={mark}, {marks}{dashed}] coordinates {{{points}}};{entry}"
