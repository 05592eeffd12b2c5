"use strict";
/* Figures of the page: each kind is asked for what it has to show of the present selection, and drawn when it comes
   into view (or when the browser has nothing else to do). A figure has chips that name its curves, the chart, a guide
   how to read it with its numbers, and the same as a table. */
const Figures = (() => {
  const { h, svg } = Dom;
  const kinds = [], boxes = new Map();
  let context = null, watcher = null;

  /* kind: {id, title, controls(changed) -> elements, adjust(context), build(context) -> {spec | content, guide, numbers,
     labels, table, summary} | {empty}} */
  const register = (kind) => kinds.push(kind);

  function mount(redraw) {
    const seen = (entries) => {
      for (const entry of entries) {
        const box = boxes.get(entry.target.dataset.figure);
        box.visible = entry.isIntersecting;
        if (box.visible) show(box);
      }
    };
    watcher = new IntersectionObserver(seen, { rootMargin: "300px" });
    for (const kind of kinds) {
      const place = document.querySelector(`[data-figure="${kind.id}"]`);
      if (!place) continue; // the run has nothing for its section
      const box = { kind, place, dirty: true, visible: false, view: null };
      box.chips = h("ul", { class: "chips" });
      box.chart = h("div", { class: "chart", role: "img" });
      box.caption = h("figcaption");
      box.fold = h("div");
      const figure = h("figure", { id: `figure-${kind.id}` }, box.chips, box.chart, box.caption, box.fold);
      place.append(...(kind.controls ? [h("div", { class: "controls" }, kind.controls(redraw))] : []), figure);
      boxes.set(kind.id, box);
      watcher.observe(place);
    }
  }

  /* A new selection: what is in view is drawn at once, the rest when there is time. */
  function update(next) {
    context = next;
    for (const box of boxes.values()) {
      box.dirty = true;
      box.kind.adjust?.(next);
      if (box.visible) show(box);
    }
    later();
  }

  const idle = window.requestIdleCallback ?? ((work) => setTimeout(work, 120));
  const later = () =>
    idle(() => {
      const box = [...boxes.values()].find((b) => b.dirty);
      if (box) show(box).then(later);
    });

  /* One after another, each painted before the next is made: the first is there as soon as it can be. */
  let line = Promise.resolve();
  function show(box) {
    line = line.then(() => made(box)).catch(reportError);
    return line;
  }

  async function made(box) {
    if (!box.dirty || !context) return;
    await draw(box);
    await new Promise((done) => setTimeout(done));
  }

  async function draw(box) {
    box.dirty = false;
    const made = box.kind.build(context), { title } = box.kind;
    box.view?.finalize();
    box.view = null;
    box.chips.replaceChildren(...(made.labels ? chips(made.labels, made.dashes) : []));
    box.caption.replaceChildren(...(made.guide ? [h("span", { class: "numbers" }, made.numbers ?? ""), " ", made.guide] : []));
    const table = () => Dom.table({ caption: title, ...made.table() });
    box.fold.replaceChildren(...(made.table ? [Dom.folded("As a table", table)] : []));
    box.chart.replaceChildren();
    for (const name of ["role", "aria-label"]) box.chart.removeAttribute(name);
    if (made.empty) box.chart.append(h("p", { class: "empty" }, made.empty));
    else if (made.content) box.chart.append(made.content);
    else {
      box.chart.setAttribute("role", "img");
      box.chart.setAttribute("aria-label", `${title}. ${made.summary ?? ""} The same numbers are in the table below.`);
      const surface = h("div", { "aria-hidden": "true" }); // the box around it has the role and the name
      box.chart.append(surface);
      const view = await Charts.draw(surface, made.spec);
      if (box.chart.contains(surface)) box.view = view;
      else view.finalize();
    }
  }

  /* A label stands out in every figure that has it; '' for none. */
  function focus(name) {
    for (const { view, visible } of boxes.values()) {
      try {
        if (visible) view?.signal("focus", name).runAsync();
      } catch {
        /* a chart without curves of labels */
      }
    }
  }

  function swatch(slot, dash) {
    const grey = slot < 0, dashed = grey ? dash : slot,
      width = grey && dash === undefined ? 1.2 : 2.4;
    const line = { x1: 0, x2: 26, y1: 6, y2: 6, stroke: grey ? "var(--other)" : Charts.COLOURS[slot], "stroke-width": width };
    if (dashed > 0) line["stroke-dasharray"] = Charts.DASHES[dashed].join(" ");
    return svg("svg", { class: "swatch", viewBox: "0 0 26 12", "aria-hidden": "true" }, svg("line", line));
  }

  /* The dashes of the labels without a colour, in a figure with so few of them that each can be named: a colour stands
     for one solver on the whole page, so that none is given here. */
  function dashes({ slots }, labels) {
    const grey = labels.filter((s) => !slots.has(s));
    return new Map(grey.length <= Charts.SLOTS ? grey.map((s, k) => [s, k]) : []);
  }

  /* The names of curves with their look; the grey ones that have no dash of their own are counted. */
  function chips(labels, dashed = new Map()) {
    const { slots, name, marks } = context;
    const named = labels.filter((s) => slots.has(s) || dashed.has(s)),
      grey = labels.length - named.length;
    const chip = (s) => {
      const pointed = { onmouseenter: () => focus(name(s)), onmouseleave: () => focus("") };
      return h("li", pointed, swatch(slots.get(s) ?? -1, dashed.get(s)), h("span", {}, name(s), ...marks(s)));
    };
    return [...named.map(chip), ...(grey ? [h("li", {}, swatch(-1), `${grey} more in grey`)] : [])];
  }

  return Object.freeze({ register, mount, update, focus, dashes, swatch, boxes });
})();
