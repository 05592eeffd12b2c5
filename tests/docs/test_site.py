"""The documentation is built as CI builds it, and its pages load nothing from elsewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

pytest.importorskip("mkdocs", reason="does not apply: the extra docs is not installed")
ROOT = Path(__file__).resolve().parents[2]

from cpbench.conversions import conversions  # noqa: E402
from cpbench.formulations import formulations  # noqa: E402
from cpbench.solvers.base import solvers  # noqa: E402
from cpbench.storage import formats  # noqa: E402

pytestmark = pytest.mark.nightly  # the tutorial computes for more than a minute


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    return folder


class _Loaded(HTMLParser):
    """Addresses that a browser fetches by itself; links that a reader may follow are none."""

    def __init__(self) -> None:
        super().__init__()
        self.addresses: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag in ("script", "img", "iframe", "source", "object"):
            self.addresses += [given.get("src") or given.get("data") or ""]
        if tag == "link" and given.get("rel") in ("stylesheet", "preload", "preconnect", "icon"):
            self.addresses.append(given.get("href") or "")


def test_pages_load_nothing_from_elsewhere(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 20
    for page in pages:
        loaded = _Loaded()
        loaded.feed(page.read_text(encoding="utf-8"))
        assert not [address for address in loaded.addresses if re.match(r"(https?:)?//", address)], page


def test_every_plugin_is_on_its_page(site: Path) -> None:
    for page, names in (
        ("formulations", formulations.names()),
        ("conversions", conversions.names()),
        ("solvers", solvers.names()),
        ("formats", formats.names()),
    ):
        text = (site / "reference" / f"{page}.html").read_text(encoding="utf-8")
        assert [name for name in names if name not in text] == [], page


def test_the_tutorial_is_in_it(site: Path) -> None:
    assert (site / "lecture" / "problems.h5").stat().st_size > 1000
    assert (site / "lecture" / "index.html").read_text(encoding="utf-8").count("<svg") >= 15
