"""One task over several threads, for compiled loops that do not hold the interpreter's lock."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np


def in_parts(count: int, threads: int, part: Callable[[slice], None]) -> None:
    """Call `part` with slices of `count` things that are as long as each other, one a thread."""
    threads = min(threads, count)
    if threads <= 1:
        part(slice(0, count))
        return
    bounds = np.linspace(0, count, threads + 1).astype(int).tolist()
    *others, last = [slice(*pair) for pair in pairwise(bounds)]
    with ThreadPoolExecutor(threads - 1) as pool:
        begun = [pool.submit(part, some) for some in others]
        part(last)
        for other in begun:
            other.result()
