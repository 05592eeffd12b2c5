"use strict";
/* Figures and tables of numbers that cpbench computed of all problems of a formulation at the planned tolerance. Of
   their lines the page shows those of the solvers that are chosen; it computes nothing here. */
const Prepared = (() => {
  const { h } = Dom;
  const MOST = 16;

  /* The answer of the group that is chosen: its sentence. */
  function say({ name, answer: { sentence, title } }) {
    for (const button of document.querySelectorAll(".choice"))
      button.setAttribute("aria-pressed", button.firstChild.textContent === name);
    const text = `${title ? ` (${title})` : ""}: ${sentence}`;
    document.querySelector("[data-answer]").replaceChildren(h("strong", {}, name), text);
  }

  const right = (head) => head.slice(1).map((_, k) => k + 1);

  /* Dots with intervals: lines of {label, shown, v, low, high, note, cells}. */
  function dots(context, { head, lines }, empty, { scale, axis, note, extra, ...words }) {
    const own = lines.filter(({ label }) => context.shows(label)),
      drawn = own.filter(({ v }) => v !== null),
      values = drawn.slice(0, MOST).map(({ label, shown, v, low, high, note }) => ({
        ...{ label: shown ?? label, slot: context.slotOf(label), note },
        ...{ v, low: low ?? v, high: high ?? v },
      }));
    const name = ({ label, kind }) => h("span", {}, label, ...context.marksOf(label, kind)),
      table = () => ({ head, right: right(head), rows: own.map((line) => [name(line), ...line.cells]) });
    if (!values.length) return { empty, table };
    const spread = Charts.extent(values.flatMap(({ v, low, high }) => [v, low, high])),
      range = scale ? { scale, axis } : Charts.log(axis, Math.min(0.5, spread[0]) / 1.1, Math.max(2, spread[1]) * 1.1, Charts.TINY);
    const rest = drawn.length > MOST ? ` The first ${MOST} of ${drawn.length} solvers.` : "";
    const tooltip = note ? [{ field: "note", title: note }] : [];
    return {
      spec: Charts.dots({ values, ...range, tooltip, extra: extra?.(range.scale) }),
      numbers: context.prepared + rest,
      table,
      ...words,
    };
  }

  const share = (title) => ({ scale: { domain: [0, 1] }, axis: { title, format: "%", tickCount: 5 } });

  Figures.register({
    id: "answer",
    title: "Ranking",
    build(context) {
      const { head, lines, more } = context.group.answer;
      if (!lines.length) return { empty: "No solver was started." };
      const name = (label) => [Figures.swatch(context.slotOf(label)), " ", label, ...context.marksOf(label, "")];
      const rows = lines.map(([label, ...cells]) => [h("span", { class: "solver" }, ...name(label)), ...cells]);
      return {
        content: Dom.table({ caption: "Ranking", head, rows, right: [1, 2, 3, 4, 5] }),
        numbers: more ? `The first ${rows.length} of ${rows.length + more} solvers.` : "",
        guide: context.facts.notes.answer,
      };
    },
  });

  Figures.register({
    id: "ranking",
    title: "Problems solved",
    build(context) {
      const made = context.group.ranking,
        bars = made.few ? "" : " Bar: 95 % bootstrap interval over problem families.";
      return dots(context, made, "No solver that is chosen took part.", {
        ...share("fraction solved of the problems that it ran on"),
        note: "solved",
        guide: `Dot: fraction solved of the problems that the solver was started on; problems that it cannot handle, and answers that a conversion lost, are not counted.${bars}`,
      });
    },
  });

  Figures.register({
    id: "warm",
    title: "Warm over cold",
    build(context) {
      const made = context.facts.warm[context.group.node];
      if (!made) return { empty: "No pair of this formulation was run from two starts." };
      const level = { data: { values: [{ v: 1 }] }, mark: { type: "rule", opacity: 0.5 } };
      return dots(context, made, "No pair was solved from both starts.", {
        axis: ["time of the warm solve", "over that of the cold one"],
        extra: (scale) => [{ ...level, encoding: { x: Charts.quantity("v", { scale }) } }],
        numbers: "Computed by cpbench of the whole run; only the solvers are those that are chosen.",
        guide:
          "A dot is the geometric mean, over the problems solved from both starts, of the time from the warm start over that from the cold one; left of 1 the warm start is ahead. Bars: 95 % over sequences or families.",
      });
    },
  });

  Figures.register({
    id: "precision",
    title: "Error against time, over the problems",
    build(context) {
      const { lines, head, rows } = context.group.precision;
      const drawn = lines.filter(({ label }) => context.shows(label));
      if (!drawn.length) return { empty: Paths.none(context) ?? "No error was reached on half of the problems." };
      const labels = drawn.map(({ label }) => context.placeOf(label)),
        dashes = Figures.dashes(context, labels);
      const values = drawn.flatMap(({ label, seconds, error }, k) => {
        const look = { label, slot: context.slotOf(label), dash: dashes.get(labels[k]) };
        return seconds.map((x, j) => ({ ...look, x, y: error[j] }));
      });
      return {
        ...Paths.errors({ values, title: "judged error, on half of the problems" }),
        labels,
        dashes,
        numbers: context.prepared,
        guide: context.group.precision.guide,
        table: () => ({ head, right: right(head), rows: rows.filter(([label]) => context.shows(label)) }),
      };
    },
  });

  return Object.freeze({ say });
})();
