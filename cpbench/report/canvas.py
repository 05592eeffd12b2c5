"""Paper for single figures: sizes of a journal's columns, few colours that survive grey, title and guide around them.

Words are mathtext (r"$r_\\mathrm{T}$", no LaTeX is called); what comes from a file goes through :func:`literal`.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.errors import CpbenchError, FormatError
from cpbench.report.figure_kinds import Drawing
from cpbench.report.text import cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN, PAGE = 3.5, 7.0
"""Widths of one column and of two [in]."""
BLUE, RED, GREEN, GREY, FAINT, INK = "#0072B2", "#D55E00", "#009E73", "#8A8A8A", "#DCDCDC", "#1A1A1A"
"""Okabe and Ito's blue, vermilion and green; they differ in grey as well."""
STYLE: Any = {
    "svg.hashsalt": "cpbench",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "mathtext.fontset": "dejavusans",
    "mathtext.default": "it",
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.edgecolor": "#555555",
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "axes.labelcolor": INK,
    "text.color": INK,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.borderaxespad": 0.3,
    "legend.labelspacing": 0.35,
}
PLATE: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0}
"""Behind a word that stands on lines."""
SUFFIXES = (".svg", ".png", ".pdf")
NARROW = 4.5
"""Width below which a figure is for one column: legend inside, no guide [in]."""
LEAST = 1.3
"""Least width and height of a figure [in]."""
LEGEND_LINE = 0.16
"""Height of a line of a legend beside axes [in]."""


@contextmanager
def drawing(*, formulas: bool = True) -> Generator[None]:
    """Make and write a figure in the style of reports (a context); without `formulas` all text stands for itself,
    whatever dollar signs it has."""
    import matplotlib

    with matplotlib.rc_context({**STYLE, "text.parse_math": formulas}):
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
            legend_inside(axes)
        height = width if math.isnan(height) else height
    else:
        legends = filter(None, (axes.get_legend() for axes in figure.axes))
        needed = max((LEGEND_LINE * (len(one.get_texts()) + 2) for one in legends), default=0.0)
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
    from matplotlib.transforms import Bbox

    require_suffix(path)
    width, height = drawn.figure.get_size_inches()
    above, below = (0.0, 0.0) if bare else _caption(drawn, guide)
    metadata: dict[str, Any] = {
        ".png": {"Software": None},
        ".svg": {"Date": None, "Creator": None, "Title": drawn.title.replace("$", "")},
        ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
    }[path.suffix.lower()]
    try:
        with drawing(), warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Glyph .* missing")  # a name may use any script
            warnings.filterwarnings("error", message="constrained_layout not applied")
            drawn.figure.savefig(path, metadata=metadata, bbox_inches=Bbox([[0, -below], [width, height + above]]))
    except UserWarning:
        path.unlink(missing_ok=True)
        raise CpbenchError("this size leaves no room for the curves beside their words: more is needed") from None
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None


def _caption(drawn: Drawing, guide: bool) -> tuple[float, float]:
    """Put the words above and below the figure; returns the heights that they take [in]. A title alone is smaller."""
    figure = drawn.figure
    width, height = figure.get_size_inches()
    size = 9.0 if guide else 7.0
    title = wrapped(drawn.title if guide else drawn.short or drawn.title, _fits(figure, width - 0.2, size, "bold"))
    style = {"x": 0.1 / width, "fontsize": size, "fontweight": "bold", "va": "bottom"}
    figure.text(y=1 + (0.07 if guide else 0.04) / height, s="\n".join(title), **style)
    above = 0.08 + size / 60 * len(title) + (0.07 if guide else 0.0)
    if not guide:
        return above, 0.0
    lines = wrapped(drawn.guide, _fits(figure, width - 0.2, 6.5))
    style = {"x": 0.1 / width, "fontsize": 6.5, "color": "#444444", "va": "top", "linespacing": 1.3}
    figure.text(y=-0.06 / height, s="\n".join(lines), **style)
    return above, 0.125 * len(lines) + 0.12


def wrapped(text: str, fits: Callable[[str], bool]) -> list[str]:
    """Wrap text into lines that fit; a formula is never broken, a name too long for a line is.

    >>> wrapped(r"where $w z < 0$ and so on", lambda line: len(line) <= 15)
    ['where $w z < 0$', 'and so on']
    """
    lines = [""]
    for word in re.findall(r"(?:\\\$|\$(?:\\\$|[^$])*\$|[^\s$])+", text):
        longer = f"{lines[-1]} {word}" if lines[-1] else word
        if lines[-1] and not fits(longer):
            lines.append("")
            longer = word
        while "$" not in longer and not fits(longer):
            size = max(1, next(k for k in range(len(longer)) if not fits(longer[: k + 1])))
            lines[-1:] = [longer[:size], ""]
            longer = longer[size:]
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


def legend_inside(axes: Axes) -> None:
    """Put the legend beside the axes into them, where it covers least, with the curves that have a label alone."""
    outside = axes.get_legend()
    if outside is None:
        return
    title = outside.get_title().get_text().partition("  ")[0]
    outside.remove()
    if axes.get_legend_handles_labels()[0]:
        frame: Any = {"frameon": True, "framealpha": 0.85, "edgecolor": "none", "borderpad": 0.3, "labelspacing": 0.25}
        axes.legend(loc="best", title=f"({title})", fontsize=6.5, title_fontsize=6.5, handlelength=1.8, **frame)
