"use strict";
/* Solvers two by two: how often each is ahead, and every problem of two of them. */
{
  const { h } = Dom;
  const MOST = 12;
  let across = null, upwards = null;

  /* Places in the matrix of the two labels that are compared. */
  const pair = ({ matrix, placeOf }) =>
    [across, upwards].map((chooser) => matrix.labels.indexOf(placeOf(chooser.value())));

  Figures.register({
    id: "pairwise",
    title: "Who is ahead of whom",
    build(context) {
      const { matrix, metric, byHeight } = context,
        order = byHeight.filter((c) => c.solved).map((c) => matrix.labels.indexOf(c.label)).slice(0, MOST);
      if (order.length < 2) return { empty: "Two solvers that solve something are needed." };
      const [a, b] = pair(context), name = (s) => context.name(matrix.labels[s]),
        n = matrix.problems.length;
      const cell = (r, c) => {
        if (r === c) return h("td", { class: "k-blank" }, "·");
        const { wins, ties, losses } = Rows.record(matrix, metric.floor, r, c),
          share = Math.round((35 * wins) / n);
        const onclick = () => {
          across.choose(name(r));
          upwards.choose(name(c));
        };
        const title = `${name(r)} ahead of ${name(c)} on ${wins}, level on ${ties}, behind on ${losses} of ${n}`,
          style = `background: color-mix(in srgb, var(--accent) ${share}%, transparent)`;
        return h("td", { class: r === a && c === b ? "chosen" : null, style, title, onclick }, String(wins));
      };
      const head = (scope) => (s) => h("th", { scope, title: name(s) }, name(s)),
        line = (r) => h("tr", {}, head("row")(r), order.map((c) => cell(r, c))),
        top = h("tr", {}, h("th", { scope: "col" }, "ahead of →"), order.map(head("col"))),
        caption = "Problems on which the solver of the row is ahead of that of the column";
      const heat = h("table", { class: "heat" }, h("caption", { class: "visually-hidden" }, caption),
        h("thead", {}, top), h("tbody", {}, order.map(line)));
      return {
        content: Dom.region("Wins of each solver over each other", heat),
        numbers: context.numbers,
        guide: `A cell counts the problems on which the solver of the row is ahead of that of the column: it costs less, or solves what the other does not. Shown are the ${order.length} solvers that solve most; a click on a cell puts the two into the figure below.`,
      };
    },
  });

  /* The problems that one of two labels solves at least, with their costs. */
  function pointsOf({ matrix, metric, facts, table, problem }, both) {
    const width = matrix.labels.length;
    const points = matrix.problems.map((p, i) => {
      const [x, y] = both.map((s) => Math.max(matrix.values[i * width + s], metric.floor ?? 0));
      return { x, y, problem: problem(p), family: facts.problems.family[table.problems[p]] };
    });
    return points.filter(({ x, y }) => x < Infinity || y < Infinity);
  }

  /* The chart: points up to `most`; where there are failures, they stand on dashed lines at `edge`. */
  function scatter(metric, name, points, [least, most], failures) {
    const low = least / 1.4, edge = most * (failures ? 2.5 : 1.4),
      ticks = Charts.logTicks(low, most * 1.2);
    const axis = (k) => Charts.log(name[k], low, failures ? most * 4 : edge, Charts.unitText(metric), ticks);
    const x = Charts.quantity("x", axis(0)), y = Charts.quantity("y", axis(1));
    const shown = points.map((p) => ({
      ...{ ...p, x: Math.min(p.x, edge), y: Math.min(p.y, edge), solved: solvers(p, name) },
      ...{ kind: Math.max(p.x, p.y) === Infinity ? "one" : "both", xText: Dom.cost(metric, p.x), yText: Dom.cost(metric, p.y) },
    }));
    const byKind = (range) => ({ field: "kind", type: "nominal", legend: null, scale: { domain: ["both", "one"], range } });
    const names = [["problem", "problem"], ["family", "family"], ["xText", name[0]], ["yText", name[1]], ["solved", "solved by"]];
    const beyond = { values: failures ? [{ v: edge, text: "not solved" }] : [] },
      v = Charts.quantity("v"),
      rule = { type: "rule", strokeDash: [3, 3], opacity: 0.4 },
      words = { type: "text", align: "left", baseline: "bottom", dx: 4, dy: -4, opacity: 0.75 },
      text = { field: "text" };
    return {
      height: 440,
      layer: [
        {
          data: { values: [low, edge].map((at) => ({ x: at, y: at })) },
          mark: { type: "line", color: "currentColor", opacity: 0.45, strokeWidth: 1 },
          encoding: { x, y },
        },
        { data: beyond, mark: rule, encoding: { x: v } },
        { data: beyond, mark: rule, encoding: { y: v } },
        { data: beyond, mark: words, encoding: { x: { value: 0 }, y: v, text } },
        { data: beyond, mark: { ...words, angle: 270 }, encoding: { x: v, y: { value: "height" }, text } },
        {
          data: { values: shown },
          mark: { type: "point", filled: true, size: 42, opacity: 0.7, clip: false },
          encoding: {
            ...{ x, y, color: byKind(["var(--accent)", "var(--warn)"]), shape: byKind(["circle", "triangle-up"]) },
            tooltip: Charts.tooltips(...names),
          },
        },
      ],
    };
  }

  const solvers = ({ x, y }, name) => (x === Infinity ? `only ${name[1]}` : y === Infinity ? `only ${name[0]}` : "both");

  Figures.register({
    id: "scatter",
    title: "Two solvers, problem by problem",
    controls(changed) {
      [across, upwards] = ["across", "upwards"].map((text) => Dom.chooser(text, changed));
      return [across.box, upwards.box];
    },
    adjust({ byHeight, name }) {
      const options = byHeight.map((c) => [name(c.label), name(c.label)]);
      across.offer(options);
      upwards.offer(options.filter(([label]) => label !== across.value()));
    },
    build(context) {
      const { matrix, metric, metricName } = context, both = pair(context);
      if (Math.min(...both) < 0) return { empty: "Two solvers with comparable costs are needed." };
      const name = both.map((s) => context.name(matrix.labels[s])),
        points = pointsOf(context, both);
      if (!points.length) return { empty: `Neither ${name[0]} nor ${name[1]} solves any of the chosen problems.` };
      const alone = (s) => points.filter((p) => p[s] === Infinity).length,
        failures = alone("x") + alone("y") > 0,
        few = Charts.sampled(points),
        range = Charts.extent(points.flatMap(({ x, y }) => [x, y]).filter((v) => v > 0 && v < Infinity));
      const { wins, ties, losses, neither } = Rows.record(matrix, metric.floor, ...both);
      const triangles = failures
        ? ` Triangles on the dashed lines were solved by one of them only (${alone("y")} by ${name[0]}, ${alone("x")} by ${name[1]}).`
        : "";
      const cost = (v) => Dom.cost(metric, v);
      return {
        spec: scatter(metric, name, few.points, range, failures),
        summary: `${name[0]} is ahead on ${wins}, ${name[1]} on ${losses}.`,
        numbers: `${name[0]} ahead on ${wins}, level on ${ties}, behind on ${losses}, neither on ${neither} of N = ${matrix.problems.length}.`,
        guide: `A point is a problem, its place the ${metricName} of the two; above the diagonal ${name[0]} is ahead.${triangles}${few.note}`,
        table: () => ({
          head: ["problem", ...name, "solved by"],
          right: [1, 2],
          rows: points.map((p) => [p.problem, cost(p.x), cost(p.y), solvers(p, name)]),
        }),
      };
    },
  });
}
