"use strict";
/* The sheet of one pair: what was measured, what it cost, what it said, and the command that runs it again. */
const Pair = (() => {
  const { h } = Dom;
  const FLAGS = {
    direction: "accepted, and yet some contact slips in a direction that the law forbids",
    unresolvable: "rounding decides whether the answer meets the tolerance",
    "target unresolvable": "rounding decides whether the answer meets the tolerance on the solver's own problem",
    scale: "the natural residual passes and the energy norm does not",
    absolute: "a scale was 0, so that the error is absolute",
    repeat: "a repeat of the timing failed after the first answer",
    remembered: "repeats were so much faster that the first solve alone counts",
    children: "the solver left processes behind",
    threads: "it used more threads than it was given",
    wrote: "it wrote to the problem's data",
    clock: "its answer came much later than its own clock says",
    history: "read off the iterates of a run at a tighter tolerance",
    mixed: "merged from runs with other limits, machines or versions",
  };
  const KINDS = {
    equivalent: "every answer there is an answer here, and the other way round",
    "one-way": "every answer there is an answer here",
    necessary: "promises less than an answer: a necessary condition",
    approximate: "promises less than an answer: the law is approximated",
    relaxation: "promises less than an answer: a part of the law is dropped",
  };

  const badge = (context, status) =>
    h("span", { class: `badge k-${status}` }, `${context.symbolOf(status)} ${status.replace("_", " ")}`);
  const list = (entries) =>
    h(
      "dl",
      {},
      entries
        .filter(([, value]) => value !== null && value !== "")
        .flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]),
    );

  function show(title, ...children) {
    const dialog = document.getElementById("pair");
    dialog.replaceChildren(
      h(
        "header",
        {},
        h("h2", { id: "pair-title" }, ...title),
        h("button", { type: "button", onclick: () => dialog.close() }, "Close"),
      ),
      h("div", { class: "body" }, ...children),
    );
    if (!dialog.open) dialog.showModal();
    dialog.scrollTop = 0;
  }


  function numbers(title, text) {
    const entries = Object.entries(text ? JSON.parse(text) : {});
    return entries.length
      ? [
          h("h3", {}, title),
          Dom.table({
            caption: title,
            head: ["what", "value"],
            right: [1],
            rows: entries.map(([name, value]) => [name, Dom.number(value)]),
          }),
        ]
      : [];
  }

  function open(context, row) {
    const { data, columns, facts, group } = context;
    const problem = columns.problem[row],
      status = context.statusOf(row),
      label = facts.labels.name[columns.label[row]];
    const at = columns.detail[row] - 1;
    const text = (name) => (at < 0 ? "" : facts.texts[name][columns[`detail.${name}`][at]]);
    const value = (name) => (at < 0 ? NaN : (columns[`detail.${name}`]?.[at] ?? NaN));
    const about = facts.problems.thumbnail[problem] ?? {},
      kind = text("kind"),
      flags = text("flags").split(",").filter(Boolean);
    const facts1 = list([
      [
        "verdict",
        h(
          "span",
          {},
          badge(context, status),
          context.state.tolerance === null ? "" : ` at ${Dom.number(context.state.tolerance)}`,
        ),
      ],
      ["claim", text("claim") || "none"],
      ["error", `${Dom.number(columns.error[row])} (tolerance ${Dom.number(group.tolerance)})`],
      [
        "error there",
        text("route") !== "direct" && Number.isFinite(value("target_error"))
          ? `${Dom.number(value("target_error"))} on the solver's own problem`
          : "",
      ],
      ["certainty", [text("certainty"), text("certificate")].filter(Boolean).join(": ")],
      [
        "from a solution",
        Number.isFinite(value("distance")) ? `at most ${Dom.number(value("distance"))} of its size` : "",
      ],
      ["slip angle", slip(text("parts"))],
      [
        "route",
        text("route") ? h("span", {}, h("code", {}, text("route")), kind ? `: ${kind}, ${KINDS[kind] ?? ""}` : "") : "",
      ],
      [
        "flags",
        flags.length
          ? h(
              "span",
              {},
              flags.map((f, k) => [k ? "; " : "", h("strong", {}, f), FLAGS[f] ? `: ${FLAGS[f]}` : ""]).flat(),
            )
          : "",
      ],
      ["start", text("started") || group.start],
      ["limit", group.limit === null ? "none" : Dom.seconds(group.limit)],
      [
        "memory",
        Number.isFinite(columns.memory?.[row]) ? `${Dom.bytes(columns.memory[row])} on top of what was there` : "",
      ],
      ["version", text("version")],
      [
        "ended with",
        [
          ["code", value("code")],
          ["signal", value("signal")],
        ]
          .filter(([, v]) => Number.isFinite(v))
          .map(([n, v]) => `${n} ${v}`)
          .join(", "),
      ],
      ["made elsewhere", text("origin") ? `${text("origin")}: its times are of another machine` : ""],
      ["side by side", value("jobs") > 1 ? `with up to ${value("jobs") - 1} other solves` : ""],
      ["problem", h("span", {}, h("code", {}, facts.problems.address[problem]), sizes(facts.problems.sizes[problem]))],
      ["its source", [about.source, about.citation].filter(Boolean).join("; ")],
      ["its licence", about.licence ?? ""],
    ]);
    const parts = ["convert", "setup", "solve", "lift"]
      .map((name) => [name === "lift" ? "carry back" : name, value(name)])
      .filter(([, v]) => Number.isFinite(v));
    const most = Math.max(...parts.map(([, v]) => v), 1e-12);
    const times = parts.length
      ? [
          h("h3", {}, `Time ${Dom.seconds(parts.reduce((sum, [, v]) => sum + v, 0))}`),
          h(
            "div",
            { class: "bars" },
            parts.flatMap(([name, v]) => [
              h("span", {}, name),
              h("div", { class: "bar", style: `width: ${(100 * v) / most}%` }),
              h("span", {}, Dom.seconds(v)),
            ]),
          ),
          value("repeats") > 1
            ? h(
                "p",
                { class: "scope" },
                `Median of ${value("repeats")} repeats, interquartile range ${Dom.seconds(value("solve_iqr"))}.`,
              )
            : "",
        ]
      : [];
    const command = text("command");
    App.opened(row);
    const copy = h(
      "button",
      {
        type: "button",
        onclick: async () => {
          await navigator.clipboard.writeText(command);
          copy.textContent = "Copied";
        },
      },
      "Copy",
    );
    show(
      [facts.problems.name[problem], " × ", label],
      facts1,
      h("h3", {}, "The problem"),
      ...Thumbnail.draw(facts.problems.thumbnail[problem]),
      ...times,
      ...(text("message") ? [h("h3", {}, "Its log: what it said"), h("pre", { tabindex: "0" }, text("message"))] : []),
      ...numbers("Residuals", text("parts")),
      ...numbers("Counters", text("counters")),
      ...(command
        ? [
            h("h3", {}, "Again ", copy),
            h("pre", { tabindex: "0" }, command),
            ...(command.startsWith("cpbench solve ")
              ? [h("h3", {}, "Its answer, written to a file"), h("pre", { tabindex: "0" }, `${command} -o answer.npy`)]
              : []),
          ]
        : [
            h(
              "p",
              { class: "scope" },
              "Of so many rows this page has the facts of some failures only: the others are in the results file.",
            ),
          ]),
    );
  }

  const slip = (parts) => {
    const angle = parts ? JSON.parse(parts)["slip_angle [deg]"] : null;
    return angle === null || angle === undefined
      ? ""
      : `${Dom.number(angle)}° off the direction that the law prescribes`;
  };
  const sizes = (of) => {
    const told = Object.entries(of)
      .map(([k, v]) => `${k} ${v}`)
      .join(", ");
    return told ? ` (${told})` : "";
  };

  /* The failures of a solver on a family. */
  function list_(context, family, s, problems) {
    const { table, columns, facts } = context,
      rows = problems
        .map((p) => table.row[p * table.labels.length + s])
        .filter((r) => r >= 0 && !Engine.solved(columns, r, context.state.tolerance, facts.status));
    const told = rows.filter((r) => columns.detail[r] > 0),
      shown = told.slice(0, 100);
    show(
      [family || "(no family)", " × ", context.name(s)],
      h(
        "p",
        {},
        `${rows.length} of ${problems.length} not solved; ${told.length} of these have their facts on this page.`,
      ),
      shown.length
        ? Dom.table({
            caption: "Failures",
            head: ["problem", "verdict", "error", ""],
            right: [2],
            rows: shown.map((r) => [
              facts.problems.name[columns.problem[r]],
              badge(context, context.statusOf(r)),
              Dom.number(columns.error[r]),
              h("button", { type: "button", onclick: () => open(context, r) }, "open"),
            ]),
          })
        : "",
    );
  }

  return Object.freeze({ open, list: list_ });
})();
