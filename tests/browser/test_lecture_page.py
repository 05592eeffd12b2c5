"""The lecture page in Chromium without a network: nothing missing, nothing too wide, nothing that axe minds."""

from __future__ import annotations

from typing import Any

import pytest
from lecture import page as lecture

pytestmark = [pytest.mark.browser, pytest.mark.nightly]  # some ten seconds a picture


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    return lecture.write(tmp_path_factory.mktemp("lecture")).as_uri()


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (1280, "dark"), (400, "light")])
def test_lecture_opens_offline(address: str, chromium: Any, width: int, scheme: str) -> None:
    import axe_playwright_python.sync_playwright as axe

    said: list[str] = []
    context = chromium.new_context(offline=True, viewport={"width": width, "height": 900}, color_scheme=scheme)
    try:
        page = context.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("requestfailed", lambda request: said.append(request.url))
        page.goto(address)
        page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        # a formula that MathML could not set has no height
        assert page.evaluate(
            "[...document.querySelectorAll('math')].every((m) => m.getBoundingClientRect().height > 4)"
        )
        found = axe.Axe().run(page).response["violations"]
        wrong = [v for v in found if v["impact"] in ("serious", "critical")]
        assert [f"{v['id']}: {v['nodes'][0]['html'][:200]}" for v in wrong] == []
    finally:
        context.close()
    assert said == []
