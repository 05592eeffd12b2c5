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

  /* A table in a box that scrolls; `right` are the columns of numbers, the first column names its row. */
  function table({ caption, head, rows, right = [] }) {
    const numbers = new Set(right),
      side = (k) => (numbers.has(k) ? "right" : null);
    return h(
      "div",
      { class: "scroll", tabindex: "0", role: "region", "aria-label": caption },
      h(
        "table",
        {},
        h("caption", { class: "visually-hidden" }, caption),
        h(
          "thead",
          {},
          h(
            "tr",
            {},
            head.map((cell, k) => h("th", { scope: "col", class: side(k) }, cell)),
          ),
        ),
        h(
          "tbody",
          {},
          rows.map((row) =>
            h(
              "tr",
              {},
              row.map((cell, k) => (k ? h("td", { class: side(k) }, cell) : h("th", { scope: "row" }, cell))),
            ),
          ),
        ),
      ),
    );
  }

  /* What a box says when it is opened, made only then. */
  function folded(title, make) {
    const box = h("details", {}, h("summary", {}, title));
    box.addEventListener("toggle", () => {
      if (box.open && box.children.length === 1) box.append(make());
    });
    return box;
  }

  const digits = (value) => {
    if (value === 0) return "0";
    const size = Math.abs(value);
    return size >= 1e5 || size < 1e-3
      ? value.toExponential(1).replace("e+", "e").replace(".0e", "e")
      : String(Number(value.toPrecision(3)));
  };

  function number(value) {
    if (value === null || value === undefined || Number.isNaN(value)) return "—";
    return Number.isFinite(value) ? digits(value) : "∞";
  }

  function seconds(value) {
    if (value === null || value === undefined || !Number.isFinite(value)) return number(value);
    if (value >= 1) return `${digits(value)} s`;
    return value >= 1e-3 ? `${digits(value * 1e3)} ms` : `${digits(value * 1e6)} µs`;
  }

  function bytes(value) {
    if (!Number.isFinite(value)) return number(value);
    return value >= 2 ** 30 ? `${digits(value / 2 ** 30)} GiB` : `${digits(value / 2 ** 20)} MiB`;
  }

  const percent = (share) => (Number.isFinite(share) ? `${Math.round(100 * share)} %` : "—");
  const counted = (value, noun, nouns = `${noun}s`) => `${value} ${value === 1 ? noun : nouns}`;
  const cost = (metric, value) =>
    metric.unit === "s" ? seconds(value) : metric.unit === "byte" ? bytes(value) : number(value);

  return Object.freeze({ h, svg, table, folded, number, seconds, bytes, percent, counted, cost });
})();
