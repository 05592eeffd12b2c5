"""The tutorial, its map of conversions, and pictures that lie elsewhere in the repository, as files of the site."""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

from cpbench.report import canvas

ROOT = Path(__file__).resolve().parents[2]


def files() -> dict[str, bytes]:
    """Return path in the site -> content: page, problems and map of the tutorial, made now, and pictures of races."""
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        from lecture.graph_map import graph_map
        from lecture.page import write

        with tempfile.TemporaryDirectory() as folder:
            write(Path(folder))
            made = {f"lecture/{path.name}": path.read_bytes() for path in Path(folder).iterdir()}
        picture = io.BytesIO()
        with canvas.drawing():
            graph_map().savefig(picture, format="svg")
        made["reference/conversions.svg"] = picture.getvalue()
    finally:
        sys.path.remove(str(ROOT / "docs"))
    pictures = {
        "profile.png": "contact/profile-fc-1e-06-cold-1.png",
        "ratios.png": "speed/ratios.png",
        "motion.svg": "motion/motion.svg",
    }
    return {**made, **{f"assets/{name}": (ROOT / "reports" / path).read_bytes() for name, path in pictures.items()}}
