"use strict";
/* Problems by solvers, coloured by what came of them; a cell opens its pair. Families by solvers on a page of so many
   rows that not every pair has its facts. */
const Matrix = (() => {
  const { h } = Dom;
  const MOST = 12_000;
  let onlyFailures = false;

  /* One stop of the tab key; the arrow keys go on from there. */
  function keys(table) {
    const cells = () => [...table.tBodies[0].rows].map((row) => [...row.cells].slice(1));
    const stop = (cell) => {
      const before = table.querySelector("td[tabindex='0']");
      if (before) before.tabIndex = -1;
      if (cell) cell.tabIndex = 0;
    };
    stop(table.querySelector("td"));
    table.addEventListener("focusin", (event) => {
      if (event.target.closest("td")) stop(event.target.closest("td")); // a click moves it, too
    });
    table.addEventListener("keydown", (event) => {
      const cell = event.target.closest("td");
      if (!cell) return;
      const steps = {
        ArrowRight: [0, 1],
        ArrowLeft: [0, -1],
        ArrowDown: [1, 0],
        ArrowUp: [-1, 0],
        PageDown: [10, 0],
        PageUp: [-10, 0],
        Home: [event.ctrlKey ? -1e6 : 0, -1e6],
        End: [event.ctrlKey ? 1e6 : 0, 1e6],
      };
      if (event.key === "Enter" || event.key === " ") {
        event.preventDefault();
        cell.click();
        return;
      }
      if (!steps[event.key]) return;
      event.preventDefault();
      const all = cells(),
        clamp = (k, most) => Math.max(0, Math.min(most, k));
      const r = clamp(cell.parentElement.sectionRowIndex + steps[event.key][0], all.length - 1);
      const c = clamp(cell.cellIndex - 1 + steps[event.key][1], all[r].length - 1);
      all[r][c].focus();
    });
    return table;
  }

  function grid(caption, corner, heads, lines) {
    return h(
      "div",
      { class: "scroll" },
      keys(
        h(
          "table",
          { class: "matrix", role: "grid", "aria-label": caption },
          h(
            "thead",
            {},
            h(
              "tr",
              {},
              h("th", { scope: "col" }, h("span", { class: "visually-hidden" }, corner)),
              heads.map((text) => h("th", { scope: "col", title: text }, h("div", {}, text))),
            ),
          ),
          h("tbody", {}, lines),
        ),
      ),
    );
  }

  function pairs(context) {
    const { facts, table, columns, state } = context,
      width = table.labels.length;
    const order = context.order.filter((s) => context.shown.has(s)),
      flagged = facts.texts.flags.map((f) => f.split(",").some((x) => x === "direction" || x === "scale"));
    let problems = context.problems;
    const solvedIn = (p, s) => {
      const r = table.row[p * width + s];
      return r >= 0 && Engine.solved(columns, r, state.tolerance, facts.status);
    };
    if (onlyFailures) problems = problems.filter((p) => !order.every((s) => solvedIn(p, s)));
    const cut = problems.slice(0, Math.max(1, Math.floor(MOST / Math.max(1, order.length))));
    const best = new Map(),
      ratio = context.ratios;
    ratio.problems.forEach((p, i) =>
      ratio.labels.forEach((s, k) => {
        if (ratio.values[i * ratio.labels.length + k] <= 1) best.set(p * width + s, true);
      }),
    );
    const used = new Set(),
      lines = cut.map((p) => {
        const name = facts.problems.name[table.problems[p]];
        return h(
          "tr",
          {},
          h("th", { scope: "row", title: name }, name),
          order.map((s) => {
            const r = table.row[p * width + s];
            if (r < 0)
              return h("td", {
                class: "k-blank",
                tabindex: "-1",
                role: "gridcell",
                "aria-label": `${name}, ${context.name(s)}: not planned`,
              });
            const status = context.statusOf(r),
              fast = best.has(p * width + s) && status === "solved",
              kind = fast ? "fastest" : status;
            used.add(kind);
            const mark = flagged[columns["detail.flags"][columns.detail[r] - 1]],
              told = `${name}, ${context.name(s)}: ${fast ? "solved, least cost" : status.replace("_", " ")}${mark ? ", flagged" : ""}`;
            if (mark) used.add("flagged");
            return h(
              "td",
              {
                class: `k-${kind}${mark ? " flagged" : ""}`,
                tabindex: "-1",
                role: "gridcell",
                "data-row": r,
                title: told,
                "aria-label": told,
              },
              fast ? "★" : context.symbolOf(status),
            );
          }),
        );
      });
    const content = h(
      "div",
      {},
      key(context, used),
      grid("Problems by solvers", "problem", order.map(context.name), lines),
    );
    content.addEventListener("click", (event) => {
      const cell = event.target.closest("td[data-row]");
      if (cell) Pair.open(context, Number(cell.dataset.row));
    });
    return {
      content,
      numbers: `${cut.length} of ${Dom.counted(table.problems.length, "problem")}, ${Dom.counted(order.length, "solver")}${cut.length < problems.length ? "; filter to see the others" : ""}.`,
      guide:
        "A cell is a problem and a solver, its colour and sign what was measured of the answer; empty where no route led. A click, or Enter on the cell that the arrow keys have reached, opens the pair.",
    };
  }

  const key = (context, used) =>
    h(
      "ul",
      { class: "key" },
      used.has("fastest") ? h("li", {}, h("span", { class: "cell k-fastest" }, "★"), "solved, least cost") : null,
      context.facts.status.names
        .filter((name) => used.has(name))
        .map((name) =>
          h("li", {}, h("span", { class: `cell k-${name}` }, context.symbolOf(name)), name.replace("_", " ")),
        ),
      used.has("flagged")
        ? h("li", {}, h("span", { class: "cell matrix-flag" }, "◥"), "accepted with a flag (direction, scale)")
        : null,
    );

  function families(context) {
    const { facts, table, columns, state } = context,
      width = table.labels.length;
    const order = context.order.filter((s) => context.shown.has(s)),
      groups = new Map();
    for (const p of context.problems) {
      const family = facts.problems.family[table.problems[p]];
      if (!groups.has(family)) groups.set(family, []);
      groups.get(family).push(p);
    }
    const lines = [...groups]
      .sort(([a], [b]) => (a < b ? -1 : 1))
      .map(([family, problems]) =>
        h(
          "tr",
          {},
          h("th", { scope: "row", title: family || "(none)" }, `${family || "(none)"} (${problems.length})`),
          order.map((s) => {
            let done = 0;
            for (const p of problems) {
              const r = table.row[p * width + s];
              if (r >= 0 && Engine.solved(columns, r, state.tolerance, facts.status)) done++;
            }
            const share = done / problems.length,
              told = `${family || "(none)"}, ${context.name(s)}: ${done} of ${problems.length} solved`;
            const cell = h(
              "td",
              {
                class: "wide",
                tabindex: "-1",
                role: "gridcell",
                title: told,
                "aria-label": told,
                style: `background: color-mix(in srgb, var(--accent) ${Math.round(35 * share)}%, transparent)`,
              },
              String(Math.round(100 * share)),
            );
            cell.addEventListener("click", () => Pair.list(context, family, s, problems));
            return cell;
          }),
        ),
      );
    return {
      content: grid("Families by solvers", "family", order.map(context.name), lines),
      numbers: context.numbers,
      guide: `There are too many rows (${facts.rows}) to show every pair: a cell is the percentage of the problems of a family that the solver solved. A click lists its failures, of which ${facts.kept} in all have their facts on this page; the others are in the results file.`,
    };
  }

  Figures.register({
    id: "matrix",
    title: "Problems by solvers",
    adjust(context) {
      this.box.hidden = !context.facts.whole;
    },
    controls(changed) {
      this.box = h(
        "div",
        { class: "controls" },
        h(
          "label",
          { class: "check" },
          h("input", {
            type: "checkbox",
            onchange: (e) => {
              onlyFailures = e.target.checked;
              changed();
            },
          }),
          h("span", {}, "only problems that some shown solver did not solve"),
        ),
      );
      return this.box;
    },
    build: (context) =>
      context.problems.length && context.shown.size
        ? context.facts.whole
          ? pairs(context)
          : families(context)
        : { empty: "Nothing is left of the chosen problems and solvers: loosen the filters." },
  });

  return Object.freeze({ keys });
})();
