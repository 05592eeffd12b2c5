"""How long reports take to make and to open: 10^4 rows in a browser, 10^6 rows as a whole.

    python tests/bench/report_speed.py                          both, with results that nobody measured
    python tests/bench/report_speed.py --only small             10^4 rows only
    python tests/bench/report_speed.py --results RESULTS        of a file that is there, e.g. a built-in suite

Required are, of 10^4 rows: a page of at most 6 MB whose first figure is drawn within 2 s; of 10^6 rows: the report
within 30 s and 3 GB, a page that says that it is aggregated, and opens. Each report is made by the command itself, in a
process of its own with one thread for BLAS. `wall` is what the clock said, `cpu` what the command and its children took
of all cores, `peak` the most memory of one of them; `load` is that of the machine, `repr` what a million numbers take
to be spelled here at that moment: both tell what the seconds are worth. The browser is Debian's Chromium without a
network; each opening has a fresh profile, the median of all is judged. The last line says PASS or what is over.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from made_up_results import write

SHAPES = {"small": (100, 100), "large": (10_000, 100)}
"""Problems and labels."""
BYTES, OPENED, MADE, MEMORY = 6e6, 2.0, 30.0, 3e9
"""Required: bytes, s, s, bytes."""
PATIENCE = 120_000
"""Milliseconds to wait for a page."""
ALONE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
WATCH = """() => {
  window.seen = {};
  new MutationObserver(() => {
    const now = performance.now() / 1e3, root = document.documentElement;
    if (root.dataset.ready && !seen.ready) seen.ready = now;
    if (document.querySelector("figure .chart svg") && !seen.figure) seen.figure = now;
  }).observe(document, { subtree: true, childList: true, attributes: true, attributeFilter: ["data-ready"] });
}"""


@dataclass(frozen=True)
class Made:
    """What the command took [s, bytes], and the page it made."""

    wall: float
    cpu: float
    peak: int
    page: Path


def made(results: Path, folder: Path) -> Made:
    """`cpbench report` of a results file."""
    command = [sys.executable, "-m", "cpbench", "report", str(results), "-o", str(folder)]
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, **ALONE})
    wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Made(wall, cpu, after.ru_maxrss * 1024, folder / "report.html")


def opened(page: Path, times: int) -> list[dict[str, float]]:
    """Seconds from the start of the navigation until the data are read (`ready`) and until the first figure is drawn
    (`figure`), by the clock of the page."""
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium") or shutil.which("chromium-browser")
    found: list[dict[str, float]] = []
    with sync_playwright() as play:
        for _ in range(times):
            browser: Any = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
            tab = browser.new_context(offline=True, viewport={"width": 1280, "height": 900}).new_page()
            tab.add_init_script(f"({WATCH})()")
            tab.goto(page.resolve().as_uri())
            tab.wait_for_function("() => seen.ready && seen.figure", timeout=PATIENCE)
            found.append(tab.evaluate("() => seen"))
            browser.close()
    return found


def spelled() -> float:
    """Processor seconds for a million numbers: how fast a core is just now."""
    numbers = [k / 7 for k in range(10**6)]
    begun = time.process_time()
    list(map(repr, numbers))
    return time.process_time() - begun


def told(results: Path, folder: Path, times: int) -> dict[str, float]:
    """Make and open the report of a results file, and print what it took."""
    size = results.stat().st_size / 1e6
    print(f"\n{results.name}: {size:.0f} MB; load {os.getloadavg()[0]:.1f}, repr {spelled():.2f} s")
    report = made(results, folder)
    size = report.page.stat().st_size
    print(f"made:   wall {report.wall:.1f} s, cpu {report.cpu:.1f} s, peak {report.peak / 1e9:.2f} GB")
    print(f"folder: {sum(p.stat().st_size for p in folder.iterdir()) / 1e6:.1f} MB, page {size / 1e6:.2f} MB")
    all_ = opened(report.page, times)
    for name in ("ready", "figure"):
        print(f"{name + ':':8}median {statistics.median(one[name] for one in all_):.2f} s of", end=" ")
        print(", ".join(f"{one[name]:.2f}" for one in all_))
    print(f"load {os.getloadavg()[0]:.1f} then", flush=True)
    figure = statistics.median(one["figure"] for one in all_)
    aggregated = "too many to keep every fact" in report.page.read_text(encoding="utf-8")
    return {"wall": report.wall, "peak": report.peak, "size": size, "figure": figure, "aggregated": aggregated}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=[*SHAPES], help="One of the two sizes.")
    parser.add_argument("--results", type=Path, help="This file instead; nothing is required of it.")
    parser.add_argument("--times", type=int, default=5, help="How often a page is opened.")
    given = parser.parse_args()
    over: list[str] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if given.results is not None:
            told(given.results, folder / "report", given.times)
            return
        for size in [given.only] if given.only else SHAPES:
            results = folder / f"{size}.sqlite"
            write(results, *SHAPES[size])
            found = told(results, folder / size, given.times)
            if size == "small":
                over += [f"page of {found['size'] / 1e6:.1f} MB"] if found["size"] > BYTES else []
                over += [f"first figure after {found['figure']:.1f} s"] if found["figure"] > OPENED else []
            else:
                over += [f"report in {found['wall']:.0f} s"] if found["wall"] > MADE else []
                over += [f"report in {found['peak'] / 1e9:.1f} GB"] if found["peak"] > MEMORY else []
                over += [] if found["aggregated"] else ["the page does not say that it is aggregated"]
    print("PASS" if not over else f"over: {'; '.join(over)}", flush=True)
    sys.exit(bool(over))


if __name__ == "__main__":
    main()
