"use strict";
/* Recorded sequences step by step. */
{
  const { h } = Dom;
  let sequence = null,
    what = "cost",
    chooser = null;
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
      const [first, last] = Charts.extent(values.map((v) => v.x)),
        alone = first < last ? 0 : 1, // one step alone stands in the middle
        ys = Charts.extent(values.map((v) => v.y)),
        [y0, y1] = [ys[0] / 1.4, ys[1] * 1.4];
      const title = what === "error" ? "judged error" : what === "iterations" ? "iterations" : context.metricName;
      const expr = what === "error" ? Charts.TINY : Charts.unitText(metric);
      const spec = Charts.lines({
        values,
        interpolate: "linear",
        x: { axis: { title: "step", tickMinStep: 1 }, scale: { domain: [first - alone, last + alone], nice: false } },
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
}
