"""The HTML report in a browser without a network: what it counts of a selection is what `analysis` computes, it is
usable by keyboard and screen reader, and nothing in a results file can become markup."""

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

from cpbench.analysis import bands as around
from cpbench.analysis import bootstrap, data_profiles, histories, metrics, pairwise, profiles
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import participating
from cpbench.analysis.tolerances import judged_at
from cpbench.formulations.base import Kind
from cpbench.report.html.columns import KEPT, WHOLE
from cpbench.report.run import ProblemOrigin

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
            at = {"key": record["key"], "time": share * record["solve"], "iteration": k, "residual": math.nan}
            parts.append({**at, "error": float(errors[k]), "share": share})
    return pd.DataFrame(parts, columns=list(histories.COLUMNS))


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    return results()


@pytest.fixture(scope="module")
def written(rows: pd.DataFrame, tmp_path_factory: pytest.TempPathFactory) -> Path:
    sheet = {"name": EVIL, "node": EVIL, "licence": EVIL, "summary": EVIL, "citation": EVIL, "version": EVIL}
    about = meta(solvers={EVIL: sheet}, machine={EVIL: EVIL}, refused=[[EVIL, EVIL]], command=f"cpbench {EVIL}")
    origins = {str(family): ProblemOrigin(f"made by {EVIL}", EVIL) for family in rows["family"].unique()}
    folder = tmp_path_factory.mktemp("page")
    return write_html(rows, about, folder, f"A {EVIL} title", iterates(rows), origins=origins)


def group_of(rows: pd.DataFrame, start: str = "cold") -> pd.DataFrame:
    """The rows of the page's group of that start."""
    clean = rows_of.normalised(rows)
    return participating(clean[clean["start"] == start])


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
    wanted |= {"warm"}
    assert wanted <= set(drawn)
    guides = page.evaluate(
        "[...Figures.boxes.values()].filter((b) => !b.chart.querySelector('.empty')).map((b) => b.caption.textContent)"
    )
    assert min(len(guide) for guide in guides) > 60


def test_the_page_judges_at_another_tolerance_as_python_does(tmp_path: Path, opened: Opened) -> None:
    """Rows of every error, target, promise and claim have the same statuses on the page."""
    rng = np.random.default_rng(7)
    made: list[dict[str, Any]] = []
    for k in range(300):
        error, there = 10.0 ** rng.uniform(-9, 0, 2)
        told = {
            "claim": str(rng.choice(["solved", "inaccurate", "max_iter"])), "kind": str(rng.choice(list(Kind))),
            "error": error, "target_error": there if k % 3 else math.nan,
            "target_tolerance": float(rng.choice([1e-6, 1e-8])), "flags": "stationary" if k % 7 == 0 else "",
        }  # fmt: skip
        made.append({**row(f"x-{k:03}", "pgs", "failed", 1.0), **told, "status": "timeout" if k % 11 == 0 else "wrong"})
    rows = rows_of.normalised(pd.DataFrame(made))
    rows = judged_at(rows, float(rows["tolerance"].iloc[0]))
    page = opened(write_html(rows, meta(), tmp_path, "judged"))
    seen: set[str] = set()
    for tolerance in (1e-8, 1e-6, 1e-4, 1e-2):
        show(page, tolerance=tolerance)
        found = page.evaluate("Array.from(App.data.columns.status, (_, r) => App.context.statusOf(r))")
        expected = judged_at(rows, tolerance)["status"].tolist()
        assert found == expected, tolerance
        seen |= set(expected)
    assert seen == {
        "solved", "stationary", "approximate", "lost", "inaccurate", "wrong", "failed", "max_iter", "timeout",
    }  # fmt: skip


@pytest.mark.nightly
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
    assert moved, "another solver is the best of the problems it led"


@pytest.mark.nightly
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
    page.select_option("#filter-tolerance", "0.001")
    assert settled() == expected(group, tolerance=1e-3)
    page.select_option("#filter-tolerance", "")
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


def test_counts_are_those_of_python(rows: pd.DataFrame, written: Path, opened: Opened) -> None:
    """Data profiles and pairwise wins of a selection."""
    page, group = opened(written), group_of(rows)
    state = {"families": ["chain"], "hidden": ["pgs"]}
    show(page, **state)
    chosen, problems = filtered(group, **state)
    values = metrics.matrix(chosen, metrics.METRICS["time"])
    budget = page.evaluate(
        "() => Rows.curves(App.context.matrix).map((c) => [App.context.name(c.label), c.at, c.count])"
    )
    wanted = data_profiles.data_profile(values, problems).curves
    assert budget == [[c.label, c.ratios.tolist(), list(c.count)] for c in wanted]
    found = page.evaluate(
        """() => { const { matrix, metric, name } = App.context, all = [];
            matrix.labels.forEach((a, i) => matrix.labels.forEach((b, j) => {
                if (i < j) all.push({ one: name(a), other: name(b), ...Rows.record(matrix, metric.floor, i, j) });
            })); return all; }"""
    )
    assert found == pairwise.records(values, problems)[list(pairwise.RECORDS)].to_dict("records")


CELLS = """(id) => [...document.querySelectorAll(`#figure-${id} details tbody tr`)].map((line) =>
    [...line.cells].map((at) => { while (at.firstChild) at = at.firstChild; return at.textContent; }))"""
"""The first texts of the cells of a table, without the marks behind the name of a solver."""


def test_prepared_statistics_are_shown_of_the_chosen_solvers(rows: pd.DataFrame, written: Path, opened: Opened) -> None:
    """Statistics of all problems are those of Python, whatever is filtered; the solvers are those that are chosen."""
    page, group = opened(written), group_of(rows)
    show(page, families=["chain"], hidden=["pgs"])
    for figure in ("precision", "ranking"):
        drawn(page, figure)
        page.locator(f"#figure-{figure} details > summary").click()
        assert "computed by cpbench of all of them" in page.locator(f"#figure-{figure} figcaption").inner_text()
    shown = set(page.evaluate("[...App.context.shown].map(App.context.name)"))
    assert "pgs" not in shown
    reached = histories.work_precision(group, iterates(rows)).query("label in @shown")
    wanted = reached[np.isfinite(reached["seconds"])]
    assert len(wanted) > 20
    points = page.evaluate(POINTS, "precision")
    assert [point[:2] for point in points] == wanted[["label", "error"]].to_numpy().tolist()
    assert [point[2] for point in points] == pytest.approx(wanted["seconds"].tolist(), rel=1e-3)
    solved = group[rows_of.solved(group)]["label"].value_counts()
    assert {label: int(count) for label, count, *_ in page.evaluate(CELLS, "ranking")} == {
        label: int(solved.get(label, 0)) for label in shown
    }


@pytest.mark.nightly
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


def opened_pair(page: Any, rows: pd.DataFrame, at: int) -> Any:
    """The dialog of some pair of the problem of that place by name, opened by a click on its cell."""
    name = sorted(rows["problem"].unique())[at]
    page.evaluate("document.getElementById('matrix').scrollIntoView()")
    page.wait_for_selector("#matrix td[data-row]")
    page.locator(f"#matrix td[data-row][aria-label^='{name},']").first.click()
    return page.locator("dialog#pair")


@pytest.mark.nightly
def test_a_click_on_a_cell_shows_where_its_problem_is_from(rows: pd.DataFrame, written: Path, opened: Opened) -> None:
    page = opened(written)
    show(page)
    said = opened_pair(page, rows, 0).inner_text()
    assert f"made by {EVIL}" in said
    assert "its licence" in said


@pytest.mark.nightly
def test_the_matrix_and_the_dialog_by_keys(written: Path, opened: Opened) -> None:
    page = opened(written)
    show(page)
    page.evaluate("document.getElementById('matrix').scrollIntoView()")
    page.wait_for_selector("#matrix td[data-row]")
    where = (
        "(([r, c]) => [r.sectionRowIndex, c.cellIndex])([document.activeElement.parentElement, document.activeElement])"
    )
    page.locator("#matrix td[tabindex='0']").focus()
    size = page.evaluate(
        "(([b]) => [b.rows.length, b.rows[0].cells.length])(document.querySelector('#matrix table').tBodies)"
    )
    for key, wanted in (
        ("Control+End", [size[0] - 1, size[1] - 1]), ("PageUp", [size[0] - 11, size[1] - 1]),
        ("Home", [size[0] - 11, 1]), ("Control+Home", [0, 1]), ("PageDown", [10, 1]), ("ArrowUp", [9, 1]),
    ):  # fmt: skip
        page.keyboard.press(key)
        assert page.evaluate(where) == wanted, key
        assert page.evaluate("document.querySelectorAll('#matrix td[tabindex=\"0\"]').length") == 1
        hidden = page.evaluate(
            """() => { const at = document.activeElement, box = (e) => e.getBoundingClientRect();
                return box(at.closest("table").querySelector("thead th")).bottom > box(at).top + 2
                    || box(at.parentElement.cells[0]).right > box(at).left + 2; }"""
        )
        assert not hidden, f"{key}: the cell is behind the names"
    page.keyboard.press("Enter")
    assert page.evaluate("document.getElementById('pair').open")
    assert page.evaluate("document.activeElement.closest('dialog') !== null")
    page.keyboard.press("Enter")  # on Close, where the focus is
    assert not page.evaluate("document.getElementById('pair').open")
    assert page.evaluate(where) == [9, 1], "back on the cell"
    page.locator("#matrix td[data-row]").nth(40).click()
    page.keyboard.press("Escape")
    assert page.evaluate("document.activeElement.tabIndex") == 0


SHOWN = """(id) => Object.entries(Figures.boxes.get(id).view?.getState({ data: () => true }).data ?? {})
    .filter(([name, all]) => !name.endsWith("marks") && Array.isArray(all)).flatMap(([, all]) => all)
    .filter((one) => typeof one?.label === "string" && "slot" in one)
    .map(({ label, slot, first, x, low, high }) => ({ label, slot, first, x, low, high }))"""
"""What a chart draws of labels, without the marks that it made of them."""
POINTS = """(id) => Figures.boxes.get(id).kind.build(App.context).spec.layer.flatMap(({ data }) => data.values)
    .sort((a, b) => (a.label < b.label ? -1 : a.label > b.label ? 1 : b.y - a.y))
    .map(({ label, x, y }) => [label, y, x])"""
"""The points of the curves of a chart, by label and from large errors to small ones."""


def drawn(page: Any, figure: str) -> list[dict[str, Any]]:
    """The rows of all data sets of a chart, once it is drawn."""
    page.evaluate(f"document.querySelector('[data-figure=\"{figure}\"]').scrollIntoView()")
    page.wait_for_function(f"() => (({{ dirty, view }}) => !dirty && view)(Figures.boxes.get('{figure}'))")
    return list(page.evaluate(SHOWN, figure))


@pytest.mark.nightly
def test_bands_are_those_of_python_and_hold_for_no_other_filter(
    rows: pd.DataFrame, written: Path, opened: Opened
) -> None:
    page, group = opened(written), group_of(rows)
    show(page)
    told = page.locator("#figure-profile figcaption")
    assert not [found for found in drawn(page, "profile") if found["first"] is not None]
    page.locator("#profile-bands").check()
    page.wait_for_function("() => document.querySelector('#figure-profile figcaption').innerText.includes('Bands')")
    time_ = metrics.METRICS["time"]
    compared = group[rows_of.ranked(group)]
    values = metrics.matrix(compared, time_).reindex(group["fingerprint"].unique(), fill_value=math.inf)
    made = around.profile_bands(values, bootstrap.families_of(group), floor=time_.floor or 0.0)
    assert f"and for no other filter: 95 % at each τ by itself, {made.families} families" in told.inner_text()
    ends = [found for found in drawn(page, "profile") if found["first"] is not None]
    coloured = page.evaluate("[...App.context.slots.keys()].map((s) => App.context.name(s))")
    assert {found["label"] for found in ends} == set(coloured)
    for label in coloured:
        own = [found for found in ends if found["label"] == label]
        taus = [found["x"] for found in own][:-1]
        assert taus == made.low.index.tolist()
        assert [found["low"] for found in own][:-1] == pytest.approx(made.low[label].tolist(), abs=5.1e-5)
        assert [found["high"] for found in own][:-1] == pytest.approx(made.high[label].tolist(), abs=5.1e-5)
        heights = page.evaluate(
            """([name, taus]) => { const own = App.context.curves.find((c) => App.context.name(c.label) === name);
                return taus.map((tau) => Rows.height(own, tau)); }""",
            [label, taus],
        )
        assert heights == pytest.approx(made.estimate[label].tolist()), "the band is around this curve"
    page.locator("#solver-lines input").first.uncheck()
    page.wait_for_function(
        "() => document.querySelector('#figure-profile figcaption').innerText.includes('do not hold')"
    )
    assert not [found for found in drawn(page, "profile") if found["first"] is not None]
    page.locator("#solver-lines input").first.check()
    page.wait_for_function(
        "() => document.querySelector('#figure-profile figcaption').innerText.includes('no other filter')"
    )
    assert [found for found in drawn(page, "profile") if found["first"] is not None]


@pytest.mark.nightly
def test_a_solver_has_one_colour_on_the_page(written: Path, opened: Opened) -> None:
    page = opened(written)
    show(page)
    checked: dict[str, int] = {}
    for hidden in ([], ["scs", "lemke", "pgs"]):
        show(page, hidden=hidden)
        looks = page.evaluate(
            """() => Object.fromEntries([...document.querySelectorAll("#solver-lines label")]
                .map((l) => [l.title, l.querySelector("svg line").getAttribute("stroke")]))"""
        )
        colours = page.evaluate("Charts.COLOURS")
        for figure in ("ranking", "profile", "budget", "precision", "convergence", "scaling", "sequence"):
            for found in drawn(page, figure):
                colour = colours[found["slot"]] if found["slot"] >= 0 else "var(--other)"
                assert colour == looks[found["label"]], f"{found['label']} in {figure}"
                checked[figure] = checked.get(figure, 0) + 1
            chips = page.evaluate(
                f"""[...document.querySelectorAll("#figure-{figure} .chips li:has(span)")].map((li) => [
                    li.lastChild.firstChild.textContent, li.querySelector("line").getAttribute("stroke")])"""
            )
            for name, colour in chips:
                assert looks[name] == colour, f"{name} beside {figure}"
    assert len(checked) == 8, checked


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
    assert page.locator("dialog").inner_text().count(EVIL) >= 7
    assert page.evaluate("document.querySelectorAll('script:not(#data)').length") == scripts


@pytest.mark.parametrize(
    ("width", "scheme"),
    [
        pytest.param(1280, "light", marks=pytest.mark.nightly),
        pytest.param(1280, "dark", marks=pytest.mark.nightly),
        (400, "light"),
    ],
)
def test_axe_finds_nothing_serious(written: Path, opened: Opened, width: int, scheme: str) -> None:
    page = opened(written, width, scheme)
    show(page, families=["chain", "obstacle"], hidden=["scs", "quadprog", "ecos", "cvxopt", "osqp", "proxqp", "piqp"])
    for name in page.evaluate("[...Figures.boxes.keys()]"):
        page.evaluate(f"document.querySelector('[data-figure=\"{name}\"]').scrollIntoView()")
        page.wait_for_selector(f"[data-figure='{name}'] :is(svg.marks, table, .empty)", state="attached")
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert _serious(Axe().run(page)) == []
    page.evaluate("(r) => Pair.open(App.context, r)", page.evaluate("App.context.group.first"))
    assert _serious(Axe().run(page)) == []


@pytest.mark.nightly
def test_long_names_do_not_widen_a_phone(tmp_path: Path, opened: Opened) -> None:
    """Eight groups, each with a chip that names its solver in 60 characters."""
    long = "siconos-fc3d-nsgs[max_iter=100000,omega=1.25,shuffle=true]"
    rows = [
        row(f"p-{k}", label, "solved", time, node=node, tolerance=tolerance, start=start, started=start,
            key=f"{node}{tolerance}{start}{label}{k}")
        for node in ("fc", "lcp") for tolerance in (1e-4, 1e-8) for start in ("cold", "previous") for k in range(3)
        for label, time in ((long, 0.1), ("lemke", 0.3))
    ]  # fmt: skip
    page = opened(write_html(pd.DataFrame(rows), meta(), tmp_path, "phone"), 400)
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    inside = "(b) => b.getBoundingClientRect().right <= innerWidth"
    assert page.locator(".choice").evaluate_all(f"(all) => all.length >= 8 && all.every({inside})")


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
def test_ten_thousand_rows_are_small_and_open_at_once(tmp_path: Path, opened: Opened) -> None:
    written = write_html(large(250, 40), meta(), tmp_path, "many")
    assert written.stat().st_size <= 6e6
    begun = time.perf_counter()
    page = opened(written)
    page.wait_for_selector("[data-figure=ranking] svg.marks")
    took = time.perf_counter() - begun
    assert took < 10.0, f"{took:.1f} s; alone on a machine it is below 2 s"
    assert page.evaluate("App.data.facts.whole")


@pytest.mark.nightly
def test_more_rows_are_aggregated_with_a_note(tmp_path: Path, opened: Opened) -> None:
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
