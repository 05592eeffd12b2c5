"use strict";
/* Reads the data, keeps what is chosen, and hands every figure the context of it. */
const App = (() => {
  const { h } = Dom;
  let data = null,
    state = null,
    pair = null, // the row whose sheet is open
    slots = new Map();
  const tables = new Map();

  const tableOf = (k) => {
    if (!tables.has(k)) tables.set(k, Engine.index(data.columns, data.facts.groups[k]));
    return tables.get(k);
  };

  const MARKS = { approximate: "≈ approximate", relaxation: "⊇ relaxation", necessary: "? necessary" };
  const mark = (text, title) => h("span", { class: "mark", title }, text);

  function marksOf(code, kind) {
    const { labels } = data.facts,
      found = [];
    if (MARKS[kind]) found.push(mark(MARKS[kind], "its route promises less than an answer"));
    if (labels.elsewhere[code])
      found.push(
        mark("elsewhere", "made on another machine; its times are ranked with nobody's unless that was asked for"),
      );
    return found;
  }

  /* What the figures are made from. */
  function contextOf() {
    const { facts, columns } = data,
      group = facts.groups[state.group],
      table = tableOf(state.group);
    const metric = facts.metrics.find((m) => m.name === state.metric),
      { status } = facts;
    const problems = Filters.problems(facts, table, state),
      chosen = Filters.labels(group, table, state);
    const matrix = Engine.costs(columns, table, problems, chosen, columns[metric.name], state.tolerance, status);
    const times =
      metric.name === "time"
        ? matrix
        : Engine.costs(columns, table, problems, chosen, columns.time, state.tolerance, status);
    const ratios = Engine.ratios(matrix, metric.floor),
      curves = Engine.curves(ratios),
      upto = Engine.widest(curves, 1);
    const areas = new Map(curves.map((c) => [c.label, c.solved ? Engine.area(c, upto) : 0]));
    const byHeight = [...curves].sort(
      (a, b) => b.solved - a.solved || areas.get(b.label) - areas.get(a.label) || a.label - b.label,
    );
    slots = slotsOf(table, Engine.leading(curves));
    const places = new Map();
    for (const [code, slot] of slots) places.set(table.labels.indexOf(code), slot);
    const names = facts.labels.name,
      name = (place) => names[table.labels[place]],
      codeOf = new Map(names.map((n, k) => [n, k]));
    const metricName = metric.name === "time" ? "time" : metric.name.replace("counter:", "");
    const tolerance = state.tolerance ?? group.tolerance,
      limit = group.limit === null ? "no limit" : `limit ${Dom.seconds(group.limit)}`;
    const leftOut = matrix.leftOut.map(({ label }) => name(label));
    const judged =
      state.tolerance === null ? "" : ` A time is that of a solve that was asked for ${Dom.number(group.tolerance)}.`;
    return {
      data,
      facts,
      columns,
      group,
      table,
      state,
      problems,
      metric,
      metricName,
      matrix,
      times,
      ratios,
      curves,
      byHeight,
      whole:
        state.metric === "time" &&
        state.tolerance === null &&
        problems.length === table.problems.length &&
        chosen.length === table.labels.length,
      name,
      slots: places,
      slotOf: (label) => slots.get(codeOf.get(label)) ?? -1,
      shown: new Set(chosen),
      order: group.display,
      solvedBy: new Map(curves.map((c) => [c.label, c.solved])),
      numbers: `${group.name}: N = ${problems.length}${problems.length < table.problems.length ? ` of ${table.problems.length}` : ""} problems, tolerance ${Dom.number(tolerance)}, ${limit}; solved: error at most the tolerance, as measured here.${judged}`,
      floorText:
        metric.floor === null ? "" : ` ${metricName === "time" ? "Times" : `Values of ${metricName}`} below ${Dom.cost(metric, metric.floor)} are set to ${Dom.cost(metric, metric.floor)}.`,
      leftOutText: leftOut.length
        ? ` Not shown (no ${metricName === "reported" ? "self-reported time" : metricName}): ${leftOut.slice(0, 6).join(", ")}${leftOut.length > 6 ? ` and ${leftOut.length - 6} more` : ""}.`
        : "",
      marks: (place) => marksOf(table.labels[place], group.kinds[table.labels[place]]),
      marksOf: (label, kind) => marksOf(codeOf.get(label), kind),
      statusOf: (row) => statusOf(row),
      symbolOf: (word) => status.symbols[status.names.indexOf(word)],
    };
  }

  /* The status of a row at the tolerance that is chosen, as analysis.tolerances.judged_at. */
  function statusOf(row) {
    const {
      columns,
      facts: { status },
    } = data;
    return status.names[Engine.outcome(columns, row, state.tolerance, status)];
  }

  /* Those that lead are in colour, each in the one that it has in every figure of these results. */
  function slotsOf(table, leaders) {
    const codes = leaders.slice(0, Charts.SLOTS).map((place) => table.labels[place]);
    return new Map(codes.map((code) => [code, data.facts.labels.look[code] % Charts.COLOURS.length]));
  }

  let waiting = false;
  function changed() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      update();
    });
  }

  function update() {
    const context = contextOf();
    Filters.solverLines(context, context.order, state, changed);
    const left = `${context.group.name}: ${context.problems.length} of ${Dom.counted(context.table.problems.length, "problem")}, ${context.shown.size} of ${Dom.counted(context.table.labels.length, "solver")}`;
    document.getElementById("chosen").textContent = left;
    for (const place of document.querySelectorAll("[data-group-name]")) place.textContent = context.group.name;
    Answer.say(context.group);
    Address.write(data.facts, state, pair, data.columns);
    Figures.update(context);
    App.context = context;
  }

  /* Another group: its own filters, nothing hidden, unless a state is given. */
  function choose(k, asked = null) {
    state = asked ?? { ...Filters.initial(k), ...(state ? { metric: state.metric } : {}) };
    slots = new Map();
    const group = data.facts.groups[k],
      table = tableOf(k),
      { columns, facts } = data;
    const all = [...table.labels.keys()],
      matrix = Engine.costs(columns, table, [...table.problems.keys()], all, columns.time, null, facts.status);
    const curves = Engine.profile(matrix, facts.metrics[0].floor),
      leaders = Engine.leading(curves);
    group.display = [...leaders, ...all.filter((s) => !leaders.includes(s))];
    Filters.build(document.getElementById("filter-form"), data, state, { changed, chosen: choose });
    wire(table, leaders);
    update();
  }

  function wire(table, leaders) {
    const quick = {
      all: () => state.hidden.clear(),
      none: () => table.labels.forEach((c) => state.hidden.add(c)),
      leading: () => {
        table.labels.forEach((c) => state.hidden.add(c));
        leaders.slice(0, Charts.SLOTS).forEach((s) => state.hidden.delete(table.labels[s]));
      },
    };
    for (const button of document.querySelectorAll("[data-quick]"))
      button.addEventListener("click", () => {
        quick[button.dataset.quick]();
        changed();
      });
    document.getElementById("solver-search").addEventListener("input", (event) => {
      const wanted = event.target.value.toLowerCase();
      for (const line of document.getElementById("solver-lines").children)
        line.hidden = !line.title.toLowerCase().includes(wanted);
    });
  }

  function navigation() {
    const links = new Map([...document.querySelectorAll(".top nav a")].map((a) => [a.hash.slice(1), a]));
    const watcher = new IntersectionObserver(
      (entries) => {
        for (const entry of entries) {
          if (!entry.isIntersecting) continue;
          for (const a of links.values()) a.removeAttribute("aria-current");
          const link = links.get(entry.target.id);
          link?.setAttribute("aria-current", "true");
          const bar = link?.closest("nav");
          bar?.scrollTo({ left: link.offsetLeft - bar.offsetLeft - 24 });
        }
      },
      { rootMargin: "-20% 0px -70% 0px" },
    );
    document.querySelectorAll("main > section[id]").forEach((section) => watcher.observe(section));
    document.getElementById("theme").addEventListener("click", () => {
      const root = document.documentElement,
        dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
      root.dataset.theme = dark ? "light" : "dark";
    });
    const box = document.querySelector("#filters > details"),
      wide = matchMedia("(min-width: 62.01rem)"),
      fit = () => {
        box.open = wide.matches;
      };
    wide.addEventListener("change", fit);
    fit();
    const dialog = document.getElementById("pair");
    dialog.addEventListener("click", (event) => {
      if (event.target === dialog) dialog.close();
    });
    dialog.addEventListener("close", () => opened(null));
    document.getElementById("reset").addEventListener("click", () => choose(data.facts.first, Filters.initial(data.facts.first)));
    window.addEventListener("hashchange", () => {
      const { query } = Address.parts();
      if ([...query.keys()].length) follow();
      else if (state) Address.write(data.facts, state, pair, data.columns); // a link to a section keeps what is chosen
    });
  }

  /* The sheet of a row is open, or none. */
  function opened(row) {
    pair = row;
    Address.write(data.facts, state, pair, data.columns);
  }

  /* Shows what the address asks for. */
  function follow() {
    const asked = Address.read(data.facts),
      k = asked?.group ?? data.facts.first,
      row = Address.pair(data, k),
      { section } = Address.parts();
    choose(k, asked);
    if (section) document.getElementById(section)?.scrollIntoView();
    if (row >= 0) Pair.open(App.context, row);
  }

  async function start() {
    data = await Data.read(document.getElementById("data").textContent);
    navigation();
    if (data.facts.groups.length) {
      Figures.mount(changed);
      for (const place of document.querySelectorAll("[data-choose]"))
        place.addEventListener("click", () => {
          choose(Number(place.dataset.choose));
          window.scrollTo(0, 0);
        });
      follow();
    }
    document.documentElement.dataset.ready = "true";
  }

  return {
    start,
    update,
    choose,
    opened,
    context: null,
    get state() {
      return state;
    },
    get data() {
      return data;
    },
  };
})();
App.start();
