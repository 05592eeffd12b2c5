"""Write the tutorial by itself: `PYTHONPATH=docs python -m lecture FOLDER`."""

from __future__ import annotations

import sys
from pathlib import Path

from lecture.page import write

if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: PYTHONPATH=docs python -m lecture FOLDER")
    print(f"tutorial: {write(Path(sys.argv[1]))}")
