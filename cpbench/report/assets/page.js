/* The page of a report: charts of one formulation, the matrix and the list of its pairs, and the sheet of a pair. The
   numbers are those of the report; charts are Vega-Lite, which also computes the ratios of a profile of what is chosen.
   Whatever comes from the results is set as text or as an attribute, never as markup. */

const LEADING = 8; // solvers in colour
const LISTED = 300; // pairs of the list
const CELLS = 24000; // cells of the matrix
const MOST = 200000; // values of a chart
const TYPES = { "|u1": Uint8Array, "<u2": Uint16Array, "<u4": Uint32Array, "<f4": Float32Array, "<f8": Float64Array };
const ALIGNED = 8;
const page = { facts: null, columns: null, state: null, views: {} };
globalThis.page = page; // for the tests of this page

/* ---- data: base64 of gzip of a frame (frames.py): the length of the header, the header as JSON, columns of numbers */

async function unpacked(text) {
  const letters = atob(text);
  const packed = Uint8Array.from(letters, (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = await new Response(stream).arrayBuffer();
  const length = new DataView(bytes).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
  const columns = {};
  let at = 4 + length;
  for (const [name, size, type] of header.vectors) {
    columns[name] = new TYPES[type](bytes, at, size / TYPES[type].BYTES_PER_ELEMENT);
    at += Math.ceil(size / ALIGNED) * ALIGNED;
  }
  return { facts: header.facts, columns };
}

/* ---- elements, and numbers as text */

/* An element: attributes, of which `on...` are listeners, and children, text or elements. */
function h(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (key in made && typeof value === "boolean") made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== ""));
  return made;
}

/* A table in a box that scrolls; `right` are the columns of numbers, the first column names its row. */
function table({ caption, head, rows, right = [] }) {
  const side = (k) => (right.includes(k) ? "right" : null);
  const top = h("tr", {}, head.map((cell, k) => h("th", { scope: "col", class: side(k) }, cell)));
  const cellOf = (cell, k) => (k ? h("td", { class: side(k) }, cell) : h("th", { scope: "row" }, cell));
  const lines = rows.map((cells) => h("tr", {}, cells.map(cellOf)));
  const name = h("caption", { class: "visually-hidden" }, caption);
  const made = h("table", {}, name, h("thead", {}, top), h("tbody", {}, lines));
  return h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": caption }, made);
}

function select(text, options, chosen, changed) {
  const made = h("select", { onchange: () => changed(made.value) });
  const option = ([value, label]) => h("option", { value, selected: String(value) === String(chosen) }, label);
  made.append(...options.map(option));
  return h("label", {}, h("span", {}, text), made);
}

function digits(value) {
  const size = Math.abs(value);
  if (value !== 0 && (size >= 1e5 || size < 1e-3)) return value.toExponential(1).replace("e+", "e").replace(".0e", "e");
  return String(Number(value.toPrecision(3)));
}

function number(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return "—";
  return Number.isFinite(value) ? digits(value) : "∞";
}

function seconds(value) {
  if (!Number.isFinite(value)) return number(value);
  if (value >= 1) return `${digits(value)} s`;
  return value >= 1e-3 ? `${digits(value * 1e3)} ms` : `${digits(value * 1e6)} µs`;
}

function bytes(value) {
  if (!Number.isFinite(value)) return number(value);
  return value >= 2 ** 30 ? `${digits(value / 2 ** 30)} GiB` : `${digits(value / 2 ** 20)} MiB`;
}

const written = (metric, value) => (metric.unit === "s" ? seconds : metric.unit === "byte" ? bytes : number)(value);
const words = (name) => name.replaceAll("_", " ").replace("counter:", "");

/* ---- what is chosen */

const groupOf = () => page.facts.groups[page.state.group];
const metricOf = () => page.facts.metrics.find((metric) => metric.name === page.state.metric);
const labelName = (code) => page.facts.labels.name[code];
const statusOf = (row) => page.facts.status.names[page.columns.status[row]];
const isSolved = (row) => page.facts.status.verified[page.columns.status[row]] === 1;
const initial = (group) => ({ group, metric: "time", family: "", hidden: new Set() });

/* Labels of the formulation that are shown, the best first. */
const shownLabels = () => groupOf().order.filter((code) => !page.state.hidden.has(code));

/* Rows of the formulation: of the family and the solvers that are chosen. */
function chosenRows() {
  const { first, count } = groupOf(), { family, hidden } = page.state, { problem, label } = page.columns;
  const fits = (row) => !hidden.has(label[row]) && (!family || page.facts.problems.family[problem[row]] === family);
  return Array.from({ length: count }, (_, k) => first + k).filter(fits);
}

const chosenProblems = () => {
  const { family } = page.state;
  return groupOf().problems.filter((code) => !family || page.facts.problems.family[code] === family);
};

/* By problem and label of the formulation: the row of the pair. */
function cellsOf() {
  const { problem, label } = page.columns;
  return new Map(chosenRows().map((row) => [`${problem[row]} ${label[row]}`, row]));
}

/* What a row cost; null where it is not solved. */
function costOf(row) {
  const value = page.columns[page.state.metric][row];
  return isSolved(row) && Number.isFinite(value) ? value : null;
}

/* The part of the address behind the #: a section, then `?` and what is chosen, so that a link shows the same to all
   who have the same file. */
function addressParts() {
  const [section, query = ""] = location.hash.slice(1).split("?");
  return { section, query: new URLSearchParams(query) };
}

function stateOfAddress() {
  const { query } = addressParts(), { facts } = page;
  const group = facts.groups.findIndex((one) => one.name === query.get("group"));
  const state = initial(group < 0 ? facts.first : group);
  if (facts.metrics.some((metric) => metric.name === query.get("cost"))) state.metric = query.get("cost");
  state.family = query.get("family") ?? "";
  const hidden = new Set(query.getAll("without"));
  state.hidden = new Set(facts.labels.name.flatMap((name, code) => (hidden.has(name) ? [code] : [])));
  return state;
}

function writeAddress(row = null) {
  const { section } = addressParts(), { state, facts, columns } = page, query = new URLSearchParams();
  if (state.group !== facts.first) query.set("group", groupOf().name);
  if (state.metric !== "time") query.set("cost", state.metric);
  if (state.family) query.set("family", state.family);
  for (const code of state.hidden) query.append("without", labelName(code));
  if (row !== null) {
    query.set("problem", facts.problems.name[columns.problem[row]]);
    query.set("solver", labelName(columns.label[row]));
  }
  const text = query.toString();
  history.replaceState(null, "", text || section ? `#${section}${text ? `?${text}` : ""}` : location.pathname);
}

/* The row of the pair that an address names; -1 without one. */
function rowOfAddress() {
  const { query } = addressParts(), { facts, columns } = page, { first, count } = groupOf();
  const problem = facts.problems.name.indexOf(query.get("problem") ?? "\n");
  const label = facts.labels.name.indexOf(query.get("solver") ?? "\n");
  return columns.problem.findIndex(
    (code, row) => row >= first && row < first + count && code === problem && columns.label[row] === label,
  );
}

/* ---- charts */

const COLOURS = Array.from({ length: 10 }, (_, k) => `var(--s${k})`);
const DASHES = [[1, 0], [7, 3], [2, 2], [9, 3, 2, 3], [4, 2], [12, 4], [5, 2, 1, 2], [1, 2], [8, 2, 2, 2], [3, 3]];
const SECONDS =
  "datum.value >= 1 ? format(datum.value, '~g') + ' s' : datum.value >= 1e-3 ? " +
  "format(datum.value * 1e3, '~g') + ' ms' : format(datum.value * 1e6, '~g') + ' µs'";
const BYTES = "format(datum.value / 1048576, '~g') + ' MiB'";
const TINY = "datum.value >= 1e-3 && datum.value < 1e5 ? format(datum.value, '~g') : format(datum.value, '.0e')";
const ink = (...parts) => Object.fromEntries(parts.map((part) => [`${part}Color`, "currentColor"]));
const CONFIG = {
  background: null,
  font: "system-ui, sans-serif",
  aria: false,
  view: { stroke: null },
  axis: {
    ...ink("label", "title", "tick", "domain", "grid"),
    ...{ gridOpacity: 0.1, domainOpacity: 0.35, tickOpacity: 0.35 },
  },
  legend: {
    ...ink("label", "title", "symbolBaseFill"),
    ...{ orient: "bottom", columns: { expr: "width > 600 ? 4 : 2" }, labelLimit: 180 },
  },
};

const unitOf = (metric) => (metric.unit === "s" ? SECONDS : metric.unit === "byte" ? BYTES : TINY);
const logScale = (title, labelExpr, scale = {}) => ({
  type: "quantitative",
  scale: { type: "log", nice: false, ...scale },
  axis: { title, labelExpr, tickCount: 6 },
});

/* The solvers in colour: the first of the order that solve something. Each has one style in all figures. */
function leaders() {
  const solved = new Set(chosenRows().filter(isSolved).map((row) => page.columns.label[row]));
  return shownLabels().filter((code) => solved.has(code)).slice(0, LEADING);
}

/* Marks of labels: grey for most, in colour for the leading ones, whose names in the legend bring out their marks. */
function layered(values, mark, encoding, transform = []) {
  const codes = leaders(), names = codes.map(labelName);
  const styles = codes.map((code) => page.facts.labels.style[code]);
  const colours = styles.map((style) => COLOURS[style % COLOURS.length]);
  const dashes = styles.map((style) => DASHES[Math.floor(style / COLOURS.length + style) % DASHES.length]);
  const byLabel = (range) => ({ field: "label", type: "nominal", title: null, scale: { domain: names, range } });
  const line = mark.type === "line";
  const tooltip = [{ field: "label", title: "solver" }, ...(line ? [] : [{ field: "problem" }])];
  const shared = { detail: { field: "label" }, tooltip, ...encoding };
  const coloured = { color: byLabel(colours), opacity: { condition: { param: "focus", value: 1 }, value: 0.12 } };
  if (line) coloured.strokeDash = byLabel(dashes);
  const among = { field: "label", oneOf: names };
  const grey = {
    transform: [{ filter: { not: among } }],
    mark: { ...mark, color: "var(--other)", opacity: 0.5 },
    encoding: shared,
  };
  const bright = {
    params: [{ name: "focus", select: { type: "point", fields: ["label"] }, bind: "legend" }],
    transform: [{ filter: among }],
    mark: line ? { ...mark, strokeWidth: 2.2 } : mark,
    encoding: { ...shared, ...coloured },
  };
  const drawn = values.filter(({ cost = null }) => cost !== null).map(({ label }) => names.includes(label));
  const layer = [...(drawn.includes(false) ? [grey] : []), ...(drawn.includes(true) ? [bright] : [])];
  const nothing = layer.length ? "" : "Nothing of what is chosen was solved.";
  const many = values.length > MOST ? `${values.length} points are too many for a chart: choose a family.` : "";
  return { empty: nothing || many, data: { name: "values", values }, transform, layer };
}

/* Performance profile: the whole matrix of costs goes in, and Vega-Lite makes the ratios and counts. Every label has a
   row at either end of the axis beside those of its problems. */
function profileChart() {
  const metric = metricOf(), name = words(metric.name), problems = chosenProblems(), rows = cellsOf(), values = [];
  for (const code of shownLabels()) {
    const label = labelName(code);
    for (const p of problems) {
      const row = rows.get(`${p} ${code}`), lost = row !== undefined && statusOf(row) === "lost";
      const cost = row === undefined ? null : costOf(row);
      values.push({ label, problem: p, cost, counts: lost ? 0 : 1, one: cost === null ? 0 : 1 });
    }
    values.push({ label, end: 0, counts: 0, one: 0 }, { label, end: 1, counts: 0, one: 0 });
  }
  const sum = (field, as) => ({ op: "sum", field, as });
  const transform = [
    { calculate: `datum.one ? max(datum.cost, ${metric.floor ?? 0}) : null`, as: "spent" },
    { joinaggregate: [{ op: "min", field: "spent", as: "least" }], groupby: ["problem"] },
    { joinaggregate: [sum("counts", "N"), sum("one", "solved")], groupby: ["label"] },
    { calculate: "datum.one ? datum.spent / datum.least : 1", as: "ratio" },
    { joinaggregate: [{ op: "max", field: "ratio", as: "widest" }] },
    { filter: "datum.solved && (datum.one || isValid(datum.end))" },
    { calculate: "datum.end === 1 ? max(2, datum.widest * 1.05) : datum.ratio", as: "tau" },
    {
      window: [sum("one", "done")],
      sort: [{ field: "tau" }],
      groupby: ["label"],
      frame: [null, 0],
      ignorePeers: false,
    },
    { calculate: "datum.done / datum.N", as: "share" },
  ];
  const axis = { title: "fraction solved", format: ".0%" };
  const encoding = {
    x: { field: "tau", ...logScale(`τ: ${name} / least ${name} (failures: ∞)`, TINY) },
    y: { field: "share", type: "quantitative", scale: { domain: [0, 1] }, axis },
    order: { field: "tau" },
  };
  return {
    ...layered(values, { type: "line", interpolate: "step-after" }, encoding, transform),
    guide:
      `Height at τ: fraction of the ${problems.length} problems solved within τ times the ${name} of the best ` +
      "solver shown. Left end: it was the best; right end: solved at all.",
  };
}

function scatterChart() {
  const metric = metricOf(), { problem, label } = page.columns, { pair } = page.state, costs = new Map();
  for (const row of chosenRows().filter((one) => pair.includes(label[one]))) {
    if (!costs.has(problem[row])) costs.set(problem[row], [null, null]);
    costs.get(problem[row])[pair.indexOf(label[row])] = costOf(row);
  }
  const all = [...costs.values()].flat().filter((value) => value > 0);
  const edge = Math.max(...all) * 2, low = Math.min(...all) / 1.5, names = pair.map(labelName);
  const values = [...costs]
    .filter(([, [x, y]]) => x !== null || y !== null)
    .map(([code, [x, y]]) => ({
      problem: page.facts.problems.name[code],
      x: x ?? edge,
      y: y ?? edge,
      ahead: names[(y ?? Infinity) > (x ?? Infinity) ? 0 : 1],
      solved: x === null || y === null ? "by one" : "by both",
    }));
  const axis = (k) => logScale(names[k], unitOf(metric), { domain: [low, edge * 1.2] });
  const of = (title, domain, range) => ({ field: title, type: "nominal", title, scale: { domain, range } });
  const diagonal = {
    data: { values: [{ at: low }, { at: edge }] },
    mark: { type: "line", color: "var(--other)" },
    encoding: { x: { field: "at", ...axis(0) }, y: { field: "at", ...axis(1) } },
  };
  const points = {
    data: { name: "pairs", values },
    mark: { type: "point", size: 55, filled: true },
    encoding: {
      x: { field: "x", ...axis(0) },
      y: { field: "y", ...axis(1) },
      color: of("ahead", names, COLOURS.slice(0, 2)),
      shape: of("solved", ["by both", "by one"], ["circle", "cross"]),
      tooltip: [{ field: "problem" }, { field: "ahead" }, { field: "solved" }],
    },
  };
  return {
    empty: values.length ? "" : "Neither of the two solved a problem.",
    height: 420,
    layer: [diagonal, points],
    guide:
      `A point is a problem: ${words(metric.name)} of ${names[0]} across, of ${names[1]} upwards; above the line ` +
      `${names[0]} is ahead. Crosses at the edge: not solved by that one.`,
  };
}

function sizeChart() {
  const metric = metricOf(), { size } = page.state;
  const { problem, label } = page.columns, { sizes, name } = page.facts.problems;
  const values = chosenRows()
    .map((row) => ({
      label: labelName(label[row]),
      problem: name[problem[row]],
      x: sizes[problem[row]][size],
      cost: costOf(row),
    }))
    .filter(({ x, cost }) => cost > 0 && x > 0);
  const encoding = {
    x: { field: "x", ...logScale(size, TINY) },
    y: { field: "cost", ...logScale(words(metric.name), unitOf(metric)) },
  };
  return {
    ...layered(values, { type: "point", size: 30, filled: true }, encoding),
    guide:
      `A point is a problem that was solved: ${size} across, ${words(metric.name)} upwards; ` +
      "equal steps are equal ratios.",
  };
}

function errorsChart() {
  const names = new Set(shownLabels().map(labelName));
  const values = groupOf().precision
    .filter(({ label }) => names.has(label))
    .flatMap(({ label, seconds: times, error }) => times.map((x, k) => ({ label, cost: x, error: error[k] })));
  const encoding = {
    x: { field: "cost", ...logScale("time", SECONDS) },
    y: { field: "error", ...logScale("judged error", TINY) },
    order: { field: "cost" },
  };
  return {
    ...layered(values, { type: "line", interpolate: "step-after" }, encoding),
    guide:
      "A curve passes ε at the median, over all problems of the formulation, of the times to the first iterate " +
      "whose error, as cpbench judges it, was at most ε; it ends where fewer than half of the problems got further.",
  };
}

const CHARTS = { profile: profileChart, scatter: scatterChart, size: sizeChart, errors: errorsChart };

async function draw(name) {
  const place = document.querySelector(`[data-chart="${name}"]`);
  if (!place) return;
  const { guide, empty, ...spec } = CHARTS[name](), chart = place.querySelector(".chart");
  place.querySelector("figcaption").textContent = guide;
  chart.setAttribute("aria-label", guide);
  page.views[name]?.finalize();
  delete page.views[name];
  if (empty) {
    chart.replaceChildren(h("p", { class: "empty" }, empty));
    return;
  }
  const surface = h("div", { "aria-hidden": "true" }); // the box around it has the role and the name
  chart.replaceChildren(surface);
  const fit = { width: "container", height: 340, autosize: { type: "fit-x", contains: "padding" } };
  const options = { mode: "vega-lite", renderer: "svg", actions: false, ast: true, defaultStyle: false };
  page.views[name] = (await window.vegaEmbed(surface, { ...fit, config: CONFIG, ...spec }, options)).view;
}

/* ---- matrix and list of pairs */

function matrix() {
  const labels = shownLabels(), rows = cellsOf(), { facts } = page, used = new Set();
  const problems = chosenProblems().slice(0, Math.max(1, Math.floor(CELLS / Math.max(labels.length, 1))));
  const signOf = (kind) => (kind === "fastest" ? "★" : facts.status.symbols[facts.status.names.indexOf(kind)]);
  const cell = (p, code, least) => {
    const row = rows.get(`${p} ${code}`), pair = `${facts.problems.name[p]}, ${labelName(code)}`;
    if (row === undefined) return h("td", { class: "k-blank", "aria-label": `${pair}: not planned` });
    const cost = costOf(row), kind = cost !== null && cost <= least ? "fastest" : statusOf(row);
    const said = `${pair}: ${words(kind)}`;
    used.add(kind);
    const attributes = { class: `k-${kind}`, "data-row": row, tabindex: "-1", title: said, "aria-label": said };
    return h("td", attributes, signOf(kind));
  };
  const lineOf = (p) => {
    const costs = labels.map((code) => rows.get(`${p} ${code}`)).map((row) => (row === undefined ? null : costOf(row)));
    const least = Math.min(...costs.map((cost) => cost ?? Infinity));
    return h("tr", {}, h("th", { scope: "row" }, facts.problems.name[p]), labels.map((code) => cell(p, code, least)));
  };
  const names = labels.map((code) => h("th", { scope: "col" }, h("div", {}, labelName(code))));
  const head = h("tr", {}, h("th", { scope: "col" }, "problem"), names);
  const made = h("table", { class: "matrix" }, h("thead", {}, head), h("tbody", {}, problems.map(lineOf)));
  made.querySelector("td[data-row]")?.setAttribute("tabindex", "0");
  const kinds = ["fastest", ...facts.status.names].filter((kind) => used.has(kind));
  const entry = (kind) => h("li", {}, h("span", { class: `cell k-${kind}` }, signOf(kind)), words(kind));
  const box = h("div", { class: "scroll", role: "region", "aria-label": "Problems by solvers", tabindex: "0" }, made);
  document.getElementById("matrix-place").replaceChildren(h("ul", { class: "key" }, kinds.map(entry)), box);
}

/* The arrow keys go from cell to cell, Enter opens the pair. */
function moveInMatrix(event) {
  const cell = event.target.closest("td[data-row]");
  const steps = { ArrowRight: [0, 1], ArrowLeft: [0, -1], ArrowDown: [1, 0], ArrowUp: [-1, 0] };
  if (!cell) return;
  if (event.key === "Enter") openPair(Number(cell.dataset.row));
  const step = steps[event.key];
  if (!step) return;
  event.preventDefault();
  const line = cell.parentElement, body = line.parentElement;
  const next = body.children[[...body.children].indexOf(line) + step[0]]?.children[cell.cellIndex + step[1]];
  if (next?.dataset.row === undefined) return;
  cell.setAttribute("tabindex", "-1");
  next.setAttribute("tabindex", "0");
  next.focus();
}

/* Pairs whose name has the text, of the status that is chosen. */
function listPairs() {
  const { problem, label, error } = page.columns, { problems } = page.facts, metric = metricOf();
  const text = document.getElementById("find").value.toLowerCase(), status = document.getElementById("status").value;
  const nameOf = (row) => `${problems.name[problem[row]]} ${labelName(label[row])} ${problems.family[problem[row]]}`;
  const fits = (row) => (!status || statusOf(row) === status) && nameOf(row).toLowerCase().includes(text);
  const rows = chosenRows().filter(fits);
  const line = (row) => [
    h("button", { type: "button", class: "link", onclick: () => openPair(row) }, problems.name[problem[row]]),
    labelName(label[row]),
    words(statusOf(row)),
    number(error[row]),
    written(metric, costOf(row) ?? NaN),
  ];
  const more = rows.length > LISTED ? `, the first ${LISTED} are shown` : "";
  const head = ["problem", "solver", "verdict", "error", words(metric.name)];
  document.getElementById("pair-list").replaceChildren(
    h("p", { class: "scope" }, `${rows.length} pairs${more}.`),
    table({ caption: "Pairs", head, rows: rows.slice(0, LISTED).map(line), right: [3, 4] }),
  );
}

/* ---- the sheet of a pair: what was measured, what it cost, what it said, and the command that runs it again */

function openPair(row) {
  const { facts, columns } = page, at = columns.detail[row] - 1, code = columns.problem[row];
  const text = (name) => (at < 0 ? "" : facts.texts[name][columns[`detail.${name}`][at]]);
  const value = (name) => (at < 0 ? NaN : (columns[`detail.${name}`]?.[at] ?? NaN));
  const origin = facts.origins[facts.problems.family[code]] ?? {}, group = groupOf(), kind = text("kind");
  const sizes = Object.entries(facts.problems.sizes[code]).map(([symbol, size]) => `${symbol} ${size}`).join(", ");
  const flags = text("flags").split(",").filter(Boolean).map((flag) => `${flag}: ${facts.notes.flags[flag] ?? ""}`);
  const status = statusOf(row), symbol = facts.status.symbols[columns.status[row]];
  const known = (name, how = number) => (Number.isFinite(value(name)) ? how(value(name)) : "");
  const times = ["convert", "setup", "solve", "lift"].filter((name) => Number.isFinite(value(name)));
  const entries = [
    ["verdict", h("span", { class: `badge k-${status}` }, `${symbol} ${words(status)}`)],
    ["claim", text("claim") || "none"],
    ["error", `${number(columns.error[row])} (tolerance ${number(group.tolerance)})`],
    ["error there", known("target_error") && `${known("target_error")} on the solver's own problem`],
    ["certainty", [text("certainty"), text("certificate")].filter(Boolean).join(": ")],
    ["from a solution", known("distance") && `at most ${known("distance")} of its size`],
    ["route", text("route") && `${text("route")}${kind ? `: ${kind}, ${facts.notes.kinds[kind] ?? ""}` : ""}`],
    ["flags", flags.join("; ")],
    ["start", text("started")],
    ["time", times.map((name) => `${name} ${seconds(value(name))}`).join(", ")],
    ["repeats", value("repeats") > 1 && `median of ${value("repeats")}, spread ${known("solve_iqr", seconds)}`],
    ["memory", Number.isFinite(columns.memory?.[row]) && `${bytes(columns.memory[row])} on top of what was there`],
    ["ended with", ["code", "signal"].filter((name) => known(name)).map((name) => `${name} ${known(name)}`).join(", ")],
    ["side by side", value("jobs") > 1 && `with up to ${value("jobs") - 1} other solves`],
    ["version", text("version")],
    ["problem", h("span", {}, h("code", {}, facts.problems.address[code]), sizes ? ` (${sizes})` : "")],
    ["its source", origin.source],
    ["its licence", origin.licence],
  ].filter(([, content]) => content);
  const numbers = (caption, json) => {
    const rows = Object.entries(json ? JSON.parse(json) : {}).map(([name, one]) => [name, number(one)]);
    return rows.length ? [h("h3", {}, caption), table({ caption, head: ["what", "value"], right: [1], rows })] : [];
  };
  const preformatted = (title, content) => (content ? [h("h3", {}, title), h("pre", { tabindex: "0" }, content)] : []);
  const absent = "Of so many rows this page has the facts of some failures only: the others are in the results file.";
  const dialog = document.getElementById("pair");
  const close = h("button", { type: "button", onclick: () => dialog.close() }, "Close");
  const title = `${facts.problems.name[code]} × ${labelName(columns.label[row])}`;
  dialog.replaceChildren(
    h("header", {}, h("h2", { id: "pair-title" }, title), close),
    h("div", { class: "body" },
      h("dl", {}, entries.flatMap(([name, content]) => [h("dt", {}, name), h("dd", {}, content)])),
      preformatted("Its log: what it said", text("message")),
      numbers("Residuals", text("parts")),
      numbers("Counters", text("counters")),
      at < 0 ? h("p", { class: "scope" }, absent) : preformatted("Again", text("command")),
    ),
  );
  writeAddress(row);
  if (!dialog.open) dialog.showModal();
}

/* ---- the page */

/* Controls of the formulation, its cost and family, two solvers, the size, and the list of solvers. */
function controls() {
  const { facts, state } = page, group = groupOf();
  const set = (name) => (value) => {
    state[name] = value;
    update();
  };
  const familiesOf = new Set(group.problems.map((code) => facts.problems.family[code]));
  const families = [...familiesOf].sort().map((one) => [one, one]);
  const groups = facts.groups.map((one, k) => [k, `${one.name} (${one.problems.length} × ${one.order.length})`]);
  const metrics = facts.metrics.map(({ name }) => [name, words(name)]);
  document.getElementById("choices").replaceChildren(
    select("Formulation", groups, state.group, (k) => choose(Number(k))),
    select("Cost", metrics, state.metric, set("metric")),
    families.length > 1 ? select("Family", [["", "all"], ...families], state.family, set("family")) : "",
  );
  const names = shownLabels().map((code) => [code, labelName(code)]);
  const change = (k) => (code) => {
    state.pair[k] = Number(code);
    draw("scatter");
  };
  if (!state.pair?.every((code) => shownLabels().includes(code))) state.pair = shownLabels().slice(0, 2);
  const two = state.pair.map((code, k) => select(["One", "Other"][k], names, code, change(k)));
  document.getElementById("two-solvers").replaceChildren(...two);
  const symbols = [...new Set(group.problems.flatMap((code) => Object.keys(facts.problems.sizes[code])))].sort();
  if (!symbols.includes(state.size)) state.size = symbols[0] ?? "";
  const resize = (symbol) => {
    state.size = symbol;
    draw("size");
  };
  const sizes = select("Size", symbols.map((one) => [one, one]), state.size, resize);
  document.getElementById("sizes").replaceChildren(sizes);
  const line = (code) => {
    const box = h("input", { type: "checkbox", checked: !state.hidden.has(code), onchange: () => {
      state.hidden[box.checked ? "delete" : "add"](code);
      update();
    } });
    return h("label", { class: "check" }, box, h("span", {}, labelName(code)));
  };
  document.getElementById("solver-list").replaceChildren(...group.order.map(line));
  const present = new Set(chosenRows().map(statusOf));
  const verdicts = facts.status.names.filter((name) => present.has(name)).map((name) => [name, words(name)]);
  const options = [["", "every verdict"], ...verdicts];
  const status = document.getElementById("status"), before = status.value;
  status.replaceChildren(...options.map(([value, text]) => h("option", { value, selected: value === before }, text)));
}

async function update() {
  controls();
  for (const place of document.querySelectorAll("[data-group-name]")) place.textContent = groupOf().name;
  writeAddress();
  matrix();
  listPairs();
  const two = page.state.pair.length > 1;
  document.getElementById("scatter-part").hidden = !two;
  for (const name of Object.keys(CHARTS)) {
    if (name !== "scatter" || two) await draw(name);
  }
}

function choose(group) {
  page.state = { ...initial(group), metric: page.state.metric };
  return update();
}

/* A click on the head of a table of the report sorts it by that column. */
function sortable(made) {
  const value = (line, k) => line.cells[k].textContent.trim();
  const key = (text) => {
    const units = { s: 1, ms: 1e-3, µs: 1e-6 }, found = text.match(/^([\d.e+-]+)(?: (s|ms|µs)\b|\b)/);
    if (text === "∞") return Infinity;
    return found && Number.isFinite(Number(found[1])) ? Number(found[1]) * (units[found[2]] ?? 1) : null;
  };
  [...made.tHead.rows[0].cells].forEach((cell, k) => {
    const sort = () => {
      const down = cell.getAttribute("aria-sort") === "ascending", lines = [...made.tBodies[0].rows];
      const order = (a, b) => {
        const x = key(value(a, k)), y = key(value(b, k));
        return x !== null && y !== null ? x - y : (x === null) - (y === null) || value(a, k).localeCompare(value(b, k));
      };
      lines.sort((a, b) => (down ? order(b, a) : order(a, b)));
      for (const other of made.tHead.rows[0].cells) other.removeAttribute("aria-sort");
      cell.setAttribute("aria-sort", down ? "descending" : "ascending");
      made.tBodies[0].append(...lines);
    };
    cell.replaceChildren(h("button", { type: "button", class: "sort", onclick: sort }, ...cell.childNodes));
  });
}

async function start() {
  document.getElementById("theme").addEventListener("click", () => {
    const { dataset } = document.documentElement;
    const now = dataset.theme ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    dataset.theme = now === "dark" ? "light" : "dark";
  });
  document.querySelectorAll("main .report table").forEach(sortable);
  Object.assign(page, await unpacked(document.getElementById("data").textContent));
  if (page.facts.groups.length) {
    page.state = stateOfAddress();
    const place = document.getElementById("matrix-place");
    place.addEventListener("click", (event) => {
      const cell = event.target.closest("td[data-row]");
      if (cell) openPair(Number(cell.dataset.row));
    });
    place.addEventListener("keydown", moveInMatrix);
    document.getElementById("find").addEventListener("input", listPairs);
    document.getElementById("status").addEventListener("change", listPairs);
    document.getElementById("pair").addEventListener("close", () => writeAddress());
    window.addEventListener("hashchange", async () => {
      const row = rowOfAddress();
      if (row >= 0) openPair(row);
    });
    const asked = rowOfAddress();
    await update();
    if (asked >= 0) openPair(asked);
  }
  const { section } = addressParts();
  if (section) document.getElementById(section)?.scrollIntoView();
  document.documentElement.dataset.ready = "";
}

start();
