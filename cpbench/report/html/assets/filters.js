"use strict";
/* What is chosen in the column of filters, and which problems and solvers that leaves. */
const Filters = (() => {
  const { h } = Dom;

  const initial = (group) => ({
    group,
    metric: "time",
    tolerance: null,
    families: new Set(),
    symbol: "",
    low: null,
    high: null,
    exact: false,
    hidden: new Set(),
  });

  /* Places of the problems of a group that are chosen. A family is left out when it is in `state.families`. */
  function problems(facts, table, state) {
    const found = [];
    table.problems.forEach((code, place) => {
      if (state.families.has(facts.problems.family[code])) return;
      const size = state.symbol ? facts.problems.sizes[code][state.symbol] : undefined;
      if (state.symbol && (state.low !== null || state.high !== null)) {
        if (
          size === undefined ||
          (state.low !== null && size < state.low) ||
          (state.high !== null && size > state.high)
        )
          return;
      }
      found.push(place);
    });
    return found;
  }

  const INEXACT = new Set(["necessary", "approximate", "relaxation"]);
  /* Places of the labels of a group that are chosen; `state.hidden` has codes. */
  const labels = (group, table, state) =>
    [...table.labels.keys()].filter((s) => {
      const code = table.labels[s];
      return !state.hidden.has(code) && !(state.exact && INEXACT.has(group.kinds[code]));
    });

  const decade = (k) => (k ? Number(`1e-${k}`) : null);

  /* The form; `changed` is called after every choice, `chosen` when another group is. */
  function build(form, data, state, { changed, chosen }) {
    const { facts } = data,
      group = facts.groups[state.group];
    const parts = [],
      families = new Map(),
      symbols = new Map();
    for (const code of group.problems) {
      const family = facts.problems.family[code];
      families.set(family, (families.get(family) ?? 0) + 1);
      for (const [symbol, size] of Object.entries(facts.problems.sizes[code])) {
        const range = symbols.get(symbol) ?? [Infinity, -Infinity];
        symbols.set(symbol, [Math.min(range[0], size), Math.max(range[1], size)]);
      }
    }
    parts.push(
      select(
        "Formulation",
        "group",
        facts.groups.map((g, k) => [k, `${g.name} (${g.problems.length} × ${g.labels.length})`]),
        state.group,
        (v) => chosen(Number(v)),
      ),
    );
    parts.push(
      select(
        "Cost",
        "metric",
        facts.metrics.map((m) => [m.name, m.name.replace("counter:", "")]),
        state.metric,
        (v) => {
          state.metric = v;
          changed();
        },
      ),
    );
    parts.push(tolerance(group, state, changed));
    if (families.size > 1)
      parts.push(
        checks(
          "Families",
          [...families.keys()].sort(),
          (f) => f || "(none)",
          (f) => families.get(f),
          state.families,
          changed,
        ),
      );
    const varying = [...symbols].filter(([, [low, high]]) => low < high).sort();
    if (varying.length) parts.push(sizes(varying, state, changed));
    parts.push(
      h(
        "fieldset",
        {},
        h("legend", {}, "Routes"),
        h(
          "label",
          { class: "line" },
          h("input", {
            type: "checkbox",
            id: "filter-exact",
            checked: state.exact,
            onchange: (e) => {
              state.exact = e.target.checked;
              changed();
            },
          }),
          h("span", {}, "exact ones only"),
        ),
      ),
    );
    form.replaceChildren(...parts, solverList());
  }

  function select(name, id, options, value, then) {
    return h(
      "div",
      {},
      h("label", { class: "name", for: `filter-${id}` }, name),
      h(
        "select",
        { id: `filter-${id}`, onchange: (e) => then(e.target.value) },
        options.map(([key, text]) => h("option", { value: key, selected: key === value }, text)),
      ),
    );
  }

  function tolerance(group, state, changed) {
    const planned = `as planned, ${Dom.number(group.tolerance)}`;
    const shown = state.tolerance === null ? planned : state.tolerance.toExponential();
    const told = h("output", { class: "value", for: "filter-tolerance" }, shown);
    const input = h("input", {
      type: "range",
      id: "filter-tolerance",
      min: 0,
      max: 12,
      step: 1,
      value: state.tolerance === null ? 0 : Math.round(-Math.log10(state.tolerance)),
      "aria-valuetext": planned,
      oninput: (e) => {
        state.tolerance = decade(Number(e.target.value));
        told.textContent = state.tolerance === null ? planned : state.tolerance.toExponential();
        e.target.setAttribute("aria-valuetext", told.textContent);
        changed();
      },
    });
    return h("div", {}, h("label", { class: "name", for: "filter-tolerance" }, "Tolerance", told), input);
  }

  function checks(title, keys, name, count, out, changed) {
    return h(
      "fieldset",
      {},
      h("legend", {}, title),
      h(
        "div",
        { class: "list", tabindex: "0", role: "group", "aria-label": title },
        keys.map((key) =>
          h(
            "label",
            { class: "line", title: name(key) },
            h("input", {
              type: "checkbox",
              checked: !out.has(key),
              "data-key": key,
              onchange: (e) => {
                if (e.target.checked) out.delete(key);
                else out.add(key);
                changed();
              },
            }),
            h("span", {}, name(key)),
            h("span", { class: "number" }, String(count(key))),
          ),
        ),
      ),
    );
  }

  function sizes(varying, state, changed) {
    const ranges = new Map(varying);
    if (!ranges.has(state.symbol)) state.symbol = varying[0][0];
    const value = (e) => (e.target.value === "" ? null : Number(e.target.value));
    const low = h("input", {
      type: "number",
      id: "filter-low",
      value: state.low,
      "aria-label": "least size",
      oninput: (e) => {
        state.low = value(e);
        changed();
      },
    });
    const high = h("input", {
      type: "number",
      id: "filter-high",
      value: state.high,
      "aria-label": "largest size",
      oninput: (e) => {
        state.high = value(e);
        changed();
      },
    });
    const hint = () => {
      [low.placeholder, high.placeholder] = ranges.get(state.symbol).map(String);
    };
    hint();
    const symbol = h(
      "select",
      {
        "aria-label": "size",
        id: "filter-symbol",
        onchange: (e) => {
          state.symbol = e.target.value;
          hint();
          changed();
        },
      },
      varying.map(([key]) => h("option", { value: key, selected: key === state.symbol }, key)),
    );
    return h("fieldset", {}, h("legend", {}, "Size"), h("div", { class: "pair" }, symbol, low, "to", high));
  }

  function solverList() {
    return h(
      "fieldset",
      { id: "solver-list" },
      h("legend", {}, "Solvers", h("span", { class: "value", id: "solver-count" })),
      h("input", { type: "search", id: "solver-search", placeholder: "Find a solver", "aria-label": "Find a solver" }),
      h(
        "div",
        { class: "quick" },
        ...["all", "none", "leading"].map((what) => h("button", { type: "button", "data-quick": what }, what)),
      ),
      h("div", { class: "list solvers", id: "solver-lines", tabindex: "0", role: "group", "aria-label": "Solvers" }),
    );
  }

  /* The lines of the solvers: check box, look of the curve, name, problems solved. */
  function solverLines(context, order, state, changed) {
    const lines = document.getElementById("solver-lines");
    const known = new Map([...lines.children].map((line) => [line.dataset.code, line]));
    for (const place of order) {
      const code = context.table.labels[place],
        name = context.name(place);
      let line = known.get(String(code));
      if (!line) {
        line = h(
          "label",
          {
            class: "line",
            title: name,
            "data-code": code,
            onmouseenter: () => Figures.focus(name),
            onmouseleave: () => Figures.focus(""),
          },
          h("input", {
            type: "checkbox",
            checked: !state.hidden.has(code),
            onchange: (e) => {
              if (e.target.checked) state.hidden.delete(code);
              else state.hidden.add(code);
              changed();
            },
          }),
          h("span", {}, name),
          h("span", { class: "number" }),
        );
        line.insertBefore(Figures.swatch(-1), line.children[1]);
        lines.append(line);
      }
      const slot = context.slots.get(place) ?? -1;
      line.classList.toggle("hidden-now", !context.shown.has(place));
      line.querySelector("input").checked = !state.hidden.has(code);
      line.querySelector("svg").replaceWith(Figures.swatch(slot));
      line.lastChild.textContent = context.shown.has(place) ? String(context.solvedBy.get(place) ?? "—") : "";
    }
    document.getElementById("solver-count").textContent = `${context.shown.size} of ${context.table.labels.length}`;
  }

  return Object.freeze({ initial, problems, labels, build, solverLines, INEXACT });
})();
