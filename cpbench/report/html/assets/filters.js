"use strict";
/* What is chosen in the column of filters, and which problems and solvers that leaves. */
const Filters = (() => {
  const { h } = Dom;
  const NONE = { metric: "time", tolerance: null, symbol: "", low: null, high: null, exact: false };
  const initial = (group) => ({ ...NONE, group, families: new Set(), hidden: new Set() });

  /* Places of the problems of a group that are chosen. A family is left out when it is in `state.families`. */
  function problems({ problems: { family, sizes } }, table, { families, symbol, low, high }) {
    const sized = symbol && (low !== null || high !== null);
    const fits = (size) => size !== undefined && !(low !== null && size < low) && !(high !== null && size > high);
    return [...table.problems.keys()].filter((place) => {
      const code = table.problems[place];
      return !families.has(family[code]) && (!sized || fits(sizes[code][symbol]));
    });
  }

  const INEXACT = new Set(["necessary", "approximate", "relaxation"]);
  /* Places of the labels of a group that are chosen; `state.hidden` has codes. */
  const labels = (group, table, { hidden, exact }) =>
    [...table.labels.keys()].filter((s) => {
      const code = table.labels[s];
      return !hidden.has(code) && !(exact && INEXACT.has(group.kinds[code]));
    });

  /* The range of each size above `least` over problems, given by code: [symbol, [least, largest]] in order of symbol. */
  function ranges({ problems: { sizes } }, codes, least = -Infinity) {
    const all = new Map();
    for (const [symbol, size] of codes.flatMap((code) => Object.entries(sizes[code])))
      if (size > least) all.set(symbol, Charts.extent([...(all.get(symbol) ?? []), size]));
    return [...all].sort(([a], [b]) => (a < b ? -1 : 1));
  }

  const count = (values) => values.reduce((all, v) => all.set(v, (all.get(v) ?? 0) + 1), new Map());
  const ticked = (text, title, checked, set, attributes, ...more) => {
    const box = h("input", { type: "checkbox", checked, onchange: (e) => set(e.target.checked), ...attributes });
    return h("label", { class: "line", title }, box, h("span", {}, text), ...more);
  };
  const titled = (title, ...inside) => h("fieldset", {}, h("legend", {}, title), ...inside);
  /* A set of the state has the keys whose box is not ticked. */
  const outside = (state, name, key, changed) => (on) => {
    state[name][on ? "delete" : "add"](key);
    changed();
  };

  /* The form; `changed` is called after every choice, `chosen` when another group is. */
  function build(form, { facts }, state, { changed, chosen }) {
    const group = facts.groups[state.group],
      families = count(group.problems.map((code) => facts.problems.family[code])),
      varying = ranges(facts, group.problems).filter(([, [low, high]]) => low < high);
    const set = (name) => (value) => {
      state[name] = value;
      changed();
    };
    const groups = facts.groups.map((g, k) => [k, `${g.name} (${g.problems.length} × ${g.labels.length})`]);
    const tolerances = [["", `as planned, ${Dom.number(group.tolerance)}`], ...facts.tolerances.map((t) => [t, t.toExponential()])];
    const metrics = facts.metrics.map((m) => [m.name, m.name.replace("counter:", "")]);
    const tick = (f) => ticked(f || "(none)", f || "(none)", !state.families.has(f), outside(state, "families", f, changed),
      { "data-key": f }, h("span", { class: "number" }, String(families.get(f))));
    const list = { class: "list", tabindex: "0", role: "group", "aria-label": "Families" };
    form.replaceChildren(
      select("Formulation", "group", groups, state.group, (v) => chosen(Number(v))),
      select("Cost", "metric", metrics, state.metric, set("metric")),
      select("Tolerance", "tolerance", tolerances, state.tolerance ?? "", (v) => set("tolerance")(Number(v) || null)),
      ...(families.size > 1 ? [titled("Families", h("div", list, [...families.keys()].sort().map(tick)))] : []),
      ...(varying.length ? [sizes(varying, state, changed)] : []),
      titled("Routes", ticked("exact ones only", null, state.exact, set("exact"), { id: "filter-exact" })),
      solverList(),
    );
  }

  function select(name, id, options, value, then) {
    const control = { id: `filter-${id}`, onchange: (e) => then(e.target.value) };
    const label = h("label", { class: "name", for: control.id }, name);
    return h("div", {}, label, h("select", control, options.map(Dom.option(value))));
  }

  function sizes(varying, state, changed) {
    const all = new Map(varying);
    if (!all.has(state.symbol)) state.symbol = varying[0][0];
    const ends = [["low", "least size"], ["high", "largest size"]].map(([name, label]) =>
      h("input", {
        ...{ type: "number", id: `filter-${name}`, value: state[name], "aria-label": label },
        oninput: (e) => {
          state[name] = e.target.value === "" ? null : Number(e.target.value);
          changed();
        },
      }),
    );
    const hint = () => ends.forEach((end, k) => (end.placeholder = String(all.get(state.symbol)[k])));
    hint();
    const onchange = (e) => {
      state.symbol = e.target.value;
      hint();
      changed();
    };
    const options = varying.map(([key]) => [key, key]).map(Dom.option(state.symbol));
    const symbol = h("select", { "aria-label": "size", id: "filter-symbol", onchange }, options);
    return titled("Size", h("div", { class: "pair" }, symbol, ends[0], "to", ends[1]));
  }

  function solverList() {
    const search = { type: "search", id: "solver-search", placeholder: "Find a solver", "aria-label": "Find a solver" };
    const quick = ["all", "none", "leading"].map((name) => h("button", { type: "button", "data-quick": name }, name));
    const list = { class: "list solvers", id: "solver-lines", tabindex: "0", role: "group", "aria-label": "Solvers" };
    const heading = h("legend", {}, "Solvers", h("span", { class: "value", id: "solver-count" }));
    return h("fieldset", { id: "solver-list" }, heading, h("input", search), h("div", { class: "quick" }, quick), h("div", list));
  }

  /* The lines of the solvers: check box, look of the curve, name, problems solved. */
  function solverLines(context, changed) {
    const { table, state, shown, slots, solvedBy, order } = context,
      lines = document.getElementById("solver-lines");
    const there = new Map([...lines.children].map((line) => [line.dataset.code, line]));
    for (const place of order) {
      const code = table.labels[place], name = context.name(place);
      let line = there.get(String(code));
      if (!line) {
        line = ticked(name, name, true, outside(state, "hidden", code, changed), {}, h("span", { class: "number" }));
        line.dataset.code = code;
        line.addEventListener("mouseenter", () => Figures.focus(name));
        line.addEventListener("mouseleave", () => Figures.focus(""));
        line.insertBefore(Figures.swatch(-1), line.children[1]);
        lines.append(line);
      }
      line.classList.toggle("hidden-now", !shown.has(place));
      line.querySelector("input").checked = !state.hidden.has(code);
      line.querySelector("svg").replaceWith(Figures.swatch(slots.get(place) ?? -1));
      line.lastChild.textContent = shown.has(place) ? String(solvedBy.get(place) ?? "—") : "";
    }
    document.getElementById("solver-count").textContent = `${shown.size} of ${table.labels.length}`;
  }

  return Object.freeze({ initial, problems, labels, ranges, build, solverLines });
})();
