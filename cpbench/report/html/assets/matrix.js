"use strict";
/* Problems by solvers, coloured by what came of them; a cell opens its pair. Families by solvers on a page of so many
   rows that not every pair has its facts. */
{
  const { h } = Dom;
  const MOST = 12_000;
  const STEPS = {
    ...{ ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0] },
    ...{ PageDown: [10, 0], PageUp: [-10, 0], Home: [0, -Infinity], End: [0, Infinity] },
    ...{ "Ctrl+Home": [-Infinity, -Infinity], "Ctrl+End": [Infinity, Infinity] },
  };
  let onlyFailures = false;

  /* One stop of the tab key; the arrow keys go on from there. */
  function keys(table) {
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
      const cell = event.target.closest("td"),
        steps = STEPS[event.ctrlKey ? `Ctrl+${event.key}` : event.key] ?? STEPS[event.key],
        press = event.key === "Enter" || event.key === " ";
      if (!cell || !(steps || press)) return;
      event.preventDefault();
      if (press) return cell.click();
      const { rows } = table.tBodies[0],
        clamp = (k, least, most) => Math.max(least, Math.min(most, k));
      const { cells } = rows[clamp(cell.parentElement.sectionRowIndex + steps[0], 0, rows.length - 1)];
      cells[clamp(cell.cellIndex + steps[1], 1, cells.length - 1)].focus();
    });
    return table;
  }

  const cellOf = (name, attributes, text = "") =>
    h("td", { tabindex: "-1", role: "gridcell", title: name, "aria-label": name, ...attributes }, text);
  const lineOf = (name, cells) => h("tr", {}, h("th", { scope: "row", title: name }, name), cells);

  function grid(caption, corner, heads, lines) {
    const names = heads.map((text) => h("th", { scope: "col", title: text }, h("div", {}, text))),
      first = h("th", { scope: "col" }, h("span", { class: "visually-hidden" }, corner)),
      inside = [h("thead", {}, h("tr", {}, first, names)), h("tbody", {}, lines)];
    const table = h("table", { class: "matrix", role: "grid", "aria-label": caption }, ...inside);
    return h("div", { class: "scroll" }, keys(table));
  }

  /* The cell of a pair; `used` collects what the key has to explain. */
  function pairCell(context, p, s, fastest, used) {
    const { facts, columns } = context, r = context.rowAt(p, s),
      name = `${context.problem(p)}, ${context.name(s)}`;
    if (r < 0) return cellOf(`${name}: not planned`, { class: "k-blank", title: null });
    const status = context.statusOf(r), fast = fastest && status === "solved",
      kind = fast ? "fastest" : status,
      flags = facts.texts.flags[columns["detail.flags"][columns.detail[r] - 1]].split(","),
      flagged = flags.includes("direction") || flags.includes("scale");
    used.add(kind);
    if (flagged) used.add("flagged");
    const words = fast ? "solved, least cost" : status.replace("_", " "),
      attributes = { class: `k-${kind}${flagged ? " flagged" : ""}`, "data-row": r };
    return cellOf(`${name}: ${words}${flagged ? ", flagged" : ""}`, attributes, fast ? "★" : context.symbolOf(status));
  }

  function pairs(context, order) {
    const { table, ratios } = context;
    const problems = context.problems.filter(
      (p) => !onlyFailures || !order.every((s) => context.solved(context.rowAt(p, s))),
    );
    const cut = problems.slice(0, Math.max(1, Math.floor(MOST / order.length))),
      at = new Map(ratios.problems.map((p, i) => [p, i * ratios.labels.length])),
      column = new Map(ratios.labels.map((s, k) => [s, k])),
      used = new Set();
    const fastest = (p, s) => ratios.values[at.get(p) + column.get(s)] <= 1;
    const lines = cut.map((p) =>
      lineOf(context.problem(p), order.map((s) => pairCell(context, p, s, fastest(p, s), used))),
    );
    const table_ = grid("Problems by solvers", "problem", order.map(context.name), lines),
      content = h("div", {}, key(context, used), table_);
    content.addEventListener("click", (event) => {
      const cell = event.target.closest("td[data-row]");
      if (cell) Pair.open(context, Number(cell.dataset.row));
    });
    const rest = cut.length < problems.length ? "; filter to see the others" : "";
    return {
      content,
      numbers: `${cut.length} of ${Dom.counted(table.problems.length, "problem")}, ${Dom.counted(order.length, "solver")}${rest}.`,
      guide:
        "A cell is a problem and a solver, its colour and sign what was measured of the answer; empty where no route led. A click, or Enter on the cell that the arrow keys have reached, opens the pair.",
    };
  }

  function key({ facts, symbolOf }, used) {
    const names = facts.status.names.map((name) => [name, `k-${name}`, symbolOf(name), name.replace("_", " ")]);
    const all = [
      ["fastest", "k-fastest", "★", "solved, least cost"],
      ...names,
      ["flagged", "matrix-flag", "◥", "accepted with a flag (direction, scale)"],
    ].filter(([name]) => used.has(name));
    return h("ul", { class: "key" }, all.map(([, look, sign, text]) => h("li", {}, h("span", { class: `cell ${look}` }, sign), text)));
  }

  function families(context, order) {
    const { facts, table } = context, groups = new Map();
    for (const p of context.problems) {
      const family = facts.problems.family[table.problems[p]];
      groups.set(family, [...(groups.get(family) ?? []), p]);
    }
    const cell = (family, problems) => (s) => {
      const done = problems.filter((p) => context.solved(context.rowAt(p, s))).length,
        share = done / problems.length,
        style = `background: color-mix(in srgb, var(--accent) ${Math.round(35 * share)}%, transparent)`,
        onclick = () => Pair.list(context, family, s, problems);
      const name = `${family || "(none)"}, ${context.name(s)}: ${done} of ${problems.length} solved`;
      return cellOf(name, { class: "wide", style, onclick }, String(Math.round(100 * share)));
    };
    const lines = [...groups].sort(([a], [b]) => (a < b ? -1 : 1)).map(([family, problems]) =>
      lineOf(`${family || "(none)"} (${problems.length})`, order.map(cell(family, problems))),
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
      const check = Dom.check("only problems that some shown solver did not solve", (on) => {
        onlyFailures = on;
        changed();
      });
      return [(this.box = check)];
    },
    build(context) {
      const order = context.order.filter((s) => context.shown.has(s));
      if (!context.problems.length || !order.length)
        return { empty: "Nothing is left of the chosen problems and solvers: loosen the filters." };
      return context.facts.whole ? pairs(context, order) : families(context, order);
    },
  });
}
