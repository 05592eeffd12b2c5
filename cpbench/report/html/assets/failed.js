"use strict";
/* Failed here, solved there: the problems that one solver did not solve and another did. */
{
  const { h } = Dom;
  const MOST = 200;
  let chosen = "",
    chooser = null;

  /* By place of a solver: [problem, row of its own, rows of who solved it, the cheapest first]. */
  function lost(context) {
    const { table, columns, state, facts, matrix } = context,
      width = table.labels.length,
      { refused, names } = facts.status;
    const done = (r) => r >= 0 && Engine.solved(columns, r, state.tolerance, facts.status);
    const cost = columns[context.metric.name],
      found = new Map(matrix.labels.map((s) => [s, []]));
    for (const p of context.problems) {
      const rows = matrix.labels.map((s) => table.row[p * width + s]),
        solved = rows.filter(done).sort((a, b) => cost[a] - cost[b]);
      if (!solved.length) continue;
      matrix.labels.forEach((s, k) => {
        const r = rows[k];
        if (r >= 0 && !done(r) && !refused[names.indexOf(context.statusOf(r))]) found.get(s).push([p, r, solved]);
      });
    }
    return found;
  }

  Figures.register({
    id: "failed",
    title: "Failed here, solved there",
    controls(changed) {
      chooser = h("select", {
        onchange: (e) => {
          chosen = e.target.value;
          changed();
        },
      });
      return h("div", { class: "controls" }, h("label", {}, h("span", {}, "solver"), chooser));
    },
    adjust(context) {
      const count = lost(context),
        order = context.byHeight.map((c) => c.label).filter((s) => count.get(s)?.length);
      if (!order.some((s) => context.name(s) === chosen)) chosen = order.length ? context.name(order[0]) : "";
      chooser.replaceChildren(
        ...order.map((s) => {
          const name = context.name(s);
          return h("option", { value: name, selected: name === chosen }, `${name} (${count.get(s).length})`);
        }),
      );
    },
    build(context) {
      const place = [...context.table.labels.keys()].find((s) => context.name(s) === chosen),
        pairs = lost(context).get(place) ?? [];
      if (!pairs.length) return { empty: "No shown solver failed on a problem that another solved." };
      const { facts, columns } = context,
        open = (r, text) => h("button", { type: "button", class: "link", onclick: () => Pair.open(context, r) }, text);
      const rows = pairs.slice(0, MOST).map(([p, r, solved]) => [
        facts.problems.name[context.table.problems[p]],
        open(r, context.statusOf(r).replace("_", " ")),
        Dom.number(columns.error[r]),
        h(
          "span",
          {},
          open(solved[0], facts.labels.name[columns.label[solved[0]]]),
          solved.length > 1 ? ` and ${solved.length - 1} more` : "",
        ),
        Dom.cost(context.metric, columns[context.metric.name][solved[0]]),
      ]);
      return {
        content: Dom.table({
          caption: "Failed here, solved there",
          head: ["problem", "here", "error", "solved by", context.metricName],
          rows,
          right: [2, 4],
        }),
        numbers: `${Dom.counted(pairs.length, "problem")} that ${chosen} did not solve and another shown solver did${pairs.length > MOST ? `, the first ${MOST}` : ""}.`,
        guide: "Each name opens its pair: what was measured, what the solver said, and the command that runs it again.",
      };
    },
  });
}
