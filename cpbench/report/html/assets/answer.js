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
      const lines = rows.map(([solver, route, others, solved, counted, lost, median, factor, error, remarks]) => [
        h("span", { class: "solver" }, Figures.swatch(context.slotOf(solver)), " ", solver, ...context.marksOf(solver, "")),
        `${solved} of ${counted}`,
        lost || "·",
        Dom.seconds(median),
        Dom.number(factor),
        Dom.number(error),
        others ? `${route} and ${others} more` : route || "—",
        remarks.join(", "),
      ]);
      const content = Dom.table({
        caption: "Ranking",
        head: ["solver", "solved", "lost", "median", "× fastest", "error", "route", "remarks"],
        rows: lines,
        right: [1, 2, 3, 4, 5],
      });
      return {
        content,
        numbers: more ? `The first ${rows.length} of ${rows.length + more} solvers.` : "",
        guide:
          "Solved: of the problems that the solver was started on; problems that it cannot handle are not counted. Lost: answers that a conversion lost, which are charged to the conversion and are not among these problems. Median: of its times where it solved. × fastest: geometric mean of its time over that of the fastest solver there. Error: median of what it reached where it solved. Order: solvers whose numbers of solved problems do not differ (exact McNemar test, 5 %) are in order of time.",
      };
    },
  });

  return Object.freeze({ say });
})();
