"""The HTML report in a browser without a network: its profile of a selection is what `analysis` computes, it is usable
by keyboard and screen reader, its address keeps what is chosen, and nothing in a results file can become markup."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from axe_playwright_python.sync_playwright import Axe
from synthetic_results import meta, row, suite, table
from written_reports import write_html

from cpbench.analysis import histories, metrics, profiles
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import participating
from cpbench.report.page_data import KEPT, WHOLE
from cpbench.report.run import ProblemOrigin

pytestmark = pytest.mark.browser
EVIL = "<script>alert(1)</script>"
Opened = Callable[..., Any]


def results(seed: int = 3) -> pd.DataFrame:
    """A suite with sizes, counters, memory, errors around the tolerance, a sequence, warm starts and a hostile name."""
    rng = np.random.default_rng(seed)
    rows = suite(problems=40, labels=18, seed=seed)
    size = {name: int(rng.integers(2, 400)) for name in rows["problem"].unique()}
    rows["sizes"] = [json.dumps({"n": size[name]}) for name in rows["problem"]]
    counts = rng.integers(0, 300, len(rows))
    rows["counters"] = [json.dumps({"iterations": int(k)}) for k in counts]
    rows["counters"] = rows["counters"].where(rows["label"] != "daqp", "{}")
    rows["peak"] = rng.uniform(0, 2**24, len(rows))
    answered = rows["solve"].notna()
    done, wrong = rows["status"] == "solved", rows["status"] == "wrong"
    rows["error"] = np.where(done, 10.0 ** rng.uniform(-12, -6, len(rows)), rows["error"])
    rows["error"] = np.where(wrong, 10.0 ** rng.uniform(-4, 0, len(rows)), rows["error"])
    rows["convert"] = np.where(answered, rng.uniform(0, 1e-3, len(rows)), math.nan)
    in_sequence = rows["problem"].str.startswith("murty")
    rows["sequence"] = np.where(in_sequence, "fall", "")
    rows["step"] = np.where(in_sequence, rows["problem"].str[-2:].astype(int), 0)
    warm = rows[in_sequence].assign(start="previous", started="previous", key=rows["key"] + "/warm")
    warm["solve"] *= rng.uniform(0.3, 1.2, len(warm))
    hostile = [
        row(f"murty-{EVIL}", label, status, 0.01, family=f"'\"><img src=x onerror=alert(2)>{EVIL}", message=EVIL,
            parts=json.dumps({EVIL: 1.0, "slip_angle [deg]": 7.5}), counters=json.dumps({EVIL: 2, "iterations": 5}),
            flags="direction", route=EVIL, sizes=json.dumps({EVIL: 5, "n": 9}), address=f"{EVIL}.h5", sequence=EVIL)
        for label, status in ((EVIL, "solved"), ("lemke", "wrong"), (f"pgs[{EVIL}]", "solved"))
    ]  # fmt: skip
    return pd.concat([rows, warm, table(*hostile).assign(peak=2.0**22)], ignore_index=True)


def iterates(rows: pd.DataFrame, seed: int = 5) -> pd.DataFrame:
    """Histories of the solved pairs of a few solvers, with errors that go down and up again."""
    rng = np.random.default_rng(seed)
    parts: list[dict[str, Any]] = []
    for record in rows[(rows["status"] == "solved") & rows["label"].isin(["lemke", "pgs", "nsgs"])].to_dict("records"):
        count = int(rng.integers(3, 12))
        errors = 10.0 ** (-rng.uniform(0.2, 1.4, count).cumsum()) * rng.uniform(0.5, 3, count)
        for k in range(count):
            share = (k + 1) / count
            at = {"key": record["key"], "time": share * record["solve"], "iteration": k, "residual": math.nan}
            parts.append({**at, "error": float(errors[k]), "share": share})
    return pd.DataFrame(parts, columns=list(histories.COLUMNS))


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    return results()


def page_of(rows: pd.DataFrame, folder: Path) -> Path:
    sheet = {"name": EVIL, "node": EVIL, "licence": EVIL, "summary": EVIL, "citation": EVIL, "version": EVIL}
    about = meta(solvers={EVIL: sheet}, machine={EVIL: EVIL}, refused=[[EVIL, EVIL]], command=f"cpbench {EVIL}")
    origins = {str(family): ProblemOrigin(f"made by {EVIL}", EVIL) for family in rows["family"].unique()}
    return write_html(rows, about, folder, f"A {EVIL} title", iterates(rows), origins=origins)


@pytest.fixture(scope="module")
def written(rows: pd.DataFrame, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return page_of(rows, tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def few(rows: pd.DataFrame, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with all that a page has, and a tenth of the rows: axe looks at each of its elements."""
    shown = rows["problem"].isin([*sorted(rows["problem"].unique())[::8], f"murty-{EVIL}"])
    return page_of(rows[shown].reset_index(drop=True), tmp_path_factory.mktemp("few"))


CHARTS = ("profile", "scatter", "size", "errors")


def group_of(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of the page's first group."""
    clean = rows_of.normalised(rows)
    return participating(clean[clean["start"] == "cold"])


def curves(page: Any) -> dict[str, dict[float, float]]:
    """The curves of the profile on the page: τ and the fraction there, without the ends of the axis."""
    points = page.evaluate(
        """() => { const view = globalThis.page.views.profile;
            const known = Object.keys(view.getState({ data: () => true, signals: () => false }).data);
            return known.map((name) => view.data(name)).find((rows) => rows[0] && "share" in rows[0])
                .filter((row) => row.end === undefined).map(({ label, tau, share }) => [label, tau, share]); }"""
    )
    result: dict[str, dict[float, float]] = {}
    for label, tau, share in points:
        steps = result.setdefault(label, {})
        steps[tau] = max(share, steps.get(tau, 0.0))
    return result


def expected(rows: pd.DataFrame, problems: int, metric: metrics.Metric) -> dict[str, dict[float, float]]:
    values = metrics.matrix(rows, metric)
    profile = profiles.performance_profile(values, problems, metric.floor)
    return {
        c.label: dict(zip(c.ratios.tolist(), [k / c.problems for k in c.count], strict=True))
        for c in profile.curves
        if c.solved
    }


def same(found: dict[str, dict[float, float]], wanted: dict[str, dict[float, float]], rel: float = 1e-12) -> None:
    assert set(found) == set(wanted)
    for label, steps in wanted.items():
        assert sorted(found[label]) == pytest.approx(sorted(steps), rel=rel), label
        assert [found[label][tau] for tau in sorted(found[label])] == pytest.approx(
            [steps[tau] for tau in sorted(steps)]
        )


def test_draws_every_chart_offline(written: Path, opened: Opened) -> None:
    page = opened(written)
    for name in CHARTS:
        assert page.locator(f"[data-chart={name}] svg").count() == 1, name
        assert len(page.locator(f"[data-chart={name}] figcaption").inner_text()) > 60


def test_one_solver_is_not_compared_with_another(rows: pd.DataFrame, tmp_path: Path, opened: Opened) -> None:
    page = opened(page_of(rows[rows["label"] == "lemke"].reset_index(drop=True), tmp_path))
    assert page.locator("#profile-part").is_visible()
    assert not page.locator("#scatter-part").is_visible()


def test_the_profile_is_that_of_python_of_what_is_chosen(rows: pd.DataFrame, written: Path, opened: Opened) -> None:
    page, group = opened(written), group_of(rows)
    time_ = metrics.METRICS["time"]
    same(curves(page), expected(group, group["fingerprint"].nunique(), time_))
    best = max(curves(page), key=lambda label: curves(page)[label].get(1.0, 0.0))
    page.locator("summary", has_text="Solvers that are shown").click()
    page.locator("#solver-list label", has_text=best).first.locator("input").uncheck()
    rest = group[group["label"] != best]
    page.wait_for_function("!globalThis.page.state.hidden.size || location.hash.includes('without')")
    page.wait_for_timeout(500)
    same(curves(page), expected(rest, group["fingerprint"].nunique(), time_))
    page.select_option("#choices label:nth-child(3) select", "chain")
    page.wait_for_timeout(500)
    chain = rest[rest["family"] == "chain"]
    same(curves(page), expected(chain, chain["fingerprint"].nunique(), time_))
    page.select_option("#choices label:nth-child(2) select", "iterations")
    page.wait_for_timeout(500)
    counted = chain[chain["label"] != "daqp"]
    same(curves(page), expected(counted, chain["fingerprint"].nunique(), metrics.METRICS["iterations"]))


def test_an_address_shows_the_same_again(written: Path, opened: Opened, tmp_path: Path) -> None:
    page = opened(written)
    page.select_option("#choices label:nth-child(1) select", "1")
    page.wait_for_function("location.hash.includes('group=')")
    page.locator("#pair-list button.link").first.click()
    address = page.evaluate("location.hash")
    title = page.locator("#pair-title").inner_text()
    again = opened(written)
    again.evaluate("(hash) => { location.hash = hash; location.reload(); }", address)
    again.wait_for_selector("html[data-ready]", state="attached")
    assert again.locator("#pair-title").inner_text() == title
    assert again.evaluate("globalThis.page.state.group") == 1


def test_the_matrix_and_the_pair_by_keys(written: Path, opened: Opened) -> None:
    page = opened(written)
    page.locator("#matrix-place td[tabindex='0']").focus()
    first = page.evaluate("document.activeElement.dataset.row")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("document.activeElement.dataset.row") != first
    said = page.evaluate("document.activeElement.getAttribute('aria-label')").partition(": ")[0]
    page.keyboard.press("Enter")
    assert page.locator("#pair-title").inner_text() == said.replace(", ", " × ")
    assert "cpbench solve" in page.locator("dialog pre").last.inner_text()
    page.keyboard.press("Escape")
    assert not page.evaluate("document.getElementById('pair').open")


def test_pairs_are_found_by_name_and_verdict(rows: pd.DataFrame, written: Path, opened: Opened) -> None:
    page, group = opened(written), group_of(rows)
    page.fill("#find", "pgs@")
    page.select_option("#status", "wrong")
    wanted = group[group["label"].str.contains("pgs@") & (group["status"] == "wrong")]
    assert page.locator("#pair-list p").inner_text() == f"{len(wanted)} pairs."
    assert page.locator("#pair-list tbody tr").count() == len(wanted) > 0


def test_names_from_the_results_stay_text(written: Path, opened: Opened) -> None:
    page = opened(written)
    scripts = page.evaluate("document.querySelectorAll('script:not(#data)').length")
    source = written.read_text(encoding="utf-8")
    assert EVIL not in source
    assert source.count("<script") == scripts + 1
    assert page.evaluate("document.querySelectorAll('img, iframe, object, link').length") == 0
    assert EVIL in page.title()
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    for section in ("answer", "charts", "pairs", "failures", "solvers", "problems", "machine"):
        assert EVIL in page.locator(f"#{section}").inner_text(), section
    page.fill("#find", "murty-<script>")
    page.locator("#pair-list button.link").nth(1).click()
    assert page.locator("dialog").inner_text().count(EVIL) >= 5
    assert page.evaluate("document.querySelectorAll('script:not(#data)').length") == scripts


@pytest.mark.parametrize(
    ("width", "scheme"),
    [
        pytest.param(1280, "light", marks=pytest.mark.nightly),
        pytest.param(1280, "dark", marks=pytest.mark.nightly),
        (400, "light"),
    ],
)
def test_axe_finds_nothing_serious(few: Path, opened: Opened, width: int, scheme: str) -> None:
    page = opened(few, width, scheme)
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert _serious(Axe().run(page)) == []
    page.locator("#pair-list button.link").first.click()
    assert _serious(Axe().run(page)) == []


def _serious(found: Any) -> list[str]:
    wrong = [v for v in found.response["violations"] if v["impact"] in ("serious", "critical")]
    return [f"{v['id']}: {v['nodes'][0]['html'][:200]} ({len(v['nodes'])})" for v in wrong]


def large(problems: int, labels: int) -> pd.DataFrame:
    """A table of many rows, cheaply: problems × labels, every tenth pair a failure."""
    rng = np.random.default_rng(0)
    count = problems * labels
    one = table(row("p-0", "s00", "solved", 1.0))
    rows = one.loc[np.zeros(count, dtype=int)].reset_index(drop=True)
    p, s = np.repeat(np.arange(problems), labels), np.tile(np.arange(labels), problems)
    names = np.array([f"family{k % 20:02d}-{k:05d}" for k in range(problems)])
    who = np.array([f"solver-{k:02d}" for k in range(labels)])
    parts = [{"natural": v, "unit_free": v / 3, "energy": v / 7} for v in rng.uniform(size=count).round(9)]
    done = rng.uniform(size=count) > 0.1
    return rows.assign(
        problem=names[p], label=who[s], solver=who[s], fingerprint=names[p], family=[n[:8] for n in names[p]],
        key=[f"{a}/{b}" for a, b in zip(p, s, strict=True)], solve=np.exp(rng.normal(-5, 2, count)),
        status=np.where(done, "solved", "wrong"), error=np.where(done, 1e-9, 0.1),
        parts=[json.dumps(part) for part in parts],
        counters=[f'{{"iterations": {k}}}' for k in rng.integers(1, 1000, count)], message=np.where(done, "", "lied"),
        sizes=[f'{{"n": {k % 97 + 3}}}' for k in p], address=[f"problems/{n}.h5" for n in names[p]],
    )  # fmt: skip


@pytest.mark.nightly
def test_many_rows_are_small_and_open_at_once(tmp_path: Path, opened: Opened) -> None:
    rows = large(1000, 24)
    assert len(rows) > WHOLE
    written = write_html(rows, meta(), tmp_path, "very many")
    assert written.stat().st_size <= 6e6
    begun = time.perf_counter()
    page = opened(written)
    took = time.perf_counter() - begun
    assert took < 20.0, f"{took:.1f} s; alone on a machine it is below 4 s"
    facts = page.evaluate("({ whole: globalThis.page.facts.whole, kept: globalThis.page.facts.kept })")
    assert facts["whole"] is False
    assert 0 < facts["kept"] <= KEPT
    same(curves(page), expected(group_of(rows), 1000, metrics.METRICS["time"]), rel=1e-6)
