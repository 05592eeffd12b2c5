"use strict";
/* How often an answer would have come too late for a deadline. */
{
  const { h } = Dom;
  let deadline = null;

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
      const values = found.slice(0, 16).map((r) => ({
        label: context.name(r.label),
        slot: context.slots.get(r.label) ?? -1,
        v: r.share,
        low: r.low,
        high: r.high,
        told: `${r.misses} of ${times.problems.length}`,
      }));
      const spec = Charts.dots({
        values,
        scale: { domain: [0, 1] },
        axis: {
          title: ["fraction of problems", `not solved within ${Dom.seconds(deadline)}`],
          format: "%",
          tickCount: 5,
        },
        tooltip: [{ field: "told", title: "misses" }],
      });
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
