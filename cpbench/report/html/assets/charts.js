"use strict";
/* Vega-Lite specifications. Text and axes have the colour of the page's text, curves the variables of its style. */
const Charts = (() => {
  const SLOTS = 7; // curves in colour
  const PALETTE = 10, LOOKS = 300; // looks beyond are those of the first again
  const look = (made) => Array.from({ length: LOOKS }, (_, k) => made(k % PALETTE, Math.floor(k / PALETTE)));
  const COLOURS = look((k) => `var(--s${k})`);
  const PATTERNS = ["1 0", "7 3", "2 2", "9 3 2 3", "4 2", "12 4", "5 2 1 2 1 2", "1 2", "8 2 2 2 2 2", "3 3"].map(
    (dashes) => dashes.split(" ").map(Number),
  );
  /* Two looks of one colour differ in dashes and in shape. */
  const DASHES = look((k, round) => PATTERNS[(k + round) % PALETTE]);
  const FORMS = ["circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "triangle-right"];
  FORMS.push("triangle-left", "stroke", "arrow");
  const SHAPES = look((k, round) => FORMS[(k + round) % PALETTE]);
  const SECONDS =
    "datum.value >= 1 ? format(datum.value, '~g') + ' s' : datum.value >= 1e-3 ? " +
    "format(datum.value * 1e3, '~g') + ' ms' : format(datum.value * 1e6, '~g') + ' µs'";
  const BYTES = "format(datum.value / 1048576, '~g') + ' MiB'";
  const TINY = "datum.value >= 1e-3 && datum.value < 1e5 ? format(datum.value, '~g') : format(datum.value, '.0e')";

  const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', 'Liberation Sans', sans-serif";
  const ink = (...parts) => Object.fromEntries(parts.map((part) => [`${part}Color`, "currentColor"]));
  const AXIS = {
    ...ink("label", "title", "tick", "domain", "grid"),
    ...{ gridOpacity: 0.1, tickOpacity: 0.35, domainOpacity: 0.35, labelOpacity: 0.85 },
    ...{ labelFontSize: 12, titleFontSize: 12, titleFontWeight: 500, labelLimit: 220 },
    ...{ titlePadding: 9, labelPadding: 5, tickSize: 4 },
  };
  const CONFIG = {
    background: null,
    font: FONT,
    aria: false,
    view: { stroke: null },
    axis: AXIS,
    text: { color: "currentColor", font: FONT, fontSize: 12 },
    rule: { color: "currentColor" },
  };

  const unitText = ({ unit }) => (unit === "s" ? SECONDS : unit === "byte" ? BYTES : TINY);

  /* Ticks of a log scale: decades, or 1, 2, 5 where there are few of them. */
  function logTicks(low, high) {
    const first = Math.floor(Math.log10(low)), last = Math.ceil(Math.log10(high));
    const every = Math.max(1, Math.ceil((last - first) / 8)),
      subs = last - first <= 2 ? [1, 2, 5] : [1];
    const decades = Array.from({ length: last - first + 1 }, (_, k) => k).filter((k) => k % every === 0);
    const ticks = decades.flatMap((k) => subs.map((sub) => sub * 10 ** (first + k)));
    return ticks.filter((v) => v >= low * 0.999 && v <= high * 1.001);
  }

  /* Least and largest of many values. */
  const extent = (values) =>
    values.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [Infinity, -Infinity]);

  /* Few enough points for a figure: every k-th, and a sentence about it. */
  const POINTS = 3000;
  function sampled(points) {
    if (points.length <= POINTS) return { points, note: "" };
    const every = Math.ceil(points.length / POINTS);
    const note = ` Of ${points.length} points every ${every}th is drawn.`;
    return { points: points.filter((_, k) => k % every === 0), note };
  }

  /* Scale and axis with a log scale. */
  const log = (title, low, high, labelExpr, values = logTicks(low, high)) => ({
    scale: { type: "log", domain: [low, high], nice: false },
    axis: { title, values, labelExpr },
  });
  const tooltips = (...fields) => fields.map(([field, title]) => ({ field, title }));
  const quantity = (field, rest = {}) => ({ field, type: "quantitative", ...rest });

  /* Corners of a step function, thinned to what a screen shows. */
  function corners(curve, low, high, points = 700) {
    const shown = [{ x: low, y: Rows.height(curve, low) }];
    let before = -1;
    curve.at.forEach((x, k) => {
      if (x <= low || x > high) return;
      const place = Math.round((points * Math.log(x / low)) / Math.log(high / low));
      if (place === before) shown.pop();
      shown.push({ x, y: curve.count[k] / curve.problems });
      before = place;
    });
    return [...shown, { x: high, y: Rows.height(curve, high) }];
  }

  const bySlot = (range, type = "ordinal", field = "slot") => ({
    field, type, legend: null, scale: { domain: [...COLOURS.keys()], range },
  });
  const slotColour = bySlot(COLOURS), slotDash = bySlot(DASHES),
    slotShape = bySlot(SHAPES, "nominal");
  const inFocus = (full) => ({ condition: { test: "focus === '' || datum.label === focus", value: full }, value: 0.12 });
  const DETAIL = { field: "label" }, FOCUS = [{ name: "focus", value: "" }];

  /* Lines of labels: those with a slot in colour and dash; the others grey behind them, told apart by their dashes where
     they are few enough in a figure to have a `dash`. */
  function lines({ values, x, y, interpolate = "step-after", extra = [] }) {
    const tooltip = tooltips(["label", "solver"]);
    const shared = { x: quantity("x", x), y: quantity("y", y), tooltip, detail: DETAIL };
    const mark = { type: "line", interpolate, clip: true, strokeCap: "butt", strokeJoin: "round" };
    const grey = values.filter((v) => v.slot < 0).map((v) => ({ ...v, dash: v.dash ?? 0, named: v.dash >= 0 }));
    const plain = {
      strokeDash: bySlot(DASHES, "ordinal", "dash"),
      strokeWidth: { condition: { test: "datum.named", value: 2.2 }, value: 1 },
      opacity: inFocus(0.75),
    };
    const bright = { color: slotColour, strokeDash: slotDash, opacity: inFocus(1) };
    const coloured = { values: values.filter((v) => v.slot >= 0) };
    return {
      height: 340,
      params: FOCUS,
      layer: [
        { data: { values: grey }, mark: { ...mark, color: "var(--other)" }, encoding: { ...shared, ...plain } },
        ...extra,
        { data: coloured, mark: { ...mark, strokeWidth: 2.2 }, encoding: { ...shared, ...bright } },
      ],
    };
  }

  /* Areas behind curves of labels with a colour: values of {label, slot, first, x, low, high}. Those that are not first
     appear while their label is in focus. */
  function bands(values) {
    const shown = [
      { test: "datum.label === focus", value: 0.32 },
      { test: "focus === '' && datum.first", value: 0.16 },
    ];
    const ends = { x: quantity("x"), y: quantity("low"), y2: { field: "high" } };
    return {
      data: { name: "bands", values },
      mark: { type: "area", interpolate: "step-after", clip: true },
      encoding: { ...ends, detail: DETAIL, color: slotColour, opacity: { condition: shown, value: 0 } },
    };
  }

  /* A dot a label on its line, with its interval: values of {label, slot, v, low, high}, in the order of the lines. */
  function dots({ values, scale, axis, tooltip = [], extra = [] }) {
    const beside = { ticks: false, domain: false, labelPadding: 8 },
      y = { field: "label", type: "nominal", sort: null, title: null, axis: beside },
      x = (field) => quantity(field, { scale, axis }),
      color = { condition: { test: "datum.slot >= 0", ...slotColour }, value: "var(--soft)" };
    return {
      height: 21 * values.length,
      layer: [
        ...extra,
        {
          data: { name: "intervals", values },
          mark: { type: "rule", strokeWidth: 5, opacity: 0.28 },
          encoding: { y, x: x("low"), x2: { field: "high" }, color },
        },
        {
          data: { name: "dots", values },
          mark: { type: "point", filled: true, size: 52, opacity: 1 },
          encoding: { y, x: x("v"), color, tooltip: [{ field: "label", title: "solver" }, ...tooltip] },
        },
      ],
    };
  }

  /* Draws into an element, and returns the view, to which `focus` may be given. */
  async function draw(element, spec) {
    const whole = { width: "container", autosize: { type: "fit-x", contains: "padding" }, config: CONFIG, ...spec };
    const options = { mode: "vega-lite", renderer: "svg", actions: false, ast: true, defaultStyle: false };
    return (await window.vegaEmbed(element, whole, options)).view;
  }

  return Object.freeze({
    SLOTS, COLOURS, DASHES, SECONDS, TINY, FOCUS, DETAIL, unitText, extent, sampled, logTicks, log, quantity, tooltips,
    corners, lines, bands, dots, draw, slotColour, slotDash, slotShape, inFocus,
  });
})();
