"use strict";
/* Error against time on one problem, and recorded sequences step by step: rows and iterates as they are. */
const Paths = (() => {
  /* A chart of errors against times. */
  function errors({ values, title, extra, least = Infinity }) {
    const [x0, x1] = Charts.extent(values.map((v) => v.x)),
      [y0, y1] = Charts.extent(values.map((v) => v.y));
    const x = Charts.log("time", x0 / 1.2, x1 * 1.2, Charts.SECONDS),
      y = Charts.log(title, Math.min(y0, least) / 1.6, y1 * 1.6, Charts.TINY);
    return { spec: Charts.lines({ values, x, y, extra }) };
  }

  /* Why there are no iterates; null where there are. */
  function none({ facts, columns }) {
    if (columns["path.row"]) return null;
    const many = `The ${facts.iterates} iterates that were kept are too many for this page: report fewer problems.`;
    return facts.iterates ? many : "No iterates were kept of these solves: run with --history.";
  }

  /* Iterates of the group's rows, by places of problem and label, those of one problem together. */
  function pathsOf({ columns, group: { first, count }, table }) {
    if (table.paths) return table.paths;
    table.paths = new Map();
    columns["path.row"]?.forEach((row, k) => {
      if (row < first || row >= first + count) return;
      const [x, y] = [columns["path.seconds"][k], columns["path.error"][k]];
      const problem = table.problemAt.get(columns.problem[row]),
        place = table.labelAt.get(columns.label[row]);
      if (!table.paths.has(problem)) table.paths.set(problem, []);
      if (x > 0 && y > 0) table.paths.get(problem).push({ place, x, y });
    });
    return table.paths;
  }

  const withLooks = (context, values, dashes) =>
    values.map((v) => ({
      ...{ ...v, label: context.name(v.place) },
      ...{ slot: context.slots.get(v.place) ?? -1, dash: dashes?.get(v.place) },
    }));
  const placesOf = (values) => [...new Set(values.map((v) => v.place))];

  let problem = null;
  Figures.register({
    id: "convergence",
    title: "Convergence on one problem",
    controls: (changed) => [(problem = Dom.chooser("problem", changed)).box],
    adjust(context) {
      const there = context.problems.filter((p) => pathsOf(context).has(p));
      problem.offer(there.map((p) => [p, context.problem(p)]));
    },
    build(context) {
      const kept = problem.value() === "" ? [] : pathsOf(context).get(Number(problem.value())),
        own = kept.filter(({ place }) => context.shown.has(place));
      if (!own.length)
        return { empty: none(context) ?? "None of the chosen solvers kept iterates on a chosen problem." };
      const labels = placesOf(own), dashes = Figures.dashes(context, labels),
        tolerance = context.state.tolerance ?? context.group.tolerance;
      const rule = { type: "rule", strokeDash: [4, 3], opacity: 0.5 },
        level = { data: { values: [{ t: tolerance }] }, mark: rule, encoding: { y: Charts.quantity("t") } };
      const last = (s) => own.filter((v) => v.place === s).at(-1);
      return {
        ...errors({ values: withLooks(context, own, dashes), title: "judged error", extra: [level], least: tolerance }),
        labels,
        dashes,
        numbers: `Dashed: the tolerance, ${Dom.number(tolerance)}.`,
        guide: "A curve shows the error, as we judge it, of the best iterate that the solver had after that time.",
        table: () => ({
          head: ["solver", "least error", "after"],
          right: [1, 2],
          rows: labels.map((s) => [context.name(s), Dom.number(last(s).y), Dom.seconds(last(s).x)]),
        }),
      };
    },
  });

  let sequence = null, measure = null;
  Figures.register({
    id: "sequence",
    title: "Step by step",
    controls(changed) {
      [sequence, measure] = ["sequence", "shown"].map((text) => Dom.chooser(text, changed));
      measure.offer(["cost", "iterations", "error"].map((key) => [key, key]));
      return [sequence.box, measure.box];
    },
    adjust({ problems, table, facts }) {
      const there = new Set(problems.map((p) => facts.problems.sequence[table.problems[p]]));
      sequence.offer([...there].filter(Boolean).sort().map((key) => [key, key]));
    },
    build(context) {
      if (!sequence.value()) return { empty: "The chosen problems belong to no sequence." };
      const { facts, table, columns } = context, shown = measure.value(),
        metric = shown === "iterations" ? facts.metrics.find((m) => m.name === shown) : context.metric,
        numbers = shown === "error" ? columns.error : columns[metric?.name ?? "time"];
      const of = (name, p) => facts.problems[name][table.problems[p]],
        steps = context.problems.filter((p) => of("sequence", p) === sequence.value());
      steps.sort((a, b) => of("step", a) - of("step", b));
      const points = [...context.shown].flatMap((place) =>
        steps.flatMap((p) => {
          const row = context.rowAt(p, place);
          return context.solved(row) && numbers[row] > 0 ? [{ place, x: of("step", p), y: numbers[row] }] : [];
        }),
      );
      if (!points.length) return { empty: "None of the chosen solvers solved a step of it." };
      const values = withLooks(context, points),
        [first, last] = Charts.extent(values.map((v) => v.x)),
        alone = first < last ? 0 : 1, // one step alone stands in the middle
        [y0, y1] = Charts.extent(values.map((v) => v.y));
      const title = { error: "judged error", iterations: "iterations", cost: context.metricName }[shown],
        unit = shown === "error" ? Charts.TINY : Charts.unitText(metric),
        text = (v) => (shown === "cost" ? Dom.cost(metric, v) : Dom.number(v)),
        labels = placesOf(points);
      const line = (s) => {
        const own = points.filter((v) => v.place === s).map((v) => v.y);
        return [context.name(s), String(own.length), ...Charts.extent(own).map(text)];
      };
      return {
        spec: Charts.lines({
          values,
          interpolate: "linear",
          x: { axis: { title: "step", tickMinStep: 1 }, scale: { domain: [first - alone, last + alone], nice: false } },
          y: Charts.log(title, y0 / 1.4, y1 * 1.4, unit),
        }),
        labels,
        numbers: `${Dom.counted(steps.length, "step")}.`,
        guide:
          "A point is a step that the solver solved; steps that it did not solve have none, and the line passes over them. Each step is the same problem for all solvers.",
        table: () => ({ head: ["solver", "steps solved", "least", "largest"], right: [1, 2, 3], rows: labels.map(line) }),
      };
    },
  });

  return Object.freeze({ errors, none });
})();
