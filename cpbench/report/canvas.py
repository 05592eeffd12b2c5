"""Paper for single figures: sizes of a journal's columns, few colours that survive grey, title and guide around them.

Words are mathtext (r"$r_\\mathrm{T}$", no LaTeX is called); what comes from a file goes through :func:`literal`.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.errors import CpbenchError, FormatError
from cpbench.report import legend
from cpbench.report.figure_kinds import Drawing
from cpbench.report.figures import STYLE as COMMON
from cpbench.report.text import cut

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMN, PAGE = 3.5, 7.0
"""Widths of one column and of two [in]."""
BLUE, RED, GREEN, GREY, FAINT, INK = "#0072B2", "#D55E00", "#009E73", "#8A8A8A", "#DCDCDC", "#1A1A1A"
"""Okabe and Ito's blue, vermilion and green; they differ in grey as well."""
STYLE: Any = {
    **COMMON,
    "text.parse_math": True,
    "mathtext.fontset": "dejavusans",
    "mathtext.default": "it",
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.edgecolor": "#555555",
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "axes.labelcolor": INK,
    "text.color": INK,
    "lines.solid_capstyle": "round",
    "pdf.fonttype": 42,
}
PLATE: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
"""Behind a word that stands on lines."""
SUFFIXES = (".svg", ".png", ".pdf")
NARROW = 4.5
"""Width below which a figure is for one column: legend inside, no guide [in]."""
LEAST = 1.3
"""Least width and height of a figure [in]."""
_TITLE, _LINE = 0.30, 0.125
"""Height of the title and of a line of the guide [in]."""


@contextmanager
def drawing() -> Generator[None]:
    """Make and write a figure in the style of reports (a context)."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        yield


def page(width: float, height: float, *, constrained: bool = False) -> Figure:
    """Create an empty figure [in] on the Agg canvas: no pyplot, no global state, no window.

    constrained : Matplotlib places the axes of `figure.subplots`; else they have places of their own.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=200, layout="constrained" if constrained else None)
    FigureCanvasAgg(figure)
    return figure


def narrow(width: float) -> bool:
    """Return whether a figure of this width [in] is for one column; not where it is NaN."""
    return width < NARROW


def resize(figure: Figure, width: float, height: float) -> None:
    """Make a figure `width` × `height` [in]; where one is NaN, its shape stays where axes have places of their own.

    Raises CpbenchError for sizes below LEAST.
    """
    old_width, old_height = figure.get_size_inches()
    if math.isnan(width) and math.isnan(height):
        return
    for value, flag in ((width, "--width"), (height, "--height")):
        if value < LEAST:
            raise CpbenchError(f"{flag} {value:.2g} in: at least {LEAST:g} in are needed here")
    if figure.get_layout_engine() is None:
        width, height = (
            old_width * height / old_height if math.isnan(width) else width,
            old_height * width / old_width if math.isnan(height) else height,
        )
    elif narrow(width):
        for axes in figure.axes:
            legend.inside(axes)
        height = width if math.isnan(height) else height
    else:
        needed = max((legend.needed(axes) for axes in figure.axes), default=0.0)
        if height < needed:
            raise CpbenchError(f"--height {height:.2g} in: at least {needed:.2g} in are needed here")
    figure.set_size_inches(old_width if math.isnan(width) else width, old_height if math.isnan(height) else height)


def literal(value: Any, length: int = 60) -> str:
    """Escape text so that no character starts a formula.

    >>> print(literal("a$b"))
    a\\$b
    """
    return cut(value, length).replace("$", r"\$")


def number(value: float) -> str:
    """Format a number with three digits; powers of ten as a formula.

    >>> number(0.25), number(3e-9), number(0.0)
    ('0.25', '$3 \\\\times 10^{-9}$', '0')
    """
    if value == 0 or not math.isfinite(value) or 1e-3 <= abs(value) < 1e5:
        return f"{value:.3g}"
    mantissa, exponent = f"{value:.2e}".split("e")
    return rf"${float(mantissa):g} \times 10^{{{int(exponent)}}}$"


def require_suffix(path: Path) -> None:
    """Raise CpbenchError unless the file is of a kind that figures are written to."""
    if path.suffix.lower() not in SUFFIXES:
        raise CpbenchError(f"{path}: unknown suffix '{path.suffix}'; figures are written as {', '.join(SUFFIXES)}")


def write(drawn: Drawing, path: Path, *, bare: bool = False, guide: bool = True) -> None:
    """Write a drawing with its title and guide around it, without `guide` its title alone, or `bare`; no dates or
    versions are in the file.

    Raises CpbenchError for an unknown suffix, FormatError when it cannot be written.
    """
    import matplotlib

    require_suffix(path)
    if not bare:
        _caption(drawn, guide)
    metadata: dict[str, Any] = {
        ".png": {"Software": None},
        ".svg": {"Date": None, "Creator": None, "Title": drawn.title.replace("$", "")},
        ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    }[path.suffix.lower()]
    try:
        with matplotlib.rc_context(STYLE), warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Glyph .* missing")  # a name may use any script
            warnings.filterwarnings("error", message="constrained_layout not applied")
            drawn.figure.savefig(path, metadata=metadata)
    except UserWarning:
        path.unlink(missing_ok=True)
        raise CpbenchError("this size leaves no room for the curves beside their words: more is needed") from None
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None


def _caption(drawn: Drawing, guide: bool) -> None:
    """Make room above and below what is there; a title alone is smaller."""
    figure = drawn.figure
    width, height = figure.get_size_inches()
    size = 9.0 if guide else 7.0
    lines = wrapped(drawn.guide, _fits(figure, width - 0.2, 6.5)) if guide else []
    title = wrapped(drawn.title if guide else drawn.short or drawn.title, _fits(figure, width - 0.2, size, "bold"))
    above = _TITLE + 0.15 * (len(title) - 1) if guide else 0.08 + 0.12 * len(title)
    below = _LINE * len(lines) + 0.12 if guide else 0.0
    whole = height + above + below
    engine: Any = figure.get_layout_engine()
    if engine is not None:
        engine.set(rect=(0.0, below / whole, 1.0, height / whole))
    for axes in figure.axes if engine is None else ():
        box = axes.get_position(original=True)
        axes.set_position((box.x0, (box.y0 * height + below) / whole, box.width, box.height * height / whole))
    for text in figure.texts:
        x, y = text.get_position()
        text.set_position((x, (y * height + below) / whole))
    figure.set_size_inches(width, whole)
    left = 0.1 / width
    figure.text(
        left, 1 - (0.08 if guide else 0.04) / whole, "\n".join(title), fontsize=size, fontweight="bold", va="top"
    )
    figure.text(left, 0.06 / whole, "\n".join(lines), fontsize=6.5, color="#444444", va="bottom", linespacing=1.3)


def wrapped(text: str, fits: Callable[[str], bool]) -> list[str]:
    """Wrap text into lines that fit; a formula is never broken, a name too long for a line is.

    >>> wrapped(r"where $w z < 0$ and so on", lambda line: len(line) <= 15)
    ['where $w z < 0$', 'and so on']
    """
    lines = [""]
    whole = re.findall(r"(?:\\\$|\$(?:\\\$|[^$])*\$|[^\s$])+", text)
    for word in (piece for one in whole for piece in _pieces(one, fits)):
        longer = f"{lines[-1]} {word}" if lines[-1] else word
        if lines[-1] and not fits(longer):
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _fits(figure: Figure, width: float, size: float, weight: str = "normal") -> Callable[[str], bool]:
    """Return a test whether a line is at most `width` wide [in], as the figure will draw it."""
    from matplotlib.font_manager import FontProperties

    renderer: Any = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    font = FontProperties(size=size, weight=weight)

    def fits(line: str) -> bool:
        formula = re.search(r"(?<!\\)\$", line) is not None
        shown = line if formula else line.replace(r"\$", "$")
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Glyph .* missing")
            return renderer.get_text_width_height_descent(shown, font, formula)[0] <= width * figure.dpi

    return fits


def _pieces(word: str, fits: Callable[[str], bool]) -> list[str]:
    """Split a word without formulas into parts that fit."""
    pieces: list[str] = []
    while "$" not in word and not fits(word):
        size = max(1, next(k for k in range(len(word)) if not fits(word[: k + 1])))
        pieces.append(word[:size])
        word = word[size:]
    return [*pieces, word]


def joined(parts: Sequence[str], last: str = "and") -> str:
    """Join as `a, b and c`.

    >>> joined(["a", "b", "c"])
    'a, b and c'
    """
    return f" {last} ".join(filter(None, (", ".join(parts[:-1]), *parts[-1:])))
