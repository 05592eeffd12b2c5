"use strict";
/* Costs against a size of the problems, with the power law that cpbench fitted to the whole group. */
{
  let symbol = null;
  const codes = ({ problems, table }) => problems.map((p) => table.problems[p]);
  const symbolsOf = (context) =>
    Filters.ranges(context.facts, codes(context), 0).filter(([, [low, high]]) => high > 1.5 * low);

  function pointsOf({ matrix, metric, table, facts, slots, name, problem }) {
    return matrix.labels.flatMap((s, k) => {
      const slot = slots.get(s);
      if (slot === undefined) return [];
      return matrix.problems.flatMap((p, i) => {
        const cost = matrix.values[i * matrix.labels.length + k],
          x = facts.problems.sizes[table.problems[p]][symbol.value()],
          yText = Dom.cost(metric, cost);
        if (!(cost < Infinity && x > 0)) return [];
        return [{ label: name(s), slot, x, y: Math.max(cost, metric.floor ?? 0), problem: problem(p), yText }];
      });
    });
  }

  Figures.register({
    id: "scaling",
    title: "Cost against size",
    controls: (changed) => [(symbol = Dom.chooser("size", changed)).box],
    adjust(context) {
      const there = symbolsOf(context).map(([key]) => key);
      // where sizes do not differ there is no section
      for (const part of [document.getElementById("size"), document.querySelector(".top nav a[href='#size']")])
        part.hidden = !there.length;
      symbol.offer(there.map((key) => [key, key]), ["nc", "n"].find((key) => there.includes(key)));
    },
    build(context) {
      const range = symbolsOf(context).find(([key]) => key === symbol.value())?.[1];
      if (!range) return { empty: "The chosen problems do not differ enough in any size." };
      const { metric, metricName, matrix, slots, shown } = context, points = pointsOf(context),
        laws = context.group.growth[symbol.value()] ?? { lines: [], head: [], rows: [] };
      const drawn = metric.name === "time" ? laws.lines.filter(({ label }) => context.slotOf(label) >= 0) : [],
        lines = drawn.flatMap(({ label, ends }) => ends.map(([x, y]) => ({ label, slot: context.slotOf(label), x, y })));
      if (!points.length) return { empty: "None of the coloured solvers solves a chosen problem." };
      const few = Charts.sampled(points),
        [y0, y1] = Charts.extent(points.map((p) => p.y).filter((y) => y > 0));
      const x = Charts.quantity("x", Charts.log(symbol.value(), range[0] / 1.15, range[1] * 1.15, Charts.TINY)),
        y = Charts.quantity("y", Charts.log(metricName, y0 / 1.5, y1 * 1.5, Charts.unitText(metric)));
      const shared = { x, y, color: Charts.slotColour, detail: Charts.DETAIL },
        names = [["label", "solver"], ["problem", "problem"], ["x", symbol.value()], ["yText", metricName]];
      const law = { strokeDash: Charts.slotDash, opacity: Charts.inFocus(0.85) },
        dot = { shape: Charts.slotShape, opacity: Charts.inFocus(0.75), tooltip: Charts.tooltips(...names) };
      const line = { type: "line", strokeWidth: 1.6, clip: true },
        point = { type: "point", filled: true, size: 34 };
      const layer = [
        { data: { values: lines }, mark: line, encoding: { ...shared, ...law } },
        { data: { values: few.points }, mark: point, encoding: { ...shared, ...dot } },
      ];
      const rows = laws.rows.filter(([label]) => matrix.labels.includes(context.placeOf(label)));
      const fitted = "Lines: the power law fitted by least squares to the problems of the group that each solver solved; where it was stopped at the limit on large ones, its exponent is too small.";
      return {
        spec: { height: 360, params: Charts.FOCUS, layer },
        labels: [...slots.keys()].filter((s) => shown.has(s)),
        numbers: context.numbers,
        guide: `A point is a problem that the solver solved; only coloured solvers are drawn.${lines.length ? ` ${fitted}` : ""}${few.note}`,
        ...(rows.length ? { table: () => ({ head: laws.head, right: [1, 2, 3, 4], rows }) } : {}),
      };
    },
  });
}
