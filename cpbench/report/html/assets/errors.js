"use strict";
/* Error against time, from the iterates that were kept of recorded solves. */
{
  const { h } = Dom;
  let problem = null,
    chooser = null;
  const log = (title, low, high, expr) => ({
    scale: Charts.logScale(low, high),
    axis: { title, values: Charts.logTicks(low, high), labelExpr: expr },
  });

  /* Iterates of the group's rows, by places of problem and label. */
  function pathsOf(context) {
    const { columns, group, table } = context;
    if (!columns["path.row"]) return null;
    if (context.table.paths) return table.paths;
    const problemAt = new Map(table.problems.map((c, k) => [c, k])),
      labelAt = new Map(table.labels.map((c, k) => [c, k]));
    const found = { problem: [], label: [], seconds: [], error: [] };
    columns["path.row"].forEach((row, k) => {
      if (row < group.first || row >= group.first + group.count) return;
      found.problem.push(problemAt.get(columns["path.problem"][k]));
      found.label.push(labelAt.get(columns["path.label"][k]));
      found.seconds.push(columns["path.seconds"][k]);
      found.error.push(columns["path.error"][k]);
    });
    table.paths = found;
    return found;
  }

  const none = ({ facts, columns }) =>
    facts.iterates && !columns["path.row"]
      ? `The ${facts.iterates} iterates that were kept are too many for this page: report fewer problems.`
      : "No iterates were kept of these solves: run with --history.";

  Figures.register({
    id: "precision",
    title: "Error against time, over the problems",
    build(context) {
      const paths = pathsOf(context);
      if (!paths || !paths.error.length) return { empty: none(context) };
      const found = Engine.workPrecision(paths, new Set(context.problems), context.shown, context.group.tolerance);
      const drawn = found.filter((r) => Number.isFinite(r.seconds) && r.seconds > 0);
      if (!drawn.length) return { empty: "No error was reached on half of the chosen problems." };
      const labels = [...new Set(drawn.map((r) => r.label))],
        dashes = Figures.dashes(context, labels);
      const values = drawn.map((r) => ({
        label: context.name(r.label),
        slot: context.slots.get(r.label) ?? -1,
        dash: dashes.get(r.label),
        x: r.seconds,
        y: r.error,
      }));
      const span = (key) => Charts.extent(values.map((v) => v[key]));
      const [x0, x1] = span("x"),
        [y0, y1] = span("y");
      const spec = Charts.lines({
        values,
        x: log("time", x0 / 1.2, x1 * 1.2, Charts.SECONDS),
        y: log("judged error, on half of the problems", y0 / 1.6, y1 * 1.6, Charts.TINY),
      });
      const levels = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10];
      const told = levels.filter((e) => found.some((r) => r.error <= e));
      return {
        spec,
        labels,
        dashes,
        numbers: `N = ${Dom.counted(context.problems.length, "problem")}.`,
        guide:
          "A curve passes ε at the median, over the problems, of the times to the first kept iterate whose error, as we judge it, was at most ε; it ends where fewer than half of the problems got further. Iterates are kept at growing intervals, so that a time is an upper bound.",
        table: () => ({
          head: ["solver", ...told.map((e) => `to ${e}`)],
          right: told.map((_, k) => k + 1),
          rows: labels.map((s) => [
            context.name(s),
            ...told.map((e) => Dom.seconds(found.find((r) => r.label === s && r.error <= e * 1.0001)?.seconds ?? NaN)),
          ]),
        }),
      };
    },
  });

  Figures.register({
    id: "convergence",
    title: "Convergence on one problem",
    controls(changed) {
      chooser = h("select", {
        onchange: (e) => {
          problem = Number(e.target.value);
          changed();
        },
      });
      return h("div", { class: "controls" }, h("label", {}, h("span", {}, "problem"), chooser));
    },
    adjust(context) {
      const paths = pathsOf(context),
        there = paths
          ? [...new Set(paths.problem)].filter((p) => context.problems.includes(p)).sort((a, b) => a - b)
          : [];
      if (!there.includes(problem)) problem = there[0] ?? null;
      chooser.replaceChildren(
        ...there.map((p) =>
          h("option", { value: p, selected: p === problem }, context.facts.problems.name[context.table.problems[p]]),
        ),
      );
    },
    build(context) {
      const paths = pathsOf(context);
      if (!paths || problem === null) return { empty: none(context) };
      const values = [];
      paths.error.forEach((error, k) => {
        if (
          paths.problem[k] !== problem ||
          !context.shown.has(paths.label[k]) ||
          !(error > 0) ||
          !(paths.seconds[k] > 0)
        )
          return;
        values.push({ label: context.name(paths.label[k]), place: paths.label[k], x: paths.seconds[k], y: error });
      });
      if (!values.length) return { empty: "None of the chosen solvers kept iterates on this problem." };
      const labels = [...new Set(values.map((v) => v.place))],
        dashes = Figures.dashes(context, labels);
      for (const v of values) {
        v.slot = context.slots.get(v.place) ?? -1;
        v.dash = dashes.get(v.place);
      }
      const span = (key) => Charts.extent(values.map((v) => v[key]));
      const [x0, x1] = span("x"),
        [y0, y1] = span("y"),
        tolerance = context.state.tolerance ?? context.group.tolerance;
      const extra = [
        {
          data: { values: [{ t: tolerance }] },
          mark: { type: "rule", strokeDash: [4, 3], opacity: 0.5 },
          encoding: { y: { field: "t", type: "quantitative" } },
        },
      ];
      const spec = Charts.lines({
        values,
        extra,
        x: log("time", x0 / 1.2, x1 * 1.2, Charts.SECONDS),
        y: log("judged error", Math.min(y0, tolerance) / 2, y1 * 2, Charts.TINY),
      });
      return {
        spec,
        labels,
        dashes,
        numbers: `Dashed: the tolerance, ${Dom.number(tolerance)}.`,
        guide: "A curve shows the error, as we judge it, of the best iterate that the solver had after that time.",
        table: () => ({
          head: ["solver", "least error", "after"],
          right: [1, 2],
          rows: labels.map((s) => {
            const last = values.filter((v) => v.place === s).at(-1);
            return [context.name(s), Dom.number(last.y), Dom.seconds(last.x)];
          }),
        }),
      };
    },
  });
}
