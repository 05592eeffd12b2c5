"use strict";
/* Vega-Lite specifications. Text and axes have the colour of the page's text, curves the variables of its style. */
const Charts = (() => {
  const SLOTS = 7; // curves in colour
  const PALETTE = 10,
    LOOKS = 300; // looks beyond are those of the first again
  const look = (made) => Array.from({ length: LOOKS }, (_, k) => made(k % PALETTE, Math.floor(k / PALETTE)));
  const COLOURS = look((k) => `var(--s${k})`);
  const PATTERNS = [
    [1, 0],
    [7, 3],
    [2, 2],
    [9, 3, 2, 3],
    [4, 2],
    [12, 4],
    [5, 2, 1, 2, 1, 2],
    [1, 2],
    [8, 2, 2, 2, 2, 2],
    [3, 3],
  ];
  /* Two looks of one colour differ in dashes and in shape. */
  const DASHES = look((k, round) => PATTERNS[(k + round) % PATTERNS.length]);
  const FORMS = [
    ...["circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "triangle-right", "triangle-left"],
    ...["stroke", "arrow"],
  ];
  const SHAPES = look((k, round) => FORMS[(k + round) % FORMS.length]);
  const SECONDS =
    "datum.value >= 1 ? format(datum.value, '~g') + ' s' : datum.value >= 1e-3 ? " +
    "format(datum.value * 1e3, '~g') + ' ms' : format(datum.value * 1e6, '~g') + ' µs'";
  const BYTES = "format(datum.value / 1048576, '~g') + ' MiB'";
  const TINY = "datum.value >= 1e-3 && datum.value < 1e5 ? format(datum.value, '~g') : format(datum.value, '.0e')";

  const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', 'Liberation Sans', sans-serif";
  const CONFIG = {
    background: null,
    font: FONT,
    aria: false,
    view: { stroke: null },
    axis: {
      labelColor: "currentColor",
      titleColor: "currentColor",
      tickColor: "currentColor",
      domainColor: "currentColor",
      gridColor: "currentColor",
      gridOpacity: 0.1,
      tickOpacity: 0.35,
      domainOpacity: 0.35,
      labelOpacity: 0.85,
      labelFontSize: 12,
      titleFontSize: 12,
      titleFontWeight: 500,
      titlePadding: 9,
      labelPadding: 5,
      tickSize: 4,
      labelLimit: 220,
    },
    text: { color: "currentColor", font: FONT, fontSize: 12 },
    rule: { color: "currentColor" },
  };

  const unitText = (metric) => (metric.unit === "s" ? SECONDS : metric.unit === "byte" ? BYTES : TINY);

  /* Ticks of a log scale: decades, or 1, 2, 5 where there are few of them. */
  function logTicks(low, high) {
    const first = Math.floor(Math.log10(low)),
      last = Math.ceil(Math.log10(high));
    const every = Math.max(1, Math.ceil((last - first) / 8)),
      subs = last - first <= 2 ? [1, 2, 5] : [1];
    const found = [];
    for (let k = first; k <= last; k++) {
      if ((k - first) % every === 0) for (const sub of subs) found.push(sub * 10 ** k);
    }
    return found.filter((v) => v >= low * 0.999 && v <= high * 1.001);
  }

  function powers(high) {
    const most = Math.max(1, Math.ceil(Math.log2(high))),
      every = Math.ceil(most / 8);
    return Array.from({ length: Math.floor(most / every) + 1 }, (_, k) => 2 ** (k * every)).filter(
      (v) => v <= high * 1.001,
    );
  }

  /* Least and largest of many values. */
  function extent(values) {
    let low = Infinity,
      high = -Infinity;
    for (const v of values) {
      if (v < low) low = v;
      if (v > high) high = v;
    }
    return [low, high];
  }

  /* Few enough points for a figure: every k-th, and what to say of it. */
  const POINTS = 3000;
  function sampled(points) {
    if (points.length <= POINTS) return { points, told: "" };
    const every = Math.ceil(points.length / POINTS);
    return {
      points: points.filter((_, k) => k % every === 0),
      told: ` Of ${points.length} points every ${every}th is drawn.`,
    };
  }

  const logScale = (low, high) => ({ type: "log", domain: [low, high], nice: false });

  /* Corners of a step function, thinned to what a screen shows. */
  function corners(curve, low, high, points = 700) {
    const found = [{ x: low, y: Engine.height(curve, low) }];
    let before = -1;
    for (let k = 0; k < curve.at.length; k++) {
      const x = curve.at[k];
      if (x <= low || x > high) continue;
      const place = Math.round((points * Math.log(x / low)) / Math.log(high / low));
      const corner = { x, y: curve.count[k] / curve.problems };
      if (place === before) found[found.length - 1] = corner;
      else found.push(corner);
      before = place;
    }
    found.push({ x: high, y: Engine.height(curve, high) });
    return found;
  }

  const slotColour = {
    field: "slot",
    type: "ordinal",
    legend: null,
    scale: { domain: [...COLOURS.keys()], range: COLOURS },
  };
  const slotDash = {
    field: "slot",
    type: "ordinal",
    legend: null,
    scale: { domain: [...COLOURS.keys()], range: DASHES },
  };
  const slotShape = {
    field: "slot",
    type: "nominal",
    legend: null,
    scale: { domain: [...COLOURS.keys()], range: SHAPES },
  };
  /* Of the curves without a colour, those that are few enough in a figure are told apart by their dashes. */
  const greyDash = { ...slotDash, field: "dash" };
  const inFocus = (full) => ({
    condition: { test: "focus === '' || datum.label === focus", value: full },
    value: 0.12,
  });

  /* Lines of labels: those with a slot in colour and dash, the others grey behind them. */
  function lines({ values, x, y, interpolate = "step-after", height = 340, point = false, extra = [] }) {
    const tooltip = [{ field: "label", title: "solver" }];
    const shared = {
      x: { field: "x", type: "quantitative", ...x },
      y: { field: "y", type: "quantitative", ...y },
      tooltip,
    };
    const mark = { type: "line", interpolate, clip: true, strokeCap: "butt", strokeJoin: "round" };
    const coloured = values.filter((v) => v.slot >= 0);
    return {
      height,
      params: [{ name: "focus", value: "" }],
      layer: [
        {
          data: { values: values.filter((v) => v.slot < 0).map((v) => ({ ...v, dash: v.dash ?? 0, named: v.dash >= 0 })) },
          mark: { ...mark, color: "var(--other)" },
          encoding: {
            ...shared,
            detail: { field: "label" },
            strokeDash: greyDash,
            strokeWidth: { condition: { test: "datum.named", value: 2.2 }, value: 1 },
            opacity: inFocus(0.75),
          },
        },
        ...extra,
        {
          data: { values: coloured },
          mark: { ...mark, strokeWidth: 2.2 },
          encoding: {
            ...shared,
            detail: { field: "label" },
            color: slotColour,
            strokeDash: slotDash,
            opacity: inFocus(1),
          },
        },
        ...(point
          ? [
              {
                data: { values: coloured },
                mark: { type: "point", filled: true, size: 34, clip: true },
                encoding: {
                  ...shared,
                  color: slotColour,
                  shape: slotShape,
                  opacity: inFocus(1),
                  tooltip: [...tooltip, { field: "xText", title: point.x }, { field: "yText", title: point.y }],
                },
              },
            ]
          : []),
      ],
    };
  }

  /* Areas behind curves of labels with a colour: values of {label, slot, first, x, low, high}. Those that are not first
     appear while their label is in focus. */
  const bands = (values) => ({
    data: { name: "bands", values },
    mark: { type: "area", interpolate: "step-after", clip: true },
    encoding: {
      x: { field: "x", type: "quantitative" },
      y: { field: "low", type: "quantitative" },
      y2: { field: "high" },
      detail: { field: "label" },
      color: slotColour,
      opacity: {
        condition: [
          { test: "datum.label === focus", value: 0.32 },
          { test: "focus === '' && datum.first", value: 0.16 },
        ],
        value: 0,
      },
    },
  });

  /* A dot a label on its line, with its interval: values of {label, slot, v, low, high}, in the order of the lines. */
  function dots({ values, scale, axis, tooltip = [], extra = [] }) {
    const y = {
        field: "label",
        type: "nominal",
        sort: null,
        title: null,
        axis: { ticks: false, domain: false, labelPadding: 8 },
      },
      x = (field) => ({ field, type: "quantitative", scale, axis }),
      colour = { condition: { test: "datum.slot >= 0", ...slotColour }, value: "var(--soft)" };
    return {
      height: 21 * values.length,
      layer: [
        ...extra,
        {
          data: { name: "intervals", values },
          mark: { type: "rule", strokeWidth: 5, opacity: 0.28 },
          encoding: { y, x: x("low"), x2: { field: "high" }, color: colour },
        },
        {
          data: { name: "dots", values },
          mark: { type: "point", filled: true, size: 52, opacity: 1 },
          encoding: { y, x: x("v"), color: colour, tooltip: [{ field: "label", title: "solver" }, ...tooltip] },
        },
      ],
    };
  }

  /* Draws into an element; gives what `focus` of. */
  async function draw(element, spec) {
    const whole = { width: "container", autosize: { type: "fit-x", contains: "padding" }, config: CONFIG, ...spec };
    const { view } = await window.vegaEmbed(element, whole, {
      mode: "vega-lite",
      renderer: "svg",
      actions: false,
      ast: true,
      defaultStyle: false,
    });
    return view;
  }

  return Object.freeze({
    extent,
    sampled,
    SLOTS,
    COLOURS,
    DASHES,
    SHAPES,
    SECONDS,
    TINY,
    unitText,
    logTicks,
    powers,
    logScale,
    corners,
    lines,
    bands,
    dots,
    draw,
    slotColour,
    slotDash,
    slotShape,
    inFocus,
  });
})();
