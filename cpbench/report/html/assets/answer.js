"use strict";
/* The answer of the formulation that is chosen: its sentence, and the first lines of its ranking. Both are of all its
   problems and solvers, whatever is filtered. */
const Answer = (() => {
  const { h } = Dom;

  function say(group) {
    const place = document.querySelector("[data-answer]");
    for (const button of document.querySelectorAll(".choice"))
      button.setAttribute("aria-pressed", button.firstChild.textContent === group.name);
    const { sentence, title } = group.answer;
    place.replaceChildren(h("strong", {}, group.name), `${title ? ` (${title})` : ""}: ${sentence}`);
  }

  Figures.register({
    id: "answer",
    title: "Ranking",
    build(context) {
      const { rows, more } = context.group.answer;
      if (!rows.length) return { empty: "No solver was started." };
      const lines = rows.map(([solver, route, others, solved, started, median, factor, remarks]) => [
        h("span", { class: "solver" }, Figures.swatch(context.slotOf(solver)), " ", solver, ...context.marksOf(solver, "")),
        `${solved} of ${started}`,
        Dom.seconds(median),
        Dom.number(factor),
        others ? `${route} and ${others} more` : route || "—",
        remarks.join(", "),
      ]);
      const content = Dom.table({
        caption: "Ranking",
        head: ["solver", "solved", "median", "× fastest", "route", "remarks"],
        rows: lines,
        right: [1, 2, 3],
      });
      return {
        content,
        numbers: more ? `The first ${rows.length} of ${rows.length + more} solvers.` : "",
        guide:
          "Solved: of the problems that the solver was started on; problems that it cannot handle are not counted. Median: of its times where it solved. × fastest: geometric mean of its time over that of the fastest solver there.",
      };
    },
  });

  return Object.freeze({ say });
})();
