"use strict";
/* The rows that are chosen: their costs, how many problems were solved within a cost, and who was ahead. All other
   statistics of the page (orders, means, intervals, growth) were computed by cpbench, of all rows of a formulation.

   A matrix is {values, problems, labels, lost}: values[p * labels.length + s] is what label s spent on problem p,
   Infinity where its answer does not meet the tolerance or there is no row. A curve is {label, at, count, solved,
   problems}: where it steps, and how many problems it has reached there. */
const Rows = (() => {
  /* Problems x labels of one group, with the row of every pair (-1: not planned). */
  function index(columns, { first, count, problems, labels }) {
    const placeOf = (codes) => new Map(codes.map((code, place) => [code, place]));
    const problemAt = placeOf(problems), labelAt = placeOf(labels);
    const row = new Int32Array(problems.length * labels.length).fill(-1);
    for (let r = first; r < first + count; r++)
      row[problemAt.get(columns.problem[r]) * labels.length + labelAt.get(columns.label[r])] = r;
    return { row, problems, labels, problemAt, labelAt };
  }

  /* The statuses of all rows at the planned tolerance (null), or at another power of ten. */
  const outcomes = (columns, tolerance) =>
    columns[tolerance === null ? "status" : `status.${Math.round(-Math.log10(tolerance))}`];

  /* The costs of the chosen problems and labels, as analysis.metrics.measured: labels with a verified answer that lacks
     the value are left out. `lost`: of each label the answers that a conversion lost. */
  function costs({ columns, table, facts: { status } }, outcome, problems, labels, values) {
    const kept = [], leftOut = [];
    for (const s of labels) {
      const spent = new Float64Array(problems.length).fill(Infinity);
      let lost = 0, unknown = false, compared = false;
      problems.forEach((p, i) => {
        const r = table.row[p * table.labels.length + s];
        if (r < 0 || !columns.ranked[r]) return;
        compared = true;
        lost += status.lost[outcome[r]];
        if (!status.verified[outcome[r]]) return;
        if (Number.isNaN(values[r])) unknown = true;
        else spent[i] = values[r];
      });
      if (unknown) leftOut.push(s);
      else if (compared) kept.push({ s, lost, spent });
    }
    const matrix = new Float64Array(problems.length * kept.length);
    kept.forEach(({ spent }, k) => spent.forEach((v, i) => (matrix[i * kept.length + k] = v)));
    return { values: matrix, problems, labels: kept.map(({ s }) => s), lost: kept.map(({ lost }) => lost), leftOut };
  }

  /* r[p, s] = t[p, s] / min_s t[p, s] (Dolan and Moré 2002); a cost below the floor counts as the floor. */
  function ratios(matrix, floor) {
    const width = matrix.labels.length, values = matrix.values.map((v) => Math.max(v, floor ?? 0));
    for (let p = 0; p < matrix.problems.length; p++) {
      const line = values.subarray(p * width, (p + 1) * width),
        least = line.reduce((a, b) => Math.min(a, b), Infinity);
      line.forEach((v, s) => (line[s] = v === Infinity ? v : v / least));
    }
    return { ...matrix, values };
  }

  /* One step function a label: it steps where a problem is solved, and at Infinity never. A problem whose answer a
     conversion lost is not among its problems. */
  function curves({ values, labels, problems, lost }) {
    return labels.map((label, s) => {
      const steps = problems.map((_, p) => values[p * labels.length + s]).filter(Number.isFinite).sort((a, b) => a - b);
      const last = [...steps.keys()].filter((k) => steps[k + 1] !== steps[k]);
      const [at, count] = [last.map((k) => steps[k]), last.map((k) => k + 1)];
      return { label, at, count, solved: steps.length, problems: problems.length - lost[s] };
    });
  }

  /* The fraction of its problems that a curve has reached at x; it is continuous from the right. */
  const height = ({ at, count, problems }, x) =>
    (count[at.findLastIndex((step) => step <= x)] ?? 0) / Math.max(problems, 1);

  /* How often label `one` is ahead of `other` (places in the matrix): wins, ties, losses, neither; together N. */
  function record({ values, labels, problems }, floor, one, other) {
    const counts = { wins: 0, ties: 0, losses: 0, neither: 0 };
    problems.forEach((_, p) => {
      const [a, b] = [one, other].map((s) => Math.max(values[p * labels.length + s], floor ?? 0));
      counts[a < b ? "wins" : b < a ? "losses" : a === Infinity ? "neither" : "ties"]++;
    });
    return counts;
  }

  return Object.freeze({ index, outcomes, costs, ratios, curves, height, record });
})();
