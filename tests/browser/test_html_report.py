"""The HTML report in a browser without a network: what its filters compute is what `analysis` computes, it is usable by
keyboard and screen reader, and nothing in a results file can become markup."""

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
from synthetic_results import meta, row, suite, table

from cpbench.analysis import data_profiles, deadlines, histories, metrics, pairwise, profiles
from cpbench.analysis import table as rows_of
from cpbench.analysis.attendance import attended
from cpbench.analysis.tolerances import judged_at
from cpbench.formulations.base import Kind
from cpbench.report.html.columns import KEPT, WHOLE
from cpbench.report.html.page import write_html

pytestmark = pytest.mark.browser
EVIL = "<script>alert(1)</script>"
INEXACT = [str(kind) for kind in Kind if not kind.exact]
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
            at = {"key": record["key"], "time": share * record["solve"], "iteration": k, "told": math.nan}
            parts.append({**at, "error": float(errors[k]), "share": share})
    return pd.DataFrame(parts, columns=list(histories.COLUMNS))


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    return results()


@pytest.fixture(scope="module")
def written(rows: pd.DataFrame, tmp_path_factory: pytest.TempPathFactory) -> Path:
    sheet = {"name": EVIL, "node": EVIL, "licence": EVIL, "summary": EVIL, "citation": EVIL, "version": EVIL}
    told = {"tuned": {"method": EVIL, "problems": [], "spent": 1.0}, **sheet}
    about = meta(solvers={EVIL: told}, machine={EVIL: EVIL}, refused=[[EVIL, EVIL]], command=f"cpbench {EVIL}")
    return write_html(rows, about, tmp_path_factory.mktemp("page"), f"A {EVIL} title", iterates(rows))


def group_of(rows: pd.DataFrame, start: str = "cold") -> pd.DataFrame:
    """The rows of the page's group of that start."""
    clean = rows_of.normalised(rows)
    return attended(clean[clean["start"] == start])


def show(page: Any, start: str = "cold", **state: Any) -> None:
    """Sets filters behind the form's back: metric, tolerance, sizes, exact; families and labels (hidden) left out."""
    page.evaluate(
        """([start, set]) => {
            App.choose(App.data.facts.groups.findIndex((g) => g.start === start));
            const { state, data } = App, codes = data.facts.labels.name;
            for (const [key, value] of Object.entries(set)) {
                state[key] = key === "families" ? new Set(value)
                    : key === "hidden" ? new Set(value.map((name) => codes.indexOf(name))) : value;
            }
            state.symbol = "n";
            App.update();
        }""",
        [start, state],
    )


def curves(page: Any) -> dict[str, tuple[list[float], list[int], int]]:
    """The curves of the profile on the page: where they step, how many problems they have reached, N."""
    found = page.evaluate("() => App.context.curves.map((c) => [App.context.name(c.label), c.at, c.count, c.problems])")
    return {label: (at, count, problems) for label, at, count, problems in found}


def filtered(group: pd.DataFrame, **state: Any) -> tuple[pd.DataFrame, int]:
    """The same choice in Python: rows, and the number of problems."""
    n = group["sizes"].map(lambda text: json.loads(text).get("n", math.nan))
    keep = ~group["family"].isin(state.get("families", []))
    if state.get("low") is not None:
        keep &= n >= state["low"]
    if state.get("high") is not None:
        keep &= n <= state["high"]
    problems = group.loc[keep, "fingerprint"].nunique()
    if state.get("exact"):
        inexact = {label for label, kind in rows_of.label_kinds(group).items() if kind in INEXACT}
        keep &= ~group["label"].isin(inexact)
    keep &= ~group["label"].isin(state.get("hidden", []))
    chosen = group[keep]
    return (judged_at(chosen, state["tolerance"]) if state.get("tolerance") else chosen), problems


def expected(group: pd.DataFrame, **state: Any) -> dict[str, tuple[list[float], list[int], int]]:
    chosen, problems = filtered(group, **state)
    metric = metrics.metric(state.get("metric", "time"), group)
    profile = profiles.performance_profile(metrics.matrix(chosen, metric), problems, metric.floor)
    return {c.label: (c.ratios.tolist(), list(c.count), c.problems) for c in profile.curves}


def test_opens_offline_and_draws_every_figure(written: Path, opened: Opened) -> None:
    page = opened(written)
    for name in page.evaluate("[...Figures.boxes.keys()]"):
        page.evaluate(f"document.querySelector('[data-figure=\"{name}\"]').scrollIntoView()")
        page.wait_for_selector(
            f"[data-figure='{name}'] :is(svg.marks, table, .empty)", state="attached", timeout=20_000
        )
    drawn = page.evaluate("[...Figures.boxes].filter(([, b]) => b.chart.querySelector('svg.marks')).map(([n]) => n)")
    wanted = {"ranking", "profile", "budget", "scatter", "precision", "convergence", "scaling", "sequence"}
    wanted |= {"deadlines", "warm"}
    assert wanted <= set(drawn)
    guides = page.evaluate(
        "[...Figures.boxes.values()].filter((b) => !b.chart.querySelector('.empty')).map((b) => b.caption.textContent)"
    )
    assert min(len(guide) for guide in guides) > 60


@pytest.mark.parametrize("start", ["cold", "previous"])
def test_filters_compute_what_python_computes(rows: pd.DataFrame, written: Path, opened: Opened, start: str) -> None:
    page, group = opened(written), group_of(rows, start)
    rng = np.random.default_rng(11)
    families, labels = sorted(group["family"].unique()), sorted(group["label"].unique())
    tolerances = [None, 1e-2, 1e-4, 1e-5, 1e-7, 1e-9]
    compared = 0
    for _ in range(60 if start == "cold" else 15):
        state = {
            "metric": str(rng.choice(["time", "solve", "cpu", "memory", "iterations"])),
            "tolerance": tolerances[int(rng.integers(len(tolerances)))],
            "families": [str(f) for f in rng.choice(families, int(rng.integers(0, len(families))), replace=False)],
            "low": [None, 20, 100][int(rng.integers(3))],
            "high": [None, 300, 200][int(rng.integers(3))],
            "exact": bool(rng.integers(2)),
            "hidden": [str(s) for s in rng.choice(labels, int(rng.integers(0, len(labels))), replace=False)],
        }
        show(page, start, **state)
        wanted = expected(group, **state)
        assert curves(page) == wanted, state
        compared += sum(len(at) for at, _, _ in wanted.values())
    assert compared > (2000 if start == "cold" else 60)


def test_hiding_the_best_solver_recomputes_the_ratios(rows: pd.DataFrame, written: Path, opened: Opened) -> None:
    page, group = opened(written), group_of(rows)
    show(page)
    before = curves(page)
    best = max(before, key=lambda label: before[label][1][0] if before[label][0] and before[label][0][0] == 1 else 0)
    line = page.locator("#solver-lines label").filter(has=page.locator(f"xpath=self::*[@title='{best}']"))
    line.locator("input").uncheck()
    page.wait_for_selector("#solver-lines label.hidden-now")
    after = curves(page)
    assert best not in after
    assert after == expected(group, hidden=[best])
    moved = [label for label in after if after[label] != before[label]]
    assert moved, "somebody else is the best of the problems it led"


def test_each_control_of_the_form(rows: pd.DataFrame, written: Path, opened: Opened) -> None:
    page, group = opened(written), group_of(rows)
    show(page)

    def settled() -> dict[str, Any]:
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        return curves(page)

    page.locator("#filters input[data-key='fathi']").uncheck()
    assert settled() == expected(group, families=["fathi"])
    page.locator("#filters input[data-key='fathi']").check()
    page.select_option("#filter-metric", "iterations")
    assert settled() == expected(group, metric="iterations")
    assert "daqp" in page.locator("#figure-profile figcaption").inner_text(), "it counts no iterations, and is named"
    page.select_option("#filter-metric", "memory")
    assert settled() == expected(group, metric="memory")
    page.select_option("#filter-metric", "time")
    page.locator("#filter-tolerance").fill("3")
    assert settled() == expected(group, tolerance=1e-3)
    page.locator("#filter-tolerance").fill("0")
    page.select_option("#filter-symbol", "n")
    page.locator("#filter-low").fill("50")
    page.locator("#filter-high").fill("250")
    assert settled() == expected(group, low=50, high=250)
    page.locator("#filter-low").fill("")
    page.locator("#filter-high").fill("")
    page.locator("#filter-exact").check()
    assert settled() == expected(group, exact=True)
    page.locator("#filter-exact").uncheck()
    page.locator("[data-quick=none]").click()
    assert settled() == {}
    assert "Nothing is left" in page.locator("#figure-profile").inner_text()
    page.locator("[data-quick=all]").click()
    assert settled() == expected(group)


def test_other_statistics_are_those_of_python(rows: pd.DataFrame, written: Path, opened: Opened) -> None:
    page, group = opened(written), group_of(rows)
    state = {"families": ["chain"], "hidden": ["pgs"]}
    show(page, **state)
    chosen, problems = filtered(group, **state)
    values = metrics.matrix(chosen, metrics.METRICS["time"])
    budget = page.evaluate(
        "() => Engine.dataProfile(App.context.matrix).map((c) => [App.context.name(c.label), c.at, c.count])"
    )
    wanted = data_profiles.data_profile(values, problems).curves
    assert budget == [[c.label, c.ratios.tolist(), list(c.count)] for c in wanted]
    found = page.evaluate(
        """() => { const { matrix, metric, name } = App.context, all = [];
            matrix.labels.forEach((a, i) => matrix.labels.forEach((b, j) => {
                if (i < j) all.push({ one: name(a), other: name(b), ...Engine.record(matrix, metric.floor, i, j) });
            })); return all; }"""
    )
    assert found == pairwise.records(values, problems)[list(pairwise.RECORDS)].to_dict("records")
    told = page.evaluate(
        """() => { const { times, facts, table, name } = App.context;
            const order = times.problems.map((p) => ({ sequence: facts.problems.sequence[table.problems[p]], step: facts.problems.step[table.problems[p]] }));
            return Engine.deadlines(times, 5e-3, order).map((r) => [name(r.label), r.misses, r.longest, r.p50 === Infinity ? null : r.p50, r.low]); }"""  # noqa: E501
    )
    late = deadlines.deadlines(chosen, 5e-3)
    assert [r[:3] for r in told] == late[["label", "misses", "longest"]].to_numpy().tolist()
    assert [r[3] for r in told] == [None if math.isinf(v) else v for v in late["p50"]]
    assert [r[4] for r in told] == pytest.approx(late["low"].tolist())


def test_work_precision_is_that_of_python(rows: pd.DataFrame, written: Path, opened: Opened) -> None:
    page, group = opened(written), group_of(rows)
    show(page)
    clean = rows_of.normalised(rows)
    wanted = histories.work_precision(group, iterates(rows)[lambda h: h["key"].isin(set(clean["key"]))])
    found = page.evaluate(
        """() => { const { columns, group, table, problems, shown, name } = App.context;
            const inside = (k) => columns["path.row"][k] >= group.first && columns["path.row"][k] < group.first + group.count;
            const paths = { problem: [], label: [], seconds: [], error: [] };
            for (let k = 0; k < columns["path.row"].length; k++) { if (!inside(k)) continue;
                paths.problem.push(table.problems.indexOf(columns["path.problem"][k])); paths.label.push(table.labels.indexOf(columns["path.label"][k]));
                paths.seconds.push(columns["path.seconds"][k]); paths.error.push(columns["path.error"][k]); }
            return Engine.workPrecision(paths, new Set(problems), shown, group.tolerance)
                .map((r) => [name(r.label), r.error, r.reached, r.seconds === Infinity ? null : r.seconds]); }"""  # noqa: E501
    )
    told = [[r.label, r.error, r.reached, None if math.isinf(r.seconds) else r.seconds] for r in wanted.itertuples()]
    assert len(told) > 30
    assert sorted(found, key=str) == sorted(told, key=str)


def test_a_cell_opens_its_pair(rows: pd.DataFrame, written: Path, opened: Opened) -> None:
    page = opened(written)
    show(page)
    page.evaluate("document.getElementById('matrix').scrollIntoView()")
    page.wait_for_selector("#matrix td[data-row]")
    page.locator("#matrix td.k-wrong").first.click()
    dialog = page.locator("dialog#pair")
    text = dialog.inner_text()
    problem, label = dialog.locator("h2").inner_text().split(" × ", 1)
    there = rows[(rows["problem"] == problem) & (rows["label"] == label) & (rows["start"] == "cold")]
    assert there["status"].tolist() == ["wrong"]
    assert "cpbench solve" in text
    assert f"{problem}.h5" in text
    assert "claim" in text
    page.keyboard.press("Escape")
    assert not page.evaluate("document.getElementById('pair').open")
    page.locator("#matrix td[tabindex='0']").focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    assert page.evaluate("document.getElementById('pair').open")
    wanted = page.evaluate("document.querySelector('#matrix td[tabindex=\"0\"]').getAttribute('aria-label')")
    assert wanted.startswith(dialog.locator("h2").inner_text().split(" × ")[0])


def test_names_from_the_results_stay_text(written: Path, opened: Opened) -> None:
    page = opened(written)
    show(page)
    scripts = page.evaluate("document.querySelectorAll('script:not(#data)').length")
    source = written.read_text(encoding="utf-8")
    assert EVIL not in source
    assert source.count("<script>") == scripts
    assert page.evaluate("document.querySelectorAll('img, iframe, object, link').length") == 0
    assert EVIL in page.title()
    assert EVIL in page.locator("#solver-lines").inner_text()
    for section in ("overview", "failures", "solvers", "machine"):
        assert EVIL in page.locator(f"#{section}").inner_text(), section
    for name in page.evaluate("[...Figures.boxes.keys()]"):
        page.evaluate(f"document.querySelector('[data-figure=\"{name}\"]').scrollIntoView()")
    page.evaluate("document.querySelectorAll('figure details').forEach((d) => { d.open = true; })")
    row_at = page.evaluate(
        """() => { const { columns, facts } = App.data, label = facts.labels.name.indexOf("lemke");
            const problem = facts.problems.name.findIndex((n) => n.includes("<script>"));
            return columns.label.findIndex((l, r) => l === label && columns.problem[r] === problem); }"""
    )
    page.evaluate("(r) => Pair.open(App.context, r)", row_at)
    assert page.locator("dialog").inner_text().count(EVIL) >= 6
    assert page.evaluate("document.querySelectorAll('script:not(#data)').length") == scripts


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (1280, "dark"), (400, "light")])
def test_axe_finds_nothing_serious(written: Path, opened: Opened, width: int, scheme: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page = opened(written, width, scheme)
    show(page, families=["chain", "obstacle"], hidden=["scs", "quadprog", "ecos", "cvxopt", "osqp", "proxqp", "piqp"])
    for name in page.evaluate("[...Figures.boxes.keys()]"):
        page.evaluate(f"document.querySelector('[data-figure=\"{name}\"]').scrollIntoView()")
        page.wait_for_selector(f"[data-figure='{name}'] :is(svg.marks, table, .empty)", state="attached")
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert _serious(axe.Axe().run(page)) == []
    page.evaluate("(r) => Pair.open(App.context, r)", page.evaluate("App.context.group.first"))
    assert _serious(axe.Axe().run(page)) == []


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


def test_ten_thousand_rows_are_small_and_open_at_once(tmp_path: Path, opened: Opened) -> None:
    written = write_html(large(250, 40), meta(), tmp_path, "many")
    assert written.stat().st_size <= 6e6
    begun = time.perf_counter()
    page = opened(written)
    page.wait_for_selector("[data-figure=ranking] svg.marks")
    took = time.perf_counter() - begun
    assert took < 10.0, f"{took:.1f} s; alone on a machine it is below 2 s"
    assert page.evaluate("App.data.facts.whole")


def test_more_rows_are_aggregated_and_said_so(tmp_path: Path, opened: Opened) -> None:
    rows = large(1000, 24)
    assert len(rows) > WHOLE
    page = opened(write_html(rows, meta(), tmp_path, "very many"))
    facts = page.evaluate("({ whole: App.data.facts.whole, kept: App.data.facts.kept })")
    assert facts["whole"] is False
    assert 0 < facts["kept"] <= KEPT
    wanted = expected(group_of(rows))
    for label, (at, count, problems) in curves(page).items():
        assert problems == 1000
        assert count[-1] == wanted[label][1][-1]
        assert at[-1] == pytest.approx(wanted[label][0][-1], rel=1e-6)
    page.evaluate("document.getElementById('matrix').scrollIntoView()")
    page.wait_for_selector("#matrix table.matrix")
    assert "too many rows (24000)" in page.locator("#figure-matrix figcaption").inner_text()
    page.locator("#matrix td").first.click()
    assert "not solved" in page.locator("dialog").inner_text()
