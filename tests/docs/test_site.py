"""The documentation is built as CI builds it; its pages load nothing from elsewhere, and their links lead somewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest

pytest.importorskip("pydata_sphinx_theme", reason="does not apply: the extra docs is not installed")
ROOT = Path(__file__).resolve().parents[2]
ELSEWHERE = re.compile(r"(https?:)?//")

from cpbench.conversions import conversions  # noqa: E402
from cpbench.formulations import formulations  # noqa: E402
from cpbench.solvers.base import solvers  # noqa: E402
from cpbench.storage import formats  # noqa: E402

pytestmark = pytest.mark.nightly  # the tutorial computes for more than a minute


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run([sys.executable, "docs/generate", folder], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    return folder / "site"


class _Page(HTMLParser):
    """Addresses that a browser fetches by itself, links that a reader may follow, and the names of places."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.links: list[str] = []
        self.names = {""}
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.names.add(given.get("id") or "")
        if tag == "a":
            self.links.append(given.get("href") or "")
        if tag in ("script", "img", "iframe", "source", "object"):
            self.addresses += [given.get("src") or given.get("data") or ""]
        if tag == "link" and given.get("rel") in ("stylesheet", "preload", "preconnect", "icon"):
            self.addresses.append(given.get("href") or "")


def test_pages_load_nothing_from_elsewhere_and_links_lead_somewhere(site: Path) -> None:
    pages = {path: _Page(path) for path in site.rglob("*.html") if path.parent.name != "_static"}
    assert len(pages) > 20
    for path, page in pages.items():
        assert not [address for address in page.addresses if ELSEWHERE.match(address)], path
        for link in (*page.addresses, *page.links):
            if not re.match(r"\w+:|//", link):
                name, _, part = unquote(link).partition("#")
                target = (path.parent / name.partition("?")[0]).resolve() if name else path
                assert target.is_file(), (path, link)
                assert target not in pages or part in pages[target].names, (path, link)


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
