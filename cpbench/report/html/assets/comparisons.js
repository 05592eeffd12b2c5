"use strict";
/* Solvers two by two: how often each is ahead, and every problem of two of them. */
const Comparisons = (() => {
  const { h } = Dom;
  const MOST = 12;
  let one = null,
    other = null,
    redraw = () => {};
  const selects = {};

  /* Places of the two labels that are compared, among those shown. */
  function pair(context) {
    const at = (code) => context.matrix.labels.findIndex((s) => context.table.labels[s] === code);
    const order = context.byHeight.map((c) => context.matrix.labels.indexOf(c.label));
    let a = at(one);
    if (a < 0) a = order[0] ?? -1;
    let b = at(other);
    if (b < 0 || b === a) b = order.find((s) => s !== a) ?? -1;
    return [a, b];
  }

  function choose(context, a, b) {
    one = context.table.labels[context.matrix.labels[a]];
    other = context.table.labels[context.matrix.labels[b]];
    redraw();
  }

  Figures.register({
    id: "pairwise",
    title: "Who is ahead of whom",
    controls(changed) {
      redraw = changed;
      return h("div");
    },
    build(context) {
      const { matrix, metric } = context;
      const order = context.byHeight
        .filter((c) => c.solved)
        .map((c) => matrix.labels.indexOf(c.label))
        .slice(0, MOST);
      if (order.length < 2) return { empty: "Two solvers that solve something are needed." };
      const [a, b] = pair(context),
        name = (s) => context.name(matrix.labels[s]),
        n = matrix.problems.length;
      const cell = (r, c) => {
        if (r === c) return h("td", { class: "k-blank" }, "·");
        const { wins, ties, losses } = Engine.record(matrix, metric.floor, r, c);
        const share = wins / n,
          chosen = r === a && c === b ? "chosen" : null;
        return h(
          "td",
          {
            class: chosen,
            style: `background: color-mix(in srgb, var(--accent) ${Math.round(35 * share)}%, transparent)`,
            title: `${name(r)} ahead of ${name(c)} on ${wins}, level on ${ties}, behind on ${losses} of ${n}`,
            onclick: () => choose(context, r, c),
          },
          String(wins),
        );
      };
      const content = h(
        "div",
        { class: "scroll", tabindex: "0", role: "region", "aria-label": "Wins of each solver over each other" },
        h(
          "table",
          { class: "heat" },
          h(
            "caption",
            { class: "visually-hidden" },
            "Problems on which the solver of the row is ahead of that of the column",
          ),
          h(
            "thead",
            {},
            h(
              "tr",
              {},
              h("th", { scope: "col" }, "ahead of →"),
              order.map((s) => h("th", { scope: "col", title: name(s) }, name(s))),
            ),
          ),
          h(
            "tbody",
            {},
            order.map((r) =>
              h(
                "tr",
                {},
                h("th", { scope: "row", title: name(r) }, name(r)),
                order.map((c) => cell(r, c)),
              ),
            ),
          ),
        ),
      );
      return {
        content,
        numbers: context.numbers,
        guide: `A cell counts the problems on which the solver of the row is ahead of that of the column: it costs less, or solves what the other does not. Shown are the ${order.length} solvers that solve most; a click on a cell puts the two into the figure below.`,
      };
    },
  });

  function controls(changed) {
    redraw = changed;
    const make = (key, text, set) => {
      selects[key] = h("select", {
        onchange: (e) => {
          set(Number(e.target.value));
          changed();
        },
      });
      return h("label", {}, h("span", {}, text), selects[key]);
    };
    return h(
      "div",
      { class: "controls" },
      make("one", "across", (v) => {
        one = v;
      }),
      make("other", "upwards", (v) => {
        other = v;
      }),
    );
  }

  function adjust(context) {
    const [a, b] = pair(context);
    const options = (chosen) =>
      context.matrix.labels.map((s, k) =>
        h("option", { value: context.table.labels[s], selected: k === chosen }, context.name(s)),
      );
    selects.one?.replaceChildren(...options(a));
    selects.other?.replaceChildren(...options(b));
  }

  Figures.register({
    id: "scatter",
    title: "Two solvers, problem by problem",
    controls,
    adjust,
    build(context) {
      const { matrix, metric, facts, table } = context;
      const [a, b] = pair(context);
      if (a < 0 || b < 0) return { empty: "Two solvers with comparable costs are needed." };
      const width = matrix.labels.length,
        name = [a, b].map((s) => context.name(matrix.labels[s]));
      const least = metric.floor ?? 0,
        points = [];
      matrix.problems.forEach((p, i) => {
        const [x, y] = [a, b].map((s) => Math.max(matrix.values[i * width + s], least));
        if (x < Infinity || y < Infinity)
          points.push({
            x,
            y,
            problem: facts.problems.name[table.problems[p]],
            family: facts.problems.family[table.problems[p]],
          });
      });
      if (!points.length) return { empty: `Neither ${name[0]} nor ${name[1]} solves any of the chosen problems.` };
      const finite = points.flatMap(({ x, y }) => [x, y]).filter((v) => v > 0 && v < Infinity);
      const [least0, most] = Charts.extent(finite),
        low = least0 / 1.4,
        alone = (s) => points.filter((p) => p[s] === Infinity).length;
      const failures = alone("x") + alone("y") > 0,
        edge = failures ? most * 2.5 : most * 1.4,
        high = failures ? most * 4 : edge;
      const beyond = failures ? [{ v: edge, text: "not solved" }] : [],
        faint = { strokeDash: [3, 3], opacity: 0.4 };
      const outcome = ({ x, y }) => (x === Infinity ? `only ${name[1]}` : y === Infinity ? `only ${name[0]}` : "both");
      const few = Charts.sampled(points),
        values = few.points.map((p) => ({
          ...p,
          x: Math.min(p.x, edge),
          y: Math.min(p.y, edge),
          kind: p.x === Infinity || p.y === Infinity ? "one" : "both",
          xText: Dom.cost(metric, p.x),
          yText: Dom.cost(metric, p.y),
          solved: outcome(p),
        }));
      const axis = (title) => ({ title, values: Charts.logTicks(low, most * 1.2), labelExpr: Charts.unitText(metric) });
      const scale = Charts.logScale(low, high);
      const record = Engine.record(matrix, metric.floor, a, b);
      const spec = {
        height: 440,
        layer: [
          {
            data: {
              values: [
                { x: low, y: low },
                { x: edge, y: edge },
              ],
            },
            mark: { type: "line", color: "currentColor", opacity: 0.45, strokeWidth: 1 },
            encoding: {
              x: { field: "x", type: "quantitative", scale },
              y: { field: "y", type: "quantitative", scale },
            },
          },
          {
            data: { values: beyond },
            mark: { type: "rule", ...faint },
            encoding: { x: { field: "v", type: "quantitative" } },
          },
          {
            data: { values: beyond },
            mark: { type: "rule", ...faint },
            encoding: { y: { field: "v", type: "quantitative" } },
          },
          {
            data: { values: beyond },
            mark: { type: "text", align: "left", baseline: "bottom", dx: 4, dy: -4, opacity: 0.75 },
            encoding: { x: { value: 0 }, y: { field: "v", type: "quantitative" }, text: { field: "text" } },
          },
          {
            data: { values: beyond },
            mark: { type: "text", angle: 270, align: "left", baseline: "bottom", dx: 4, dy: -4, opacity: 0.75 },
            encoding: { x: { field: "v", type: "quantitative" }, y: { value: "height" }, text: { field: "text" } },
          },
          {
            data: { values },
            mark: { type: "point", filled: true, size: 42, opacity: 0.7, clip: false },
            encoding: {
              x: { field: "x", type: "quantitative", scale, axis: axis(name[0]) },
              y: { field: "y", type: "quantitative", scale, axis: axis(name[1]) },
              color: {
                field: "kind",
                type: "nominal",
                legend: null,
                scale: { domain: ["both", "one"], range: ["var(--accent)", "var(--warn)"] },
              },
              shape: {
                field: "kind",
                type: "nominal",
                legend: null,
                scale: { domain: ["both", "one"], range: ["circle", "triangle-up"] },
              },
              tooltip: [
                { field: "problem", title: "problem" },
                { field: "family", title: "family" },
                { field: "xText", title: name[0] },
                { field: "yText", title: name[1] },
                { field: "solved", title: "solved by" },
              ],
            },
          },
        ],
      };
      return {
        spec,
        summary: `${name[0]} is ahead on ${record.wins}, ${name[1]} on ${record.losses}.`,
        numbers: `${name[0]} ahead on ${record.wins}, level on ${record.ties}, behind on ${record.losses}, neither on ${record.neither} of N = ${matrix.problems.length}.`,
        guide: `A point is a problem, its place the ${context.metricName} of the two; above the diagonal ${name[0]} is ahead.${failures ? ` Triangles on the dashed lines were solved by one of them only (${alone("y")} by ${name[0]}, ${alone("x")} by ${name[1]}).` : ""}${few.told}`,
        table: () => ({
          head: ["problem", name[0], name[1], "solved by"],
          right: [1, 2],
          rows: points.map((p) => [p.problem, Dom.cost(metric, p.x), Dom.cost(metric, p.y), outcome(p)]),
        }),
      };
    },
  });

  return Object.freeze({ pair });
})();
