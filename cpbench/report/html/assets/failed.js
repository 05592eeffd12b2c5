"use strict";
/* Failed here, solved there: the problems that one solver did not solve and another did. */
{
  const { h } = Dom;
  const MOST = 200;
  let solver = null;

  /* By place of a solver: [problem, its row, rows that are solved, the cheapest first]. */
  function failedOf({ problems, matrix, columns, metric, facts, ...context }) {
    const cost = columns[metric.name], { refused, names } = facts.status,
      failed = new Map(matrix.labels.map((s) => [s, []]));
    for (const p of problems) {
      const rows = matrix.labels.map((s) => context.rowAt(p, s)),
        solved = rows.filter(context.solved).sort((a, b) => cost[a] - cost[b]);
      if (!solved.length) continue;
      matrix.labels.forEach((s, k) => {
        const r = rows[k];
        if (r >= 0 && !context.solved(r) && !refused[names.indexOf(context.statusOf(r))]) failed.get(s).push([p, r, solved]);
      });
    }
    return failed;
  }

  Figures.register({
    id: "failed",
    title: "Failed here, solved there",
    controls: (changed) => [(solver = Dom.chooser("solver", changed)).box],
    adjust(context) {
      const failed = failedOf(context),
        order = context.byHeight.map((c) => c.label).filter((s) => failed.get(s)?.length);
      solver.offer(order.map((s) => [context.name(s), `${context.name(s)} (${failed.get(s).length})`]));
    },
    build(context) {
      const pairs = failedOf(context).get(context.placeOf(solver.value())) ?? [];
      if (!pairs.length) return { empty: "No shown solver failed on a problem that another solved." };
      const { facts, columns, metric } = context,
        link = (r, text) => h("button", { type: "button", class: "link", onclick: () => Pair.open(context, r) }, text);
      const rows = pairs.slice(0, MOST).map(([p, r, [first, ...others]]) => [
        context.problem(p),
        link(r, context.statusOf(r).replace("_", " ")),
        Dom.number(columns.error[r]),
        h("span", {}, link(first, facts.labels.name[columns.label[first]]), others.length ? ` and ${others.length} more` : ""),
        Dom.cost(metric, columns[metric.name][first]),
      ]);
      const head = ["problem", "here", "error", "solved by", context.metricName],
        more = pairs.length > MOST ? `, the first ${MOST}` : "";
      return {
        content: Dom.table({ caption: "Failed here, solved there", head, rows, right: [2, 4] }),
        numbers: `${Dom.counted(pairs.length, "problem")} that ${solver.value()} did not solve and another shown solver did${more}.`,
        guide: "Each name opens its pair: what was measured, what the solver said, and the command that runs it again.",
      };
    },
  });
}
