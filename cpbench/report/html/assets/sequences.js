"use strict";
/* Steps of recorded sequences, and deadlines. */
{
  const { h } = Dom;
  let sequence = null,
    what = "cost",
    chooser = null,
    deadline = null;
  const codeOf = (context, p) => context.table.problems[p];
  const KINDS = [
    ["cost", "cost"],
    ["iterations", "iterations"],
    ["error", "error"],
  ];

  Figures.register({
    id: "sequence",
    title: "Step by step",
    controls(changed) {
      chooser = h("select", {
        onchange: (e) => {
          sequence = e.target.value;
          changed();
        },
      });
      return h(
        "div",
        { class: "controls" },
        h("label", {}, h("span", {}, "sequence"), chooser),
        h(
          "label",
          {},
          h("span", {}, "shown"),
          h(
            "select",
            {
              onchange: (e) => {
                what = e.target.value;
                changed();
              },
            },
            KINDS.map(([key, text]) => h("option", { value: key }, text)),
          ),
        ),
      );
    },
    adjust(context) {
      const there = [...new Set(context.problems.map((p) => context.facts.problems.sequence[codeOf(context, p)]))]
        .filter(Boolean)
        .sort();
      if (!there.includes(sequence)) sequence = there[0] ?? null;
      chooser.replaceChildren(...there.map((key) => h("option", { value: key, selected: key === sequence }, key)));
    },
    build(context) {
      if (sequence === null) return { empty: "The chosen problems belong to no sequence." };
      const { facts, table, columns, state } = context,
        metric = what === "iterations" ? facts.metrics.find((m) => m.name === "iterations") : context.metric;
      const numbers = what === "error" ? columns.error : columns[metric?.name ?? "time"],
        width = table.labels.length;
      const steps = context.problems
        .filter((p) => facts.problems.sequence[codeOf(context, p)] === sequence)
        .sort((a, b) => facts.problems.step[codeOf(context, a)] - facts.problems.step[codeOf(context, b)]);
      const values = [];
      for (const s of context.shown) {
        for (const p of steps) {
          const row = table.row[p * width + s];
          if (row < 0 || !Engine.solved(columns, row, state.tolerance, facts.status) || !(numbers[row] > 0)) continue;
          values.push({
            label: context.name(s),
            place: s,
            slot: context.slots.get(s) ?? -1,
            x: facts.problems.step[codeOf(context, p)],
            y: numbers[row],
          });
        }
      }
      if (!values.length) return { empty: "None of the chosen solvers solved a step of it." };
      const ys = Charts.extent(values.map((v) => v.y)),
        [y0, y1] = [ys[0] / 1.4, ys[1] * 1.4];
      const title = what === "error" ? "judged error" : what === "iterations" ? "iterations" : context.metricName;
      const expr = what === "error" ? Charts.TINY : Charts.unitText(metric);
      const spec = Charts.lines({
        values,
        interpolate: "linear",
        x: { axis: { title: "step", tickMinStep: 1 }, scale: { zero: false, nice: false } },
        y: { scale: Charts.logScale(y0, y1), axis: { title, values: Charts.logTicks(y0, y1), labelExpr: expr } },
      });
      const labels = [...new Set(values.map((v) => v.place))];
      return {
        spec,
        labels,
        numbers: Dom.counted(steps.length, "step") + ".",
        guide:
          "A point is a step that the solver solved; steps that it did not solve have none, and the line passes over them. Each step is the same problem for all solvers.",
        table: () => ({
          head: ["solver", "steps solved", "median", "largest"],
          right: [1, 2, 3],
          rows: labels.map((s) => {
            const own = values
              .filter((v) => v.place === s)
              .map((v) => v.y)
              .sort((a, b) => a - b);
            const told = (v) => (what === "cost" ? Dom.cost(metric, v) : Dom.number(v));
            return [context.name(s), String(own.length), told(Engine.quantile(own, 0.5)), told(own.at(-1))];
          }),
        }),
      };
    },
  });

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
      const values = known
        .slice(0, 24)
        .map((k) => ({
          label: `${gains.label[k]} (${gains.start[k]})`,
          v: gains.common[k],
          low: gains.common_low[k] ?? gains.common[k],
          high: gains.common_high[k] ?? gains.common[k],
        }));
      const low = Math.min(0.5, ...values.map((v) => v.low)) / 1.1,
        high = Math.max(2, ...values.map((v) => v.high)) * 1.1,
        scale = Charts.logScale(low, high);
      const y = {
        field: "label",
        type: "nominal",
        sort: null,
        title: null,
        axis: { ticks: false, domain: false, labelPadding: 8 },
      };
      const spec = {
        height: 21 * values.length,
        layer: [
          {
            data: { values: [{ v: 1 }] },
            mark: { type: "rule", opacity: 0.5 },
            encoding: { x: { field: "v", type: "quantitative", scale } },
          },
          {
            data: { values },
            mark: { type: "rule", strokeWidth: 5, opacity: 0.28, color: "var(--accent)" },
            encoding: { y, x: { field: "low", type: "quantitative", scale }, x2: { field: "high" } },
          },
          {
            data: { values },
            mark: { type: "point", filled: true, size: 52, opacity: 1, color: "var(--accent)" },
            encoding: {
              y,
              x: {
                field: "v",
                type: "quantitative",
                scale,
                axis: {
                  title: "time of the warm solve over the cold one",
                  values: Charts.logTicks(low, high),
                  labelExpr: Charts.TINY,
                },
              },
            },
          },
        ],
      };
      return {
        spec,
        table,
        numbers: "Nothing filtered but solvers.",
        guide:
          "A dot is the geometric mean, over the problems solved from both starts, of the time from the warm start over that from the cold one; left of 1 the warm start is ahead. Bars: 95 % over sequences or families.",
      };
    },
  });

  Figures.register({
    id: "deadlines",
    title: "Deadlines",
    controls(changed) {
      const told = h("output", { class: "value" }, "");
      const input = h("input", {
        type: "range",
        min: -5,
        max: 2,
        step: 0.1,
        id: "deadline",
        "aria-label": "deadline",
        oninput: (e) => {
          deadline = 10 ** Number(e.target.value);
          changed();
        },
      });
      this.show = (value) => {
        input.value = String(Math.log10(value));
        told.textContent = Dom.seconds(value);
        input.setAttribute("aria-valuetext", told.textContent);
      };
      return h("div", { class: "controls" }, h("label", {}, h("span", {}, "deadline ", told), input));
    },
    adjust(context) {
      if (deadline === null) {
        const all = context.times.values.filter(Number.isFinite).sort();
        deadline = all.length ? 10 ** (Math.round(10 * Math.log10(Engine.quantile(all, 0.5))) / 10) : 1e-2;
      }
      this.show(deadline);
    },
    build(context) {
      const { facts, table, times } = context;
      if (!times.labels.length || !times.problems.length) return { empty: "No times are left to compare." };
      const order = times.problems.map((p) => ({
        sequence: facts.problems.sequence[table.problems[p]],
        step: facts.problems.step[table.problems[p]] ?? 0,
      }));
      const found = Engine.deadlines(times, deadline, order).sort((a, b) => a.misses - b.misses || a.label - b.label);
      const values = found
        .slice(0, 16)
        .map((r) => ({
          label: context.name(r.label),
          share: r.share,
          low: r.low,
          high: r.high,
          told: `${r.misses} of ${times.problems.length}`,
        }));
      const y = {
          field: "label",
          type: "nominal",
          sort: null,
          title: null,
          axis: { ticks: false, domain: false, labelPadding: 8 },
        },
        scale = { domain: [0, 1] };
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
                axis: {
                  title: `fraction of problems not solved within ${Dom.seconds(deadline)}`,
                  format: "%",
                  tickCount: 5,
                },
              },
              tooltip: [
                { field: "label", title: "solver" },
                { field: "told", title: "misses" },
              ],
            },
          },
        ],
      };
      return {
        spec,
        numbers: `N = ${Dom.counted(times.problems.length, "problem")}${found.length > 16 ? `, first 16 of ${found.length} solvers` : ""}.`,
        guide:
          "A dot is the fraction of the problems that were not solved within the deadline, conversion included; the bar is Wilson's 95 % interval, which takes problems for independent.",
        table: () => ({
          head: ["solver", "misses", "share", "longest run of misses", "p50", "p95", "p99", "largest"],
          right: [1, 2, 3, 4, 5, 6, 7],
          rows: found.map((r) => [
            context.name(r.label),
            String(r.misses),
            Dom.percent(r.share),
            String(r.longest),
            ...[r.p50, r.p95, r.p99, r.max].map(Dom.seconds),
          ]),
        }),
      };
    },
  });
}
