"use strict";
/* Performance and data profiles of what is chosen. */
{
  const { h } = Dom;
  const BANDED = 3; // bands that are shown at once: more of them cover each other
  const NOTHING = "Nothing is left of the chosen problems and solvers: loosen the filters.";
  let banded = false;

  /* The ends of the bands of the coloured curves, as areas; none for a filter that they were not made for. */
  function bandsOf({ group: { bands }, whole, byHeight, slots, name }, upto) {
    if (!banded || !whole || !bands?.labels.length) return [];
    const leaders = byHeight.map((c) => c.label).filter((s) => slots.has(s) && bands.labels.includes(name(s))),
      last = bands.taus.length - 1;
    return leaders.flatMap((s, place) => {
      const line = { label: name(s), slot: slots.get(s), first: place < BANDED },
        k = bands.labels.indexOf(line.label);
      const ends = (j) => ({ low: bands.low[k][Math.min(j, last)], high: bands.high[k][Math.min(j, last)] });
      return [...bands.taus, upto].map((x, j) => ({ ...line, x, ...ends(j) }));
    });
  }

  /* A sentence about the bands, drawn or not. */
  function bandsText({ group: { bands }, whole, data }) {
    if (!banded) return "";
    if (!bands) return ` There are no bands: ${data.facts.rows} rows are too many for them.`;
    if (!bands.labels.length) return " There are no bands: with fewer than 5 families of problems they would say nothing.";
    if (!whole)
      return " Bands were computed for all problems and solvers of the formulation, their times and the planned tolerance: they do not hold for what is chosen now, and are not drawn.";
    const few = bands.few ? "; with so few a rough guess" : "";
    return ` Bands hold for what is chosen now, all problems and solvers, and for no other filter: 95 % at each τ by itself, ${Dom.counted(bands.families, "family", "families")} drawn again ${bands.replicates} times${few}. They are shown of the first ${BANDED} solvers in colour, of others while the pointer is on their name.`;
  }

  /* The curves as steps between the ends of the axis x, and as a table of their heights at some places. */
  function staircase(context, curves, [low, high], x, places, heading, extra = []) {
    const drawn = curves.filter((c) => c.solved),
      y = { scale: { domain: [0, 1] }, axis: { title: "fraction of problems", format: "%", tickCount: 5 } };
    const look = (s) => ({ label: context.name(s), slot: context.slots.get(s) ?? -1 });
    const values = drawn.flatMap((c) => Charts.corners(c, low, high).map((corner) => ({ ...look(c.label), ...corner })));
    const line = (c) => [
      h("span", {}, context.name(c.label), ...context.marks(c.label)),
      ...[...places].map((at) => Dom.percent(Rows.height(c, at))),
      String(c.solved),
      String(c.problems),
    ];
    const rank = new Map(context.byHeight.map((c, k) => [c.label, k]));
    const order = [...curves].sort((a, b) => rank.get(a.label) - rank.get(b.label));
    return {
      spec: Charts.lines({ values, extra, x, y }),
      labels: order.filter((c) => c.solved).map((c) => c.label),
      numbers: context.numbers,
      summary: `${context.name(order[0].label)} solves most, ${Dom.percent(Rows.height(order[0], Infinity))}.`,
      table: () => ({
        head: ["solver", ...places.map(heading), "solved", "of"],
        right: [...places.keys(), places.length, places.length + 1].map((k) => k + 1),
        rows: order.map(line),
      }),
    };
  }

  Figures.register({
    id: "profile",
    title: "Performance profile",
    adjust(context) {
      this.box.hidden = Boolean(context.group.bands && !context.group.bands.labels.length);
    },
    controls(changed) {
      const check = Dom.check("95 % bands over problem families", (on) => {
        banded = on;
        changed();
      });
      check.firstChild.id = "profile-bands";
      return [(this.box = check)];
    },
    build(context) {
      const { curves, metricName } = context,
        ends = curves.filter((c) => c.solved).map((c) => c.at.at(-1));
      if (!ends.length) return { empty: NOTHING, labels: [] };
      const upto = Math.max(2, Math.max(1, ...ends) * 1.06),
        title = `τ: ${metricName} / least ${metricName} (failures: ∞)`,
        bands = bandsOf(context, upto);
      const x = Charts.log(title, 1, upto, Charts.TINY),
        extra = bands.length ? [Charts.bands(bands)] : [];
      return {
        ...staircase(context, curves, [1, upto], x, [1, 2, 5, 10, 100], (tau) => `τ = ${tau}`, extra),
        guide: `Height at τ: fraction of the problems solved within τ times the ${metricName} of the best solver shown (left end: it was the best; right end: solved at all).${context.floorText}${context.leftOutText}${bandsText(context)}`,
      };
    },
  });

  Figures.register({
    id: "budget",
    title: "Data profile",
    build(context) {
      const { metric, metricName } = context, curves = Rows.curves(context.matrix);
      const ends = curves.flatMap((c) => [c.at.find((x) => x > 0), c.at.at(-1)]).filter((x) => x > 0);
      if (!curves.some((c) => c.solved)) return { empty: NOTHING };
      const low = Math.max(Math.min(...ends) / 1.2, metric.floor ? metric.floor / 10 : 0),
        high = Math.max(...ends, low * 2) * 1.2,
        x = Charts.log(`budget: ${metricName}`, low, high, Charts.unitText(metric));
      const budgets = Charts.logTicks(low, high).slice(-5);
      return {
        ...staircase(context, curves, [low, high], x, budgets, (b) => `within ${Dom.cost(metric, b)}`),
        guide:
          "The height of a curve is the fraction of the problems that the solver solved within that budget; no solver is measured against another, so that a curve stays what it is whoever else is shown.",
      };
    },
  });
}
