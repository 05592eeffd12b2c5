"use strict";
/* Ranking of a whole group; performance and data profiles of what is chosen. */
{
  const { h } = Dom;

  Figures.register({
    id: "ranking",
    title: "Problems solved",
    build(context) {
      const { lines, few } = context.group.ranking,
        count = lines.label.length;
      if (!count) return { empty: "No solver took part." };
      const total = context.group.problems.length,
        shown = Math.min(count, 16);
      const values = Array.from({ length: shown }, (_, k) => ({
        label: lines.label[k],
        slot: context.slotOf(lines.label[k]),
        v: lines.ran[k] > lines.lost[k] ? lines.solved[k] / (lines.ran[k] - lines.lost[k]) : 0,
        low: lines.low[k],
        high: lines.high[k],
        told: `${lines.solved[k]} of ${lines.ran[k] - lines.lost[k]}`,
      }));
      const spec = Charts.dots({
        values,
        scale: { domain: [0, 1] },
        axis: { title: "fraction solved of the problems that it ran on", format: "%", tickCount: 5 },
        tooltip: [{ field: "told", title: "solved" }],
      });
      const rows = () =>
        lines.label.map((name, k) => [
          h("span", {}, name, ...context.marksOf(name, lines.kind[k])),
          String(lines.solved[k]),
          String(lines.lost[k]),
          String(lines.stationary[k]),
          String(lines.ran[k]),
          lines.low[k] === null ? "—" : `${Dom.percent(lines.low[k])} to ${Dom.percent(lines.high[k])}`,
          Filters.INEXACT.has(lines.kind[k]) ? "see routes" : String(lines.false[k]),
          lines.ranked[k] ? String(lines.fastest[k]) : "—",
          Dom.seconds(lines.median[k]),
          Dom.number(lines.slowdown[k]),
          Dom.seconds(lines.mean[k]),
        ]);
      const bars = few ? "" : " Bar: 95 % bootstrap interval over problem families.";
      return {
        spec,
        summary: `${lines.label[0]} solves most, ${lines.solved[0]} of ${lines.ran[0] - lines.lost[0]}.`,
        numbers: `N = ${Dom.counted(total, "problem")}, nothing filtered${shown < count ? `, first ${shown} of ${count} solvers` : ""}.`,
        guide: `Dot: fraction solved of the problems that the solver was started on; problems that it cannot handle, and answers that a conversion lost, are not counted.${bars}`,
        table: () => ({
          head: [
            "solver",
            "solved",
            "lost",
            "stationary",
            "ran",
            "95 % interval",
            "false claims",
            "fastest",
            "median of solved",
            "slowdown",
            "mean",
          ],
          rows: rows(),
          right: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10],
        }),
      };
    },
  });

  const BANDED = 3; // bands that are shown at once: more of them cover each other
  let banded = false;

  /* The ends of the bands of the coloured curves, as areas; nothing is said of a filter that they were not made for. */
  function bandsOf(context, upto) {
    const { bands } = context.group;
    if (!banded || !context.whole || !bands?.labels.length) return [];
    const leaders = context.byHeight.map((c) => c.label).filter((s) => context.slots.has(s));
    return leaders.flatMap((s, place) => {
      const label = context.name(s),
        k = bands.labels.indexOf(label);
      if (k < 0) return [];
      const at = [...bands.taus, upto],
        last = bands.taus.length - 1;
      return at.map((x, j) => ({
        label,
        slot: context.slots.get(s),
        first: place < BANDED,
        x,
        low: bands.low[k][Math.min(j, last)],
        high: bands.high[k][Math.min(j, last)],
      }));
    });
  }

  /* What is said of the bands, drawn or not. */
  function bandsTold({ group: { bands }, whole, data }) {
    if (!banded) return "";
    if (!bands) return ` There are no bands: ${data.facts.rows} rows are too many for them.`;
    if (!bands.labels.length) return " There are no bands: with fewer than 5 families of problems they would say nothing.";
    if (!whole)
      return " Bands were computed for all problems and solvers of the formulation, their times and the planned tolerance: they do not hold for what is chosen now, and are not drawn.";
    const few = bands.few ? "; with so few a rough guess" : "";
    return ` Bands hold for what is chosen now, all problems and solvers, and for no other filter: 95 % at each τ by itself, ${Dom.counted(bands.families, "family", "families")} drawn again ${bands.replicates} times${few}. They are shown of the first ${BANDED} solvers in colour, of others while the pointer is on their name.`;
  }

  const nothing = "Nothing is left of the chosen problems and solvers: loosen the filters.";

  Figures.register({
    id: "profile",
    title: "Performance profile",
    adjust(context) {
      this.box.hidden = Boolean(context.group.bands && !context.group.bands.labels.length);
    },
    controls(changed) {
      const box = h("input", {
        type: "checkbox",
        id: "profile-bands",
        onchange: (e) => {
          banded = e.target.checked;
          changed();
        },
      });
      this.box = h(
        "div",
        { class: "controls below" },
        h("label", { class: "check" }, box, h("span", {}, "95 % bands over problem families")),
      );
      return this.box;
    },
    build(context) {
      const { curves, metric } = context;
      if (!curves.some((c) => c.solved)) return { empty: nothing, labels: [] };
      const upto = Math.max(2, Engine.widest(curves, 1) * 1.06),
        binary = upto <= 300;
      const values = curves
        .filter((c) => c.solved)
        .flatMap((c) =>
          Charts.corners(c, 1, upto).map(({ x, y }) => ({
            label: context.name(c.label),
            slot: context.slots.get(c.label) ?? -1,
            x,
            y,
          })),
        );
      const title = `τ: ${context.metricName} / least ${context.metricName} (failures: ∞)`;
      const axis = { title, values: binary ? Charts.powers(upto) : Charts.logTicks(1, upto), labelExpr: Charts.TINY };
      const bands = bandsOf(context, upto);
      const spec = Charts.lines({
        values,
        extra: bands.length ? [Charts.bands(bands)] : [],
        x: { scale: { ...Charts.logScale(1, upto), base: binary ? 2 : 10 }, axis },
        y: { scale: { domain: [0, 1] }, axis: { title: "fraction of problems", format: "%", tickCount: 5 } },
      });
      const order = context.byHeight;
      return {
        spec,
        labels: order.filter((c) => c.solved).map((c) => c.label),
        numbers: context.numbers,
        summary: `${context.name(order[0].label)} solves most, ${Dom.percent(Engine.height(order[0], Infinity))}.`,
        guide: `Height at τ: fraction of the problems solved within τ times the ${context.metricName} of the best solver shown (left end: it was the best; right end: solved at all).${context.floorText}${context.leftOutText}${bandsTold(context)}`,
        table: () => ({
          head: ["solver", "τ = 1", "τ = 2", "τ = 5", "τ = 10", "τ = 100", "solved", "of"],
          right: [1, 2, 3, 4, 5, 6, 7],
          rows: order.map((c) => [
            h("span", {}, context.name(c.label), ...context.marks(c.label)),
            ...[1, 2, 5, 10, 100].map((tau) => Dom.percent(Engine.height(c, tau))),
            String(c.solved),
            String(c.problems),
          ]),
        }),
      };
    },
  });

  Figures.register({
    id: "budget",
    title: "Data profile",
    build(context) {
      const { metric } = context,
        curves = Engine.dataProfile(context.matrix);
      if (!curves.some((c) => c.solved)) return { empty: nothing };
      const finite = curves
        .flatMap((c) => (c.solved ? [c.at.find((x) => x > 0) ?? NaN, c.at[c.at.length - 1]] : []))
        .filter((x) => x > 0);
      const low = Math.max(Math.min(...finite) / 1.2, metric.floor ? metric.floor / 10 : 0),
        high = Math.max(...finite, low * 2) * 1.2;
      const values = curves
        .filter((c) => c.solved)
        .flatMap((c) =>
          Charts.corners(c, low, high).map(({ x, y }) => ({
            label: context.name(c.label),
            slot: context.slots.get(c.label) ?? -1,
            x,
            y,
          })),
        );
      const spec = Charts.lines({
        values,
        x: {
          scale: Charts.logScale(low, high),
          axis: {
            title: `budget: ${context.metricName}`,
            values: Charts.logTicks(low, high),
            labelExpr: Charts.unitText(metric),
          },
        },
        y: { scale: { domain: [0, 1] }, axis: { title: "fraction of problems", format: "%", tickCount: 5 } },
      });
      const budgets = Charts.logTicks(low, high).slice(-5),
        order = [...curves].sort((a, b) => b.solved - a.solved || a.label - b.label);
      return {
        spec,
        labels: order.filter((c) => c.solved).map((c) => c.label),
        numbers: context.numbers,
        summary: `${context.name(order[0].label)} solves most.`,
        guide:
          "The height of a curve is the fraction of the problems that the solver solved within that budget; no solver is measured against another, so that a curve stays what it is whoever else is shown.",
        table: () => ({
          head: ["solver", ...budgets.map((b) => `within ${Dom.cost(metric, b)}`), "at all"],
          right: budgets.map((_, k) => k + 1).concat([budgets.length + 1]),
          rows: order.map((c) => [
            context.name(c.label),
            ...budgets.map((b) => Dom.percent(Engine.height(c, b))),
            Dom.percent(Engine.height(c, Infinity)),
          ]),
        }),
      };
    },
  });
}
