"""The tutorial, its map of conversions, and pictures that lie elsewhere in the repository, as files of the site."""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

from page_parts import contents

from cpbench.report import canvas

ROOT = Path(__file__).resolve().parents[2]


def files() -> dict[str, bytes]:
    """Return path in the site -> content: page, problems and map of the tutorial, made now, and what reports/ has."""
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        from lecture.graph_map import graph_map
        from lecture.page import write

        with tempfile.TemporaryDirectory() as folder:
            write(Path(folder))
            made = {f"whole/lecture/{path.name}": path.read_bytes() for path in Path(folder).iterdir()}
        picture = io.BytesIO()
        with canvas.drawing():
            graph_map().savefig(picture, format="svg")
        made["reference/conversions.svg"] = picture.getvalue()
    finally:
        sys.path.remove(str(ROOT / "docs"))
    reports = {
        "assets/profile.png": "standard/profile-fc.png",
        "assets/ratios.png": "speed/ratios.png",
        "assets/motion.svg": "motion/motion.svg",
        "results/standard.md": "standard/report.md",
        "results/details.md": "standard/details.md",
        "results/answer.png": "standard/answer.png",
        "results/real/report.md": "real/report.md",
        "results/real/details.md": "real/details.md",
        "results/real/answer.png": "real/answer.png",
    }
    made |= {name: (ROOT / "reports" / path).read_bytes() for name, path in reports.items()}
    for report in ("standard", "real/report"):
        made[f"results/{report}.md"] += f"\n{contents('details')}".encode()
    return made
