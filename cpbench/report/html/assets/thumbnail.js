"use strict";
/* The picture of a problem: where its matrices have entries, what its contacts do in the best answer that is known, or
   the complementary cones of an LCP with two unknowns. The numbers are those of cpbench/analysis/thumbnails.py. */
const Thumbnail = (() => {
  const { h, svg } = Dom;
  const DECADES = 6,
    LARGEST = 168,
    LEAST = 26,
    AREAS = ["none", "one", "two", "both"];

  const drawing = (told, box, width, height, ...children) =>
    svg("svg", { viewBox: box.join(" "), width, height, role: "img", "aria-label": told }, ...children);
  const figure = (drawn, guide, name) =>
    h("figure", { class: "thumbnail", "data-thumbnail": name }, drawn, h("figcaption", {}, guide));
  const text = (x, y, words, more = {}) => svg("text", { x, y, ...more }, words);

  /* Cells of equal shade as one path, runs of a row joined. */
  function shades(cells, width) {
    const paths = Array.from({ length: DECADES + 1 }, () => "");
    for (let at = 0; at < cells.length;) {
      const end = Math.min(cells.length, at - (at % width) + width),
        from = at;
      while (at < end && cells[at] === cells[from]) at++;
      paths[Number(cells[from])] += `M${from % width} ${Math.floor(from / width)}h${at - from}v1h-${at - from}z`;
    }
    return paths
      .map((d, shade) => (d && shade ? svg("path", { d, "fill-opacity": 0.08 + (0.8 * shade) / DECADES }) : null))
      .filter(Boolean);
  }

  const shape = ({ name, rows, cols, nonzeros }) => `${name}: ${rows} × ${cols}, ${Dom.counted(nonzeros, "nonzero")}`;

  function block(made, longest) {
    const width = Math.ceil(made.cols / made.step),
      high = made.cells.length / width,
      side = (count) => Math.max(LEAST, (LARGEST * count) / longest);
    const drawn = drawing(
      `Where ${shape(made)} stand`,
      [0, 0, width, high],
      side(made.cols),
      side(made.rows),
      svg("rect", { class: "paper", width, height: high }),
      svg("g", { fill: "currentColor", "shape-rendering": "crispEdges" }, ...shades(made.cells, width)),
    );
    drawn.setAttribute("preserveAspectRatio", "none");
    return h("div", { class: "block" }, h("div", {}, h("b", {}, made.name), ` ${made.rows} × ${made.cols}`), drawn);
  }

  function blocks(rows) {
    const all = rows.flat().filter(Boolean);
    if (!all.length) return null;
    const longest = Math.max(...all.flatMap((b) => [b.rows, b.cols])),
      entries = all.reduce((sum, b) => sum + b.nonzeros, 0),
      whole = all.reduce((sum, b) => sum + b.rows * b.cols, 0),
      step = Math.max(...all.map((b) => b.step));
    const grid = h(
      "div",
      { class: "blocks", style: `grid-template-columns: repeat(${rows[0].length}, max-content)` },
      rows.flat().map((b) => (b ? block(b, longest) : h("div"))),
    );
    const cell = step > 1 ? `a square of up to ${step} × ${step} entries` : "an entry";
    return figure(
      grid,
      `${Dom.counted(entries, "nonzero")}, ${Dom.number((100 * entries) / whole)} % of the entries: a filled cell is ${cell}, ten times smaller a shade fainter, an empty one has zeros only.`,
      "blocks",
    );
  }

  /* A contact that sticks is a disk, one that slips a triangle; its area grows with the normal force. */
  function mark(x, y, slips, force, told) {
    const r = 0.022 + 0.05 * Math.sqrt(Math.max(force, 0) / 1000),
      sign = slips
        ? svg("path", { class: "slips", d: `M${x} ${y - 1.25 * r}l${1.1 * r} ${2 * r}h${-2.2 * r}z` })
        : svg("circle", { class: "sticks", cx: x, cy: y, r });
    sign.append(svg("title", {}, told));
    return sign;
  }

  function contacts({ counts, largest, place, slips, force, share }, answer) {
    const [across, along] = share,
      pushing = counts.stick + counts.slip,
      widest = Math.max(1000, ...share.flat().map(Math.abs)) / 1000,
      far = widest > 1.02 ? widest + 0.12 : 1.14,
      told = (k) =>
        `contact ${place[k]}: ${slips[k] ? "slips" : "sticks"}, normal reaction ${Dom.number((largest * force[k]) / 1000)}`;
    const found = `${counts.stick} stick, ${counts.slip} slip, ${counts.open} are open`;
    const marks = place.map((_, k) => {
      const y = along ? -along[k] / 1000 : 1 - (2 * force[k]) / 1000;
      return mark(across[k] / 1000, y, slips[k], force[k], told(k));
    });
    const round = along
      ? [
          svg("circle", { class: "paper", r: 1 }),
          svg("path", { class: "axis", d: "M-1 0H1M0 -1V1" }),
        ]
      : [svg("rect", { class: "paper", x: -1, y: -1.08, width: 2, height: 2.16 }), svg("path", { class: "axis", d: "M-1 1H1M0 -1V1" })];
    const drawn = drawing(
      `Contacts: ${found}`,
      [-far, -far, 2 * far, 2 * far],
      LARGEST + 24,
      LARGEST + 24,
      ...round,
      ...marks,
    );
    const few = place.length < pushing ? ` Drawn are the ${place.length} with the largest normal force.` : "",
      whose = answer ? ` in the answer of ${answer.label} (error ${Dom.number(answer.error)})` : " in the best answer";
    const where = along
      ? "at its friction over the largest that it can have, r_T/(μ r_N): inside the circle it sticks, on the rim it slips"
      : "at its friction over the largest that it can have, r_T/(μ r_N), its normal force upwards: inside the strip it sticks, on its edges it slips";
    return figure(
      h("div", {}, drawn, h("div", { class: "signs" }, `● ${counts.stick} stick  ▲ ${counts.slip} slip  ○ ${counts.open} open`)),
      `Each contact that pushes${whose}, ${where}; the larger the mark, the larger the normal force.${few}`,
      "contacts",
    );
  }

  const NAMES = ["z = 0", "z₁ > 0", "z₂ > 0", "z₁, z₂ > 0"];
  function cones({ cones: all, q, solutions, p, zero }) {
    const REACH = 1.3,
      point = ([x, y], size = 1) => [(size * x) / 1000, (-size * y) / 1000];
    const fills = [],
      rays = [],
      names = [];
    all.forEach(({ edges, flat }, k) => {
      const [a, b] = edges.map((e) => point(e)),
        far = edges.map((e) => point(e, 4));
      if (!flat) {
        // far corners alone would cut a wide cone short
        const sum = [a[0] + b[0], a[1] + b[1]],
          size = Math.hypot(...sum) || 1;
        const middle = sum.map((v) => (4 * v) / size);
        fills.push(
          svg("path", { class: `cone ${AREAS[k]}`, d: `M0 0L${far[0]}L${middle}L${far[1]}z` }),
        );
        const at = sum.map((v) => (0.8 * v) / size);
        names.push(text(at[0], at[1], NAMES[k]));
      }
      for (const f of far) rays.push(svg("path", { class: "axis", d: `M0 0L${f}` }));
    });
    const held = all.filter((c) => c.holds).length,
      at = point(q, 0.95);
    const drawn = drawing(
      `The plane of q: it lies in ${held} of 4 complementary cones`,
      [-REACH, -REACH, 2 * REACH, 2 * REACH],
      LARGEST + 60,
      LARGEST + 60,
      ...fills,
      ...rays,
      ...names,
      ...(zero ? [] : [svg("circle", { class: "sticks", cx: at[0], cy: at[1], r: 0.045 }), text(at[0] + 0.1, at[1] + 0.03, "q", { class: "q" })]),
    );
    const told = solutions.map((z) => `(${z.map(Dom.number).join(", ")})`).join(", ");
    const kind = p
      ? "M is a P-matrix: the cones fill the plane without overlapping"
      : "M is no P-matrix: cones overlap, are flat or leave gaps";
    const flat = all.filter((c) => c.flat).length;
    return figure(
      drawn,
      `Each of the 4 cones that holds q gives a solution; ${held || "none"} of them ${held === 1 ? "does" : "do"}${told ? `: z = ${told}` : ""}. ${kind}${flat ? ` (${flat} of 4 are flat)` : ""}.`,
      "cones",
    );
  }

  /* Figures of a problem, or words why there is none. */
  function draw(made) {
    if (!made) return [h("p", { class: "scope" }, "This page was made without pictures of its problems.")];
    if (made.why) return [h("p", { class: "scope" }, `No picture: ${made.why}`)];
    const drawn = [
      made.cones ? cones(made.cones) : null,
      made.blocks ? blocks(made.blocks) : null,
      made.contacts ? contacts(made.contacts, made.answer) : null,
    ].filter(Boolean);
    if (made.unanswered)
      drawn.push(h("p", { class: "scope" }, "What its contacts do has no picture: no verified answer was kept."));
    return drawn.length ? [h("div", { class: "thumbnails" }, drawn)] : [h("p", { class: "scope" }, "It has no matrix.")];
  }

  return Object.freeze({ draw });
})();
