"use strict";
/* Reads the data, keeps what is chosen, and hands every figure the context of it. */
const App = (() => {
  const { h } = Dom;
  let data = null, state = null, pair = null; // the row whose sheet is open
  const tables = new Map();

  const tableOf = (k) => {
    if (!tables.has(k)) tables.set(k, Rows.index(data.columns, data.facts.groups[k]));
    return tables.get(k);
  };

  const MARKS = { approximate: "≈ approximate", relaxation: "⊇ relaxation", necessary: "? necessary" };
  const ELSEWHERE = "made on another machine; its times are ranked only if that was asked for";
  function marksOf(code, kind) {
    const mark = (text, title) => h("span", { class: "mark", title }, text);
    const marks = MARKS[kind] ? [mark(MARKS[kind], "its route promises less than an answer")] : [];
    return data.facts.labels.elsewhere[code] ? [...marks, mark("elsewhere", ELSEWHERE)] : marks;
  }

  /* What the figures are made from. */
  function contextOf() {
    const { facts, columns } = data, { status } = facts, group = facts.groups[state.group],
      table = tableOf(state.group),
      metric = facts.metrics.find((m) => m.name === state.metric),
      problems = Filters.problems(facts, table, state),
      chosen = Filters.labels(group, table, state),
      outcome = Rows.outcomes(columns, state.tolerance),
      matrix = Rows.costs({ columns, table, facts }, outcome, problems, chosen, columns[metric.name]),
      ratios = Rows.ratios(matrix, metric.floor),
      curves = Rows.curves(ratios),
      solvedBy = new Map(curves.map((c) => [c.label, c.solved])),
      order = group.order.map((code) => table.labelAt.get(code)),
      rank = new Map(order.map((s, k) => [s, k])),
      shown = new Set(chosen);
    /* The first that solve something are in colour, each in the one that it has in every figure of these results. */
    const look = (s) => facts.labels.look[table.labels[s]] % Charts.COLOURS.length;
    const slots = new Map(order.filter((s) => solvedBy.get(s)).slice(0, Charts.SLOTS).map((s) => [s, look(s)]));
    const name = (s) => facts.labels.name[table.labels[s]],
      places = new Map(table.labels.map((_, s) => [name(s), s])),
      metricName = metric.name.replace("counter:", ""),
      whole = problems.length === table.problems.length;
    return {
      data, facts, columns, group, table, state, problems, metric, metricName, matrix, ratios, curves, shown, order,
      name, slots, solvedBy,
      byHeight: [...curves].sort((a, b) => b.solved - a.solved || rank.get(a.label) - rank.get(b.label)),
      whole: state.metric === "time" && state.tolerance === null && whole && chosen.length === table.labels.length,
      placeOf: (label) => places.get(label),
      slotOf: (label) => slots.get(places.get(label)) ?? -1,
      shows: (label) => shown.has(places.get(label)),
      marks: (s) => marksOf(table.labels[s], group.kinds[table.labels[s]]),
      marksOf: (label, kind) => marksOf(table.labels[places.get(label)], kind),
      rowAt: (p, s) => table.row[p * table.labels.length + s],
      problem: (p) => facts.problems.name[table.problems[p]],
      statusOf: (row) => status.names[outcome[row]],
      solved: (row) => row >= 0 && status.verified[outcome[row]] === 1,
      symbolOf: (word) => status.symbols[status.names.indexOf(word)],
      ...sentences(group, metric, metricName, problems, table, matrix.leftOut.map(name)),
    };
  }

  function sentences(group, metric, metricName, problems, table, leftOut) {
    const tolerance = Dom.number(state.tolerance ?? group.tolerance),
      limit = group.limit === null ? "no limit" : `limit ${Dom.seconds(group.limit)}`,
      of = problems.length < table.problems.length ? ` of ${table.problems.length}` : "",
      floor = Dom.cost(metric, metric.floor),
      values = metricName === "time" ? "Times" : `Values of ${metricName}`,
      more = leftOut.length > 6 ? ` and ${leftOut.length - 6} more` : "",
      missing = metricName === "reported" ? "self-reported time" : metricName;
    const judged =
      state.tolerance === null ? "" : ` A time is that of a solve that was asked for ${Dom.number(group.tolerance)}.`;
    return {
      numbers: `${group.name}: N = ${problems.length}${of} problems, tolerance ${tolerance}, ${limit}; solved: error at most the tolerance, as measured here.${judged}`,
      prepared: `N = ${Dom.counted(table.problems.length, "problem")}, tolerance ${Dom.number(group.tolerance)}: computed by cpbench of all of them; only the solvers are those that are chosen.`,
      floorText: metric.floor === null ? "" : ` ${values} below ${floor} are set to ${floor}.`,
      leftOutText: leftOut.length ? ` Not shown (no ${missing}): ${leftOut.slice(0, 6).join(", ")}${more}.` : "",
    };
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
    const context = contextOf(), { group, table, problems, shown } = context;
    Filters.solverLines(context, changed);
    const solvers = Dom.counted(table.labels.length, "solver"),
      left = `${group.name}: ${problems.length} of ${Dom.counted(table.problems.length, "problem")}, ${shown.size} of ${solvers}`;
    document.getElementById("chosen").textContent = left;
    for (const place of document.querySelectorAll("[data-group-name]")) place.textContent = group.name;
    Prepared.say(group);
    Address.write(data.facts, state, pair, data.columns);
    Figures.update(context);
    App.context = context;
  }

  /* Another group: its own filters, nothing hidden, unless a state is given. */
  function choose(k, asked = null) {
    state = asked ?? { ...Filters.initial(k), ...(state ? { metric: state.metric } : {}) };
    Filters.build(document.getElementById("filter-form"), data, state, { changed, chosen: choose });
    wire(data.facts.groups[k]);
    update();
  }

  function wire({ order }) {
    const hide = (codes) => (state.hidden = new Set(codes));
    const quick = { all: () => hide([]), none: () => hide(order), leading: () => hide(order.slice(Charts.SLOTS)) };
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
    const passed = (entries) => {
      for (const { target } of entries.filter((entry) => entry.isIntersecting)) {
        for (const a of links.values()) a.removeAttribute("aria-current");
        const link = links.get(target.id), bar = link?.closest("nav");
        link?.setAttribute("aria-current", "true");
        bar?.scrollTo({ left: link.offsetLeft - bar.offsetLeft - 24 });
      }
    };
    const watcher = new IntersectionObserver(passed, { rootMargin: "-20% 0px -70% 0px" });
    document.querySelectorAll("main > section[id]").forEach((section) => watcher.observe(section));
    document.getElementById("theme").addEventListener("click", () => {
      const root = document.documentElement,
        now = root.dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
      root.dataset.theme = now === "dark" ? "light" : "dark";
    });
    const wide = matchMedia("(min-width: 62.01rem)"),
      fit = () => (document.querySelector("#filters > details").open = wide.matches);
    wide.addEventListener("change", fit);
    fit();
  }

  function listen() {
    const dialog = document.getElementById("pair"), { facts, columns } = data;
    dialog.addEventListener("click", (event) => {
      if (event.target === dialog) dialog.close();
    });
    dialog.addEventListener("close", () => opened(null));
    document.getElementById("reset").addEventListener("click", () => choose(facts.first, Filters.initial(facts.first)));
    window.addEventListener("hashchange", () => {
      if (Address.read(facts)) follow();
      else if (state) Address.write(facts, state, pair, columns); // a link to a section keeps what is chosen
    });
    for (const place of document.querySelectorAll("[data-choose]"))
      place.addEventListener("click", () => {
        choose(Number(place.dataset.choose));
        window.scrollTo(0, 0);
      });
  }

  /* The sheet of a row is open, or none. */
  function opened(row) {
    pair = row;
    Address.write(data.facts, state, pair, data.columns);
  }

  /* Shows what the address asks for. */
  function follow() {
    const asked = Address.read(data.facts), k = asked?.group ?? data.facts.first,
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
      listen();
      Figures.mount(changed);
      follow();
    }
    document.documentElement.dataset.ready = "true";
  }

  return {
    start, update, choose, opened,
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
