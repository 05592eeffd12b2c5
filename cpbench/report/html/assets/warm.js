"use strict";
/* What a start from the step before gains over a cold one, over the whole run. */
Figures.register({
  id: "warm",
  title: "Warm over cold",
  build(context) {
    const gains = context.facts.warm,
      at = gains.label.map((_, k) => k).filter((k) => gains.node[k] === context.group.node);
    if (!at.length) return { empty: "No pair of this formulation was run from two starts." };
    const names = new Set([...context.shown].map((s) => context.name(s)));
    const known = at
      .filter((k) => gains.common[k] !== null && names.has(gains.label[k]))
      .sort((a, b) => gains.common[a] - gains.common[b]);
    const table = () => ({
      head: [
        "solver",
        "start",
        "pairs",
        "both solved",
        "only warm",
        "only cold",
        "fell back",
        "warm over cold",
        "95 % interval",
        "over all pairs",
      ],
      right: [2, 3, 4, 5, 6, 7, 8, 9],
      rows: at.map((k) => [
        gains.label[k],
        gains.start[k],
        ...["pairs", "both", "only_warm", "only_cold", "fell_back"].map((n) => String(gains[n][k])),
        Dom.number(gains.common[k]),
        `${Dom.number(gains.common_low[k])} to ${Dom.number(gains.common_high[k])}`,
        Dom.number(gains.all[k]),
      ]),
    });
    if (!known.length) return { empty: "No pair was solved from both starts.", table };
    const values = known.slice(0, 24).map((k) => ({
      label: `${gains.label[k]} (${gains.start[k]})`,
      slot: context.slotOf(gains.label[k]),
      v: gains.common[k],
      low: gains.common_low[k] ?? gains.common[k],
      high: gains.common_high[k] ?? gains.common[k],
    }));
    const low = Math.min(0.5, ...values.map((v) => v.low)) / 1.1,
      high = Math.max(2, ...values.map((v) => v.high)) * 1.1,
      scale = Charts.logScale(low, high);
    const level = {
      data: { values: [{ v: 1 }] },
      mark: { type: "rule", opacity: 0.5 },
      encoding: { x: { field: "v", type: "quantitative", scale } },
    };
    const title = ["time of the warm solve", "over that of the cold one"];
    const spec = Charts.dots({
      values,
      scale,
      axis: { title, values: Charts.logTicks(low, high), labelExpr: Charts.TINY },
      extra: [level],
    });
    return {
      spec,
      table,
      numbers: "Nothing filtered but solvers.",
      guide:
        "A dot is the geometric mean, over the problems solved from both starts, of the time from the warm start over that from the cold one; left of 1 the warm start is ahead. Bars: 95 % over sequences or families.",
    };
  },
});
