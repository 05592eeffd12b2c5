"use strict";
/* Ranking of a whole group; performance and data profiles of what is chosen. */
{
  const { h } = Dom;

  Figures.register({
    id: "ranking",
    title: "Problems solved",
    build(context) {
      const { lines, few, families } = context.group.ranking,
        count = lines.label.length;
      if (!count) return { empty: "No solver took part." };
      const total = context.group.problems.length,
        shown = Math.min(count, 16);
      const values = Array.from({ length: shown }, (_, k) => ({
        label: lines.label[k],
        share: lines.solved[k] / total,
        low: lines.low[k],
        high: lines.high[k],
        told: `${lines.solved[k]} of ${total}`,
      }));
      const y = {
        field: "label",
        type: "nominal",
        sort: null,
        title: null,
        axis: { ticks: false, domain: false, labelPadding: 8 },
      };
      const scale = { domain: [0, 1] };
      const spec = {
        height: 21 * values.length,
        data: { values },
        layer: [
          {
            mark: { type: "rule", strokeWidth: 5, opacity: 0.28, color: "var(--accent)" },
            encoding: { y, x: { field: "low", type: "quantitative", scale }, x2: { field: "high" } },
          },
          {
            mark: { type: "point", filled: true, size: 52, color: "var(--accent)", opacity: 1 },
            encoding: {
              y,
              x: {
                field: "share",
                type: "quantitative",
                scale,
                title: "fraction of problems solved",
                axis: { format: "%", tickCount: 5 },
              },
              tooltip: [
                { field: "label", title: "solver" },
                { field: "told", title: "solved" },
              ],
            },
          },
        ],
      };
      const rows = () =>
        lines.label.map((name, k) => [
          h("span", {}, name, ...context.marksOf(name, lines.kind[k])),
          String(lines.solved[k]),
          String(lines.planned[k]),
          lines.low[k] === null ? "—" : `${Dom.percent(lines.low[k])} to ${Dom.percent(lines.high[k])}`,
          Filters.INEXACT.has(lines.kind[k]) ? "see routes" : String(lines.false[k]),
          lines.ranked[k] ? String(lines.fastest[k]) : "—",
          Dom.seconds(lines.median[k]),
          Dom.number(lines.slowdown[k]),
          Dom.seconds(lines.mean[k]),
        ]);
      const doubt = few ? ` There are only ${families} families, so that the intervals are a guess.` : "";
      return {
        spec,
        summary: `${lines.label[0]} solves most, ${lines.solved[0]} of ${total}.`,
        numbers: `N = ${Dom.counted(total, "problem")}, nothing filtered${shown < count ? `, first ${shown} of ${count} solvers` : ""}.`,
        guide: `A dot is the fraction of the problems that a solver solved, the bar its 95 % interval if other families of problems had been chosen.${doubt}`,
        table: () => ({
          head: [
            "solver",
            `solved of ${total}`,
            "planned",
            "95 % interval",
            "claimed, is not",
            "fastest",
            "median of solved",
            "slowdown",
            "mean",
          ],
          rows: rows(),
          right: [1, 2, 3, 4, 5, 6, 7, 8],
        }),
      };
    },
  });

  const nothing = "Nothing is left of the chosen problems and solvers: loosen the filters.";

  Figures.register({
    id: "profile",
    title: "Performance profile",
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
      const title = `τ: ${context.metricName} over the least of any shown solver`;
      const axis = { title, values: binary ? Charts.powers(upto) : Charts.logTicks(1, upto), labelExpr: Charts.TINY };
      const spec = Charts.lines({
        values,
        x: { scale: { ...Charts.logScale(1, upto), base: binary ? 2 : 10 }, axis },
        y: { scale: { domain: [0, 1] }, axis: { title: "fraction of problems", format: "%", tickCount: 5 } },
      });
      const order = context.byHeight;
      return {
        spec,
        labels: order.filter((c) => c.solved).map((c) => c.label),
        numbers: context.numbers,
        summary: `${context.name(order[0].label)} solves most, ${Dom.percent(Engine.height(order[0], Infinity))}.`,
        guide: `The height of a curve at τ is the fraction of the problems that the solver solved within τ times the ${context.metricName} of the best solver shown: at the left end where it was the best, at the right end what it solved at all.${context.floorText}${context.leftOutText}`,
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
