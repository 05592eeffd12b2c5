"""A matplotlib figure as inline SVG whose colours follow the page, light or dark."""

from __future__ import annotations

import io
import re
import warnings
from html import escape
from typing import TYPE_CHECKING

from cpbench.report import canvas

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VARIABLES = {
    canvas.INK: "ink",
    "#000000": "ink",
    "#222222": "ink",
    "#333333": "muted",
    "#444444": "muted",
    "#555555": "muted",
    "#666666": "muted",
    canvas.GREY: "grey",
    "#bdbdbd": "grey",
    "#bfbfbf": "grey",
    canvas.FAINT: "faint",
    "#d9d9d9": "faint",
    "#e2e2e2": "faint",
    "#ececec": "faint",
    "#f0f0f0": "wash",
    "#ffffff": "paper",
    canvas.BLUE: "blue",
    canvas.RED: "red",
    "#a34700": "red",
    canvas.GREEN: "green",
    "#a9cce6": "blue-wash",
    "#f2c6a6": "red-wash",
    "#b5decf": "green-wash",
}
"""Colours of the canvas, by the CSS variable that stands for each; a colour that is not here stays itself."""
COLUMN = 400.0
"""Width in points beyond which a figure scrolls on a telephone rather than shrinks."""
_BY_HEX = {colour.lower(): name for colour, name in VARIABLES.items()}


def inline(figure: Figure, key: str, alt: str, *, follow: bool = True) -> str:
    """The `svg` element; `key` makes its ids its own on the page.

    Without `follow` it keeps its colours, on a light plate: shades that mean something would not survive the dark.

    Nothing in it refers to anything outside.
    """
    import matplotlib

    stream = io.StringIO()
    metadata = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with matplotlib.rc_context({**canvas.STYLE, "svg.hashsalt": key}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(stream, format="svg", transparent=True, metadata=metadata)
    return themed(stream.getvalue(), key, alt, follow=follow)


def themed(document: str, key: str, alt: str, *, follow: bool = True) -> str:
    """An SVG document of matplotlib as an element of the page.

    >>> themed('<svg width="7pt" height="9pt" viewBox="0 0 7 9"><g id="a" style="fill: #0072b2"/></svg>', "k", "A dot")
    '<svg viewBox="0 0 7 9" role="img" aria-label="A dot"><g id="k-a" style="fill: var(--blue)"/></svg>'
    """
    body = document[document.index("<svg") :].strip()
    body = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", body, flags=re.DOTALL)
    body = re.sub(r'\s*<style type="text/css">.*?</style>', "", body, flags=re.DOTALL)
    view = re.search(r'viewBox="([^"]+)"', body)
    assert view is not None, "matplotlib writes a view box"
    classes = " ".join(
        name for name, has in (("light", not follow), ("wide", float(view[1].split()[2]) > COLUMN)) if has
    )
    kind = f' class="{classes}"' if classes else ""
    opening = f'<svg{kind} viewBox="{view[1]}" role="img" aria-label="{escape(alt)}">'
    body = re.sub(r"<svg[^>]*>", lambda _: opening, body, count=1)
    body = re.sub(r'\bid="([^"]+)"', rf'id="{key}-\1"', body)
    body = body.replace("xlink:href", "href").replace('href="#', f'href="#{key}-').replace("url(#", f"url(#{key}-")
    if follow:
        body = re.sub(r"#[0-9a-fA-F]{6}\b", _variable, body)
    body = re.sub(r' d="[^"]+"', lambda path: re.sub(r"-?\d+\.\d{3,}", _short, path[0]), body)
    body = re.sub(r">\s+<", "><", body)
    return body


def _variable(found: re.Match[str]) -> str:
    name = _BY_HEX.get(found[0].lower())
    return found[0] if name is None else f"var(--{name})"


def _short(found: re.Match[str]) -> str:
    """Hundredths of a point are finer than any screen."""
    return f"{float(found[0]):.2f}".rstrip("0").rstrip(".")
