"use strict";
/* Elements, and numbers as text. Whatever comes from the results is set as text or as an attribute, never as markup. */
const Dom = (() => {
  const SVG = "http://www.w3.org/2000/svg";

  /* An element: attributes, of which `on...` are listeners, and children, text or elements. */
  function h(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (value === null || value === undefined || value === false) continue;
      if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else if (key in made && typeof value === "boolean") made[key] = value;
      else made.setAttribute(key, value);
    }
    made.append(...children.flat().filter((child) => child !== null && child !== undefined));
    return made;
  }

  function svg(name, attributes, ...children) {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.append(...children);
    return made;
  }

  const region = (label, ...inside) =>
    h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": label }, ...inside);

  /* A table in a box that scrolls; `right` are the columns of numbers, the first column names its row. */
  function table({ caption, head, rows, right = [] }) {
    const side = (k) => (right.includes(k) ? "right" : null);
    const top = h("tr", {}, head.map((cell, k) => h("th", { scope: "col", class: side(k) }, cell)));
    const line = (cells) =>
      h("tr", {}, cells.map((cell, k) => (k ? h("td", { class: side(k) }, cell) : h("th", { scope: "row" }, cell))));
    const name = h("caption", { class: "visually-hidden" }, caption);
    return region(caption, h("table", {}, name, h("thead", {}, top), h("tbody", {}, rows.map(line))));
  }

  /* A box that opens, whose contents are made when it is opened. */
  function folded(title, make) {
    const box = h("details", {}, h("summary", {}, title));
    box.addEventListener("toggle", () => {
      if (box.open && box.children.length === 1) box.append(make());
    });
    return box;
  }

  const option = (chosen) => ([key, text]) => h("option", { value: key, selected: String(key) === String(chosen) }, text);

  /* A named select whose options [value, text] depend on the filters; what was chosen is shown wherever it is offered. */
  function chooser(text, changed) {
    let wanted = null;
    const choose = (value) => {
      wanted = String(value);
      changed();
    };
    const select = h("select", { onchange: () => choose(select.value) });
    const offer = (options, preferred = options[0]?.[0]) => {
      const there = options.some(([key]) => String(key) === wanted);
      select.replaceChildren(...options.map(option(there ? wanted : preferred)));
    };
    return { box: h("label", {}, h("span", {}, text), select), choose, offer, value: () => select.value };
  }

  const check = (text, set) => {
    const box = h("input", { type: "checkbox", onchange: (e) => set(e.target.checked) });
    return h("label", { class: "check" }, box, h("span", {}, text));
  };

  function digits(value) {
    const size = Math.abs(value);
    if (value !== 0 && (size >= 1e5 || size < 1e-3))
      return value.toExponential(1).replace("e+", "e").replace(".0e", "e");
    return String(Number(value.toPrecision(3)));
  }

  function number(value) {
    if (value === null || value === undefined || Number.isNaN(value)) return "—";
    return Number.isFinite(value) ? digits(value) : "∞";
  }

  function seconds(value) {
    if (value === null || !Number.isFinite(value)) return number(value);
    if (value >= 1) return `${digits(value)} s`;
    return value >= 1e-3 ? `${digits(value * 1e3)} ms` : `${digits(value * 1e6)} µs`;
  }

  function bytes(value) {
    if (!Number.isFinite(value)) return number(value);
    return value >= 2 ** 30 ? `${digits(value / 2 ** 30)} GiB` : `${digits(value / 2 ** 20)} MiB`;
  }

  const percent = (share) => (Number.isFinite(share) ? `${Math.round(100 * share)} %` : "—");
  const counted = (value, noun, nouns = `${noun}s`) => `${value} ${value === 1 ? noun : nouns}`;
  const cost = ({ unit }, value) => (unit === "s" ? seconds : unit === "byte" ? bytes : number)(value);

  return Object.freeze({
    h, svg, region, table, folded, option, chooser, check, number, seconds, bytes, percent, counted, cost,
  });
})();
