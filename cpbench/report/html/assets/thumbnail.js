"use strict";
/* The picture of a problem: where its matrices have entries, what its contacts do in the best answer that is known, or
   the complementary cones of an LCP with two unknowns. The numbers are those of cpbench/analysis/thumbnails.py. */
const Thumbnail = (() => {
  const { h, svg } = Dom;
  const DECADES = 6, LARGEST = 168, LEAST = 26, AREAS = ["none", "one", "two", "both"],
    NAMES = ["z = 0", "z₁ > 0", "z₂ > 0", "z₁, z₂ > 0"];

  const drawing = (label, box, width, height, ...children) =>
    svg("svg", { viewBox: box.join(" "), width, height, role: "img", "aria-label": label }, ...children);
  const square = (label, reach, size, ...children) =>
    drawing(label, [-reach, -reach, 2 * reach, 2 * reach], size, size, ...children);
  const figure = (drawn, guide, name) =>
    h("figure", { class: "thumbnail", "data-thumbnail": name }, drawn, h("figcaption", {}, guide));
  const text = (x, y, words, more = {}) => svg("text", { x, y, ...more }, words);
  const path = (name, d) => svg("path", { class: name, d });
  const disk = (cx, cy, r) => svg("circle", { class: "sticks", cx, cy, r });
  const note = (words) => h("p", { class: "scope" }, words);

  /* Cells of equal shade as one path, runs of a row joined. */
  function shades(cells, width) {
    const paths = Array(DECADES + 1).fill("");
    for (let at = 0; at < cells.length;) {
      const end = Math.min(cells.length, at - (at % width) + width), from = at;
      while (at < end && cells[at] === cells[from]) at++;
      paths[Number(cells[from])] += `M${from % width} ${Math.floor(from / width)}h${at - from}v1h-${at - from}z`;
    }
    const drawn = (d, shade) => (d && shade ? [svg("path", { d, "fill-opacity": 0.08 + (0.8 * shade) / DECADES })] : []);
    return paths.flatMap(drawn);
  }

  function block({ name, rows, cols, nonzeros, step, cells }, longest) {
    const width = Math.ceil(cols / step), height = cells.length / width,
      side = (count) => Math.max(LEAST, (LARGEST * count) / longest),
      filled = svg("g", { fill: "currentColor", "shape-rendering": "crispEdges" }, ...shades(cells, width)),
      label = `Where ${name}: ${rows} × ${cols}, ${Dom.counted(nonzeros, "nonzero")} stand`;
    const paper = svg("rect", { class: "paper", width, height }),
      drawn = drawing(label, [0, 0, width, height], side(cols), side(rows), paper, filled);
    drawn.setAttribute("preserveAspectRatio", "none");
    return h("div", { class: "block" }, h("div", {}, h("b", {}, name), ` ${rows} × ${cols}`), drawn);
  }

  function blocks(rows) {
    const all = rows.flat().filter(Boolean),
      sum = (of) => all.reduce((total, b) => total + of(b), 0);
    if (!all.length) return null;
    const longest = Math.max(...all.flatMap((b) => [b.rows, b.cols])),
      entries = sum((b) => b.nonzeros),
      share = Dom.number((100 * entries) / sum((b) => b.rows * b.cols)),
      step = Math.max(...all.map((b) => b.step)),
      cell = step > 1 ? `a square of up to ${step} × ${step} entries` : "an entry",
      style = `grid-template-columns: repeat(${rows[0].length}, max-content)`;
    return figure(
      h("div", { class: "blocks", style }, rows.flat().map((b) => (b ? block(b, longest) : h("div")))),
      `${Dom.counted(entries, "nonzero")}, ${share} % of the entries: a filled cell is ${cell}, ten times smaller a shade fainter, an empty one has zeros only.`,
      "blocks",
    );
  }

  /* A contact that sticks is a disk, one that slips a triangle; its area grows with the normal force. */
  function mark(x, y, slips, force, title) {
    const r = 0.022 + 0.05 * Math.sqrt(Math.max(force, 0) / 1000),
      sign = slips ? path("slips", `M${x} ${y - 1.25 * r}l${1.1 * r} ${2 * r}h${-2.2 * r}z`) : disk(x, y, r);
    sign.append(svg("title", {}, title));
    return sign;
  }

  function contacts({ counts, largest, place, slips, force, share }, answer) {
    const [across, along] = share, widest = Math.max(1000, ...share.flat().map(Math.abs)) / 1000,
      far = widest > 1.02 ? widest + 0.12 : 1.14;
    const marks = place.map((number, k) => {
      const y = along ? -along[k] / 1000 : 1 - (2 * force[k]) / 1000,
        reaction = Dom.number((largest * force[k]) / 1000);
      const title = `contact ${number}: ${slips[k] ? "slips" : "sticks"}, normal reaction ${reaction}`;
      return mark(across[k] / 1000, y, slips[k], force[k], title);
    });
    const round = along
      ? [svg("circle", { class: "paper", r: 1 }), path("axis", "M-1 0H1M0 -1V1")]
      : [svg("rect", { class: "paper", x: -1, y: -1.08, width: 2, height: 2.16 }), path("axis", "M-1 1H1M0 -1V1")];
    const label = `Contacts: ${counts.stick} stick, ${counts.slip} slip, ${counts.open} are open`,
      drawn = square(label, far, LARGEST + 24, ...round, ...marks),
      signs = h("div", { class: "signs" }, `● ${counts.stick} stick  ▲ ${counts.slip} slip  ○ ${counts.open} open`);
    const few =
      place.length < counts.stick + counts.slip ? ` Drawn are the ${place.length} with the largest normal force.` : "";
    const whose = answer ? `the answer of ${answer.label} (error ${Dom.number(answer.error)})` : "the best answer",
      where = along
        ? "inside the circle it sticks, on the rim it slips"
        : "its normal force upwards: inside the strip it sticks, on its edges it slips";
    return figure(
      h("div", {}, drawn, signs),
      `Each contact that pushes in ${whose}, at its friction over the largest that it can have, r_T/(μ r_N)${along ? ": " : ", "}${where}; the larger the mark, the larger the normal force.${few}`,
      "contacts",
    );
  }

  function cones({ cones: all, q, solutions, p, zero }) {
    const point = ([x, y], size = 1) => [(size * x) / 1000, (-size * y) / 1000], fills = [],
      rays = [],
      names = [];
    all.forEach(({ edges, flat }, k) => {
      const [a, b] = edges.map((e) => point(e)), far = edges.map((e) => point(e, 4));
      rays.push(...far.map((f) => path("axis", `M0 0L${f}`)));
      if (flat) return;
      // far corners alone would cut a wide cone short
      const sum = [a[0] + b[0], a[1] + b[1]], size = Math.hypot(...sum) || 1,
        along = (length) => sum.map((v) => (length * v) / size);
      fills.push(path(`cone ${AREAS[k]}`, `M0 0L${far[0]}L${along(4)}L${far[1]}z`));
      names.push(text(...along(0.8), NAMES[k]));
    });
    const held = all.filter((c) => c.holds).length, [x, y] = point(q, 0.95),
      label = `The plane of q: it lies in ${held} of 4 complementary cones`,
      mine = zero ? [] : [disk(x, y, 0.045), text(x + 0.1, y + 0.03, "q", { class: "q" })];
    const vectors = solutions.map((z) => `(${z.map(Dom.number).join(", ")})`).join(", "),
      flat = all.filter((c) => c.flat).length,
      kind = p
        ? "M is a P-matrix: the cones fill the plane without overlapping"
        : "M is not a P-matrix: cones overlap, are flat or leave gaps";
    return figure(
      square(label, 1.3, LARGEST + 60, ...fills, ...rays, ...names, ...mine),
      `Each of the 4 cones that holds q gives a solution; ${held || "none"} of them ${held === 1 ? "does" : "do"}${vectors ? `: z = ${vectors}` : ""}. ${kind}${flat ? ` (${flat} of 4 are flat)` : ""}.`,
      "cones",
    );
  }

  /* Figures of a problem, or words why there is none. */
  function draw(made) {
    if (!made) return [note("This page was made without pictures of its problems.")];
    if (made.why) return [note(`No picture: ${made.why}`)];
    const drawn = [
      made.cones && cones(made.cones),
      made.blocks && blocks(made.blocks),
      made.contacts && contacts(made.contacts, made.answer),
      made.unanswered && note("What its contacts do has no picture: no verified answer was kept."),
    ].filter(Boolean);
    return drawn.length ? [h("div", { class: "thumbnails" }, drawn)] : [note("It has no matrix.")];
  }

  return Object.freeze({ draw });
})();
