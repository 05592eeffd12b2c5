"use strict";
/* The statistics of the page: the definitions of cpbench/analysis, for whatever the reader has filtered.
   Pure functions of numbers; nothing here reads or changes the page.

   A matrix is {values, problems, labels}: values[p * labels.length + s] is what label s spent on problem p, and
   Infinity where its answer does not meet the tolerance or no row is. A curve is {at, count}: where it steps, and how
   many problems it has reached there. */
const Engine = (() => {
  const INFINITE = Infinity;

  /* Problems x labels of one group, with the row of every pair (-1: not planned). */
  function index(columns, group) {
    const { first, count, problems, labels } = group;
    const placeOf = (codes) => new Map(codes.map((code, place) => [code, place]));
    const problemAt = placeOf(problems),
      labelAt = placeOf(labels);
    const row = new Int32Array(problems.length * labels.length).fill(-1);
    for (let r = first; r < first + count; r++) {
      row[problemAt.get(columns.problem[r]) * labels.length + labelAt.get(columns.label[r])] = r;
    }
    return { row, problems, labels };
  }

  /* The status of a row at the planned tolerance (null) or another one, as analysis.tolerances.Ladders gives it. */
  function outcome(columns, r, tolerance, status) {
    if (tolerance === null) return columns.status[r];
    const error = columns.error[r],
      met = columns.met[r],
      near = Math.min(error, met) <= status.factor * tolerance;
    return status.ladders[columns.ladder[r]][error <= tolerance ? 0 : met <= tolerance ? 1 : near ? 2 : 3];
  }

  /* Whether a row's answer meets the tolerance: the planned one (null), or another that the error is held against. */
  function solved(columns, r, tolerance, status) {
    return status.verified[outcome(columns, r, tolerance, status)] === 1;
  }

  /* The costs of the chosen problems and labels, as analysis.metrics.measured gives them: labels with a verified
     answer that lacks the value are left out and counted. `lost`: of each
     label the answers that a conversion lost. */
  function costs(columns, table, problems, labels, values, tolerance, status) {
    const width = table.labels.length;
    const kept = [],
      leftOut = [],
      lost = [],
      found = [];
    for (const s of labels) {
      const own = new Float64Array(problems.length).fill(INFINITE);
      let unknown = 0,
        missing = 0,
        comparable = false;
      for (let i = 0; i < problems.length; i++) {
        const r = table.row[problems[i] * width + s];
        if (r < 0 || !columns.ranked[r]) continue;
        comparable = true;
        if (status.lost[outcome(columns, r, tolerance, status)]) missing++;
        if (!solved(columns, r, tolerance, status)) continue;
        if (Number.isNaN(values[r])) unknown++;
        else own[i] = values[r];
      }
      if (!comparable) continue;
      if (unknown) leftOut.push({ label: s, count: unknown });
      else {
        kept.push(s);
        lost.push(missing);
        found.push(own);
      }
    }
    const matrix = new Float64Array(problems.length * kept.length);
    found.forEach((own, s) => {
      for (let i = 0; i < own.length; i++) matrix[i * kept.length + s] = own[i];
    });
    return { values: matrix, problems, labels: kept, leftOut, lost };
  }

  /* A cost below the floor counts as the floor; null: no cost comes near 0. */
  function floored(matrix, floor) {
    if (floor === null) return matrix;
    return { ...matrix, values: matrix.values.map((v) => Math.max(v, floor)) };
  }

  /* r[p, s] = t[p, s] / min_s t[p, s] (Dolan and More 2002), Infinity where not solved. */
  function ratios(matrix, floor) {
    const { values, labels, problems } = floored(matrix, floor);
    const quotient = new Float64Array(values.length).fill(INFINITE),
      width = labels.length;
    for (let p = 0; p < problems.length; p++) {
      let best = INFINITE;
      for (let s = 0; s < width; s++) best = Math.min(best, values[p * width + s]);
      if (best === INFINITE) continue;
      for (let s = 0; s < width; s++) {
        const cost = values[p * width + s];
        if (cost !== INFINITE) quotient[p * width + s] = cost / best;
      }
    }
    return { ...matrix, values: quotient };
  }

  function column(matrix, s) {
    const own = new Float64Array(matrix.problems.length);
    for (let p = 0; p < own.length; p++) own[p] = matrix.values[p * matrix.labels.length + s];
    return own;
  }

  /* One step function a label: it steps where a problem is solved, and at Infinity never. A problem whose answer a
     conversion lost is not among its problems. */
  function curves(matrix) {
    return matrix.labels.map((label, s) => {
      const steps = column(matrix, s).filter(Number.isFinite).sort();
      const at = [],
        count = [];
      for (let k = 0; k < steps.length; k++) {
        if (k + 1 < steps.length && steps[k + 1] === steps[k]) continue;
        at.push(steps[k]);
        count.push(k + 1);
      }
      return { label, at, count, solved: steps.length, problems: matrix.problems.length - (matrix.lost?.[s] ?? 0) };
    });
  }

  const profile = (matrix, floor) => curves(ratios(matrix, floor));
  const dataProfile = (matrix) => curves(matrix);

  /* Problems reached up to x: continuous from the right. */
  function reached(curve, x) {
    let low = 0,
      high = curve.at.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (curve.at[middle] <= x) low = middle + 1;
      else high = middle;
    }
    return low ? curve.count[low - 1] : 0;
  }

  const height = (curve, x) => reached(curve, x) / Math.max(curve.problems, 1);
  const widest = (all, least) =>
    all.reduce((most, c) => (c.solved ? Math.max(most, c.at[c.at.length - 1]) : most), least);

  /* Mean height over log2 between 1 and `upto`. */
  function area(curve, upto) {
    if (upto <= 1) return height(curve, 1);
    let sum = 0,
      before = 0,
      level = height(curve, 1);
    for (let k = 0; k < curve.at.length && curve.at[k] < upto; k++) {
      if (curve.at[k] <= 1) continue;
      const here = Math.log2(curve.at[k]);
      sum += level * (here - before);
      before = here;
      level = curve.count[k] / Math.max(curve.problems, 1);
    }
    return (sum + level * (Math.log2(upto) - before)) / Math.log2(upto);
  }

  /* Labels that solve something, by area under the profile, ties in the order of labels. */
  function leading(all) {
    const upto = widest(all, 1);
    const measured = all.filter((c) => c.solved).map((c) => [c, area(c, upto)]);
    return measured.sort((a, b) => b[1] - a[1] || a[0].label - b[0].label).map(([c]) => c.label);
  }

  /* How often label `one` is ahead of `other` (places in the matrix): wins, ties, losses, neither; together N. */
  function record(matrix, floor, one, other) {
    const { values, labels, problems } = matrix,
      least = floor ?? 0;
    const found = { wins: 0, ties: 0, losses: 0, neither: 0 };
    for (let p = 0; p < problems.length; p++) {
      const a = Math.max(values[p * labels.length + one], least),
        b = Math.max(values[p * labels.length + other], least);
      if (a < b) found.wins++;
      else if (b < a) found.losses++;
      else if (a === INFINITE) found.neither++;
      else found.ties++;
    }
    return found;
  }

  /* The least value that a share of all does not exceed (definition 1 of Hyndman and Fan), NaN of none. */
  function quantile(sorted, level) {
    return sorted.length ? sorted[Math.ceil(level * sorted.length - 1e-9) - 1] : NaN;
  }

  /* Wilson's 95 % interval of a rate. */
  function wilson(successes, trials) {
    const z = 1.959963984540054,
      p = successes / trials;
    const middle = p + (z * z) / (2 * trials);
    const half = z * Math.sqrt((p * (1 - p)) / trials + (z * z) / (4 * trials * trials));
    const below = 1 + (z * z) / trials;
    return [successes === 0 ? 0 : (middle - half) / below, successes === trials ? 1 : (middle + half) / below];
  }

  /* Of each label: quantiles of the times, misses of the deadline, and the longest run of misses within a sequence.
     `order` has for each problem of the matrix its sequence ('' for none) and step. */
  function deadlines(matrix, deadline, order) {
    const places = matrix.problems
      .map((_, p) => p)
      .sort((a, b) =>
        order[a].sequence < order[b].sequence
          ? -1
          : order[a].sequence > order[b].sequence
            ? 1
            : order[a].step - order[b].step || a - b,
      );
    return matrix.labels.map((label, s) => {
      const own = column(matrix, s),
        sorted = own.slice().sort();
      let misses = 0,
        longest = 0,
        run = 0,
        before = null;
      for (const p of places) {
        const { sequence } = order[p],
          missed = !(own[p] <= deadline);
        if (missed) misses++;
        run = missed && sequence !== "" ? (sequence === before ? run : 0) + 1 : 0;
        longest = Math.max(longest, run);
        before = sequence;
      }
      const [p50, p95, p99, max] = [0.5, 0.95, 0.99, 1].map((level) => quantile(sorted, level));
      const [low, high] = wilson(misses, own.length);
      return { label, p50, p95, p99, max, misses, share: misses / own.length, low, high, longest };
    });
  }

  const ERRORS = Array.from({ length: 57 }, (_, k) => Number((10 ** (-k / 4)).toExponential(6)));

  /* Median time to each error over the chosen problems, as analysis.histories.work_precision: those that were not
     reached count as Infinity. `paths` has {problem, label, seconds, error} of iterates; problems and labels are sets. */
  function workPrecision(paths, problems, labels, tolerance) {
    const levels = ERRORS.filter((e) => e >= 0.99 * tolerance),
      count = problems.size,
      times = new Map();
    for (let k = 0; k < paths.error.length; k++) {
      const label = paths.label[k];
      if (!labels.has(label) || !problems.has(paths.problem[k])) continue;
      if (!times.has(label))
        times.set(
          label,
          levels.map(() => new Map()),
        );
      const own = times.get(label);
      for (let e = 0; e < levels.length && paths.error[k] <= levels[e]; e++) {
        const known = own[e].get(paths.problem[k]);
        if (known === undefined || paths.seconds[k] < known) own[e].set(paths.problem[k], paths.seconds[k]);
      }
    }
    const found = [];
    for (const [label, own] of times) {
      own.forEach((reachedAt, e) => {
        if (!reachedAt.size) return;
        const all = [...reachedAt.values(), ...Array(count - reachedAt.size).fill(INFINITE)].sort((a, b) => a - b);
        const middle = count >> 1;
        const seconds = count % 2 ? all[middle] : (all[middle - 1] + all[middle]) / 2;
        found.push({ label, error: levels[e], reached: reachedAt.size, seconds });
      });
    }
    return found;
  }

  return Object.freeze({
    index,
    outcome,
    solved,
    costs,
    ratios,
    curves,
    profile,
    dataProfile,
    reached,
    height,
    widest,
    area,
    leading,
    record,
    quantile,
    wilson,
    deadlines,
    workPrecision,
    column,
  });
})();
