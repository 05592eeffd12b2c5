"use strict";
/* Costs against a size of the problems, with the fitted power law of the whole group. */
{
  const { h } = Dom;
  let symbol = null,
    chooser = null;
  const symbolsOf = (context) => {
    const found = new Map();
    for (const p of context.problems) {
      for (const [key, size] of Object.entries(context.facts.problems.sizes[context.table.problems[p]])) {
        if (!(size > 0)) continue;
        const range = found.get(key) ?? [Infinity, 0];
        found.set(key, [Math.min(range[0], size), Math.max(range[1], size)]);
      }
    }
    return [...found].filter(([, [low, high]]) => high > 1.5 * low).sort(([a], [b]) => (a < b ? -1 : 1));
  };

  Figures.register({
    id: "scaling",
    title: "Cost against size",
    controls(changed) {
      chooser = h("select", {
        onchange: (e) => {
          symbol = e.target.value;
          changed();
        },
      });
      return h("div", { class: "controls" }, h("label", {}, h("span", {}, "size"), chooser));
    },
    adjust(context) {
      const there = symbolsOf(context).map(([key]) => key);
      if (!there.includes(symbol)) symbol = ["nc", "n"].find((key) => there.includes(key)) ?? there[0] ?? null;
      // nothing is said of sizes where they do not differ
      for (const part of [document.getElementById("size"), document.querySelector(".top nav a[href='#size']")])
        part.hidden = !there.length;
      chooser.replaceChildren(...there.map((key) => h("option", { value: key, selected: key === symbol }, key)));
    },
    build(context) {
      const range = symbolsOf(context).find(([key]) => key === symbol)?.[1];
      if (!range) return { empty: "The chosen problems do not differ enough in any size." };
      const { matrix, metric, table, facts } = context,
        width = matrix.labels.length,
        least = metric.floor ?? 0;
      const points = [],
        fits = context.group.growth[symbol];
      matrix.labels.forEach((s, k) => {
        const slot = context.slots.get(s);
        if (slot === undefined) return;
        matrix.problems.forEach((p, i) => {
          const y = matrix.values[i * width + k],
            x = facts.problems.sizes[table.problems[p]][symbol];
          if (y < Infinity && x > 0)
            points.push({
              label: context.name(s),
              slot,
              x,
              y: Math.max(y, least),
              problem: facts.problems.name[table.problems[p]],
              yText: Dom.cost(metric, y),
            });
        });
      });
      if (!points.length) return { empty: "None of the coloured solvers solves a chosen problem." };
      const few = Charts.sampled(points),
        ys = Charts.extent(points.map((p) => p.y).filter((y) => y > 0));
      const [x0, x1] = [range[0] / 1.15, range[1] * 1.15],
        [y0, y1] = [ys[0] / 1.5, ys[1] * 1.5];
      const of = (name) => (fits ? fits.label.indexOf(name) : -1);
      const fitted =
        metric.name === "time"
          ? [...context.slots]
              .filter(([s]) => of(context.name(s)) >= 0 && context.shown.has(s))
              .flatMap(([s, slot]) => {
                const k = of(context.name(s)),
                  label = context.name(s);
                return [fits.least[k], fits.largest[k]].map((x) => ({
                  label,
                  slot,
                  x,
                  y: Math.exp(fits.intercept[k] + fits.slope[k] * Math.log(x)),
                }));
              })
              .filter((v) => v.y > 0)
          : [];
      const x = {
        field: "x",
        type: "quantitative",
        scale: Charts.logScale(x0, x1),
        axis: { title: symbol, values: Charts.logTicks(x0, x1), labelExpr: Charts.TINY },
      };
      const y = {
        field: "y",
        type: "quantitative",
        scale: Charts.logScale(y0, y1),
        axis: { title: context.metricName, values: Charts.logTicks(y0, y1), labelExpr: Charts.unitText(metric) },
      };
      const spec = {
        height: 360,
        params: [{ name: "focus", value: "" }],
        layer: [
          {
            data: { values: fitted },
            mark: { type: "line", strokeWidth: 1.6, clip: true },
            encoding: {
              x,
              y,
              color: Charts.slotColour,
              strokeDash: Charts.slotDash,
              detail: { field: "label" },
              opacity: Charts.inFocus(0.85),
            },
          },
          {
            data: { values: few.points },
            mark: { type: "point", filled: true, size: 34 },
            encoding: {
              x,
              y,
              color: Charts.slotColour,
              shape: Charts.slotShape,
              opacity: Charts.inFocus(0.75),
              tooltip: [
                { field: "label", title: "solver" },
                { field: "problem", title: "problem" },
                { field: "x", title: symbol },
                { field: "yText", title: context.metricName },
              ],
            },
          },
        ],
      };
      const shown = (name) => context.matrix.labels.some((s) => context.name(s) === name);
      const lines = fits ? fits.label.map((name, k) => [name, k]).filter(([name]) => shown(name)) : [];
      const answer = {
        spec,
        labels: [...context.slots.keys()].filter((s) => context.shown.has(s)),
        numbers: context.numbers,
        guide: `A point is a problem that the solver solved; only coloured solvers are drawn.${fitted.length ? " Lines: the power law fitted to all problems of the group, a timeout counting as longer than the limit." : ""}${few.told}`,
      };
      if (lines.length)
        answer.table = () => ({
          head: ["solver", `exponent of ${symbol}`, "95 % interval", "solved", "stopped at the limit"],
          right: [1, 2, 3, 4],
          rows: lines.map(([name, k]) => [
            name,
            fits.slope[k].toFixed(2),
            `${fits.low[k].toFixed(2)} to ${fits.high[k].toFixed(2)}`,
            String(fits.solved[k]),
            String(fits.stopped[k]),
          ]),
        });
      return answer;
    },
  });
}
