"use strict";
/* The sheet of one pair: what was measured, what it cost, what it said, and the command that runs it again. */
const Pair = (() => {
  const { h } = Dom;

  const badge = (context, status) =>
    h("span", { class: `badge k-${status}` }, `${context.symbolOf(status)} ${status.replace("_", " ")}`);
  const list = (entries) =>
    h("dl", {}, entries.filter(([, value]) => value).flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]));
  const preformatted = (text) => h("pre", { tabindex: "0" }, text);

  function show(title, ...children) {
    const dialog = document.getElementById("pair"),
      close = h("button", { type: "button", onclick: () => dialog.close() }, "Close");
    const header = h("header", {}, h("h2", { id: "pair-title" }, ...title), close);
    dialog.replaceChildren(header, h("div", { class: "body" }, ...children));
    if (!dialog.open) dialog.showModal();
    dialog.scrollTop = 0;
  }

  function numbers(caption, text) {
    const rows = Object.entries(text ? JSON.parse(text) : {}).map(([name, value]) => [name, Dom.number(value)]);
    return rows.length ? [h("h3", {}, caption), Dom.table({ caption, head: ["what", "value"], right: [1], rows })] : [];
  }

  /* What is kept of a row: texts and numbers by name; '' and NaN where nothing is. */
  function kept({ columns, facts }, row) {
    const at = columns.detail[row] - 1;
    return {
      text: (name) => (at < 0 ? "" : facts.texts[name][columns[`detail.${name}`][at]]),
      value: (name) => (at < 0 ? NaN : (columns[`detail.${name}`]?.[at] ?? NaN)),
    };
  }

  function verdict(context, row, { text, value }) {
    const { columns, facts, group, state } = context, { notes } = facts, kind = text("kind"),
      flags = text("flags").split(",").filter(Boolean),
      there = text("route") !== "direct" && Number.isFinite(value("target_error")),
      memory = columns.memory?.[row];
    const explained = (f, k) => [k ? "; " : "", h("strong", {}, f), notes.flags[f] ? `: ${notes.flags[f]}` : ""];
    const ends = ["code", "signal"].filter((name) => Number.isFinite(value(name)));
    const at = state.tolerance === null ? "" : ` at ${Dom.number(state.tolerance)}`;
    return [
      ["verdict", h("span", {}, badge(context, context.statusOf(row)), at)],
      ["claim", text("claim") || "none"],
      ["error", `${Dom.number(columns.error[row])} (tolerance ${Dom.number(group.tolerance)})`],
      ["error there", there && `${Dom.number(value("target_error"))} on the solver's own problem`],
      ["certainty", [text("certainty"), text("certificate")].filter(Boolean).join(": ")],
      ["from a solution", Number.isFinite(value("distance")) && `at most ${Dom.number(value("distance"))} of its size`],
      ["slip angle", slip(text("parts"))],
      ["route", text("route") && h("span", {}, h("code", {}, text("route")), kind && `: ${kind}, ${notes.kinds[kind] ?? ""}`)],
      ["flags", flags.length && h("span", {}, flags.flatMap(explained))],
      ["start", text("started") || group.start],
      ["limit", group.limit === null ? "none" : Dom.seconds(group.limit)],
      ["memory", Number.isFinite(memory) && `${Dom.bytes(memory)} on top of what was there`],
      ["version", text("version")],
      ["ended with", ends.map((name) => `${name} ${value(name)}`).join(", ")],
      ["made elsewhere", text("origin") && `${text("origin")}: its times are of another machine`],
      ["side by side", value("jobs") > 1 && `with up to ${value("jobs") - 1} other solves`],
    ];
  }

  function times({ value }) {
    const parts = [["convert", "convert"], ["setup", "setup"], ["solve", "solve"], ["lift", "carry back"]]
      .map(([name, text]) => [text, value(name)])
      .filter(([, v]) => Number.isFinite(v));
    if (!parts.length) return [];
    const most = Math.max(...parts.map(([, v]) => v), 1e-12),
      sum = parts.reduce((all, [, v]) => all + v, 0),
      bar = (v) => h("div", { class: "bar", style: `width: ${(100 * v) / most}%` });
    const repeats = `Median of ${value("repeats")} repeats, interquartile range ${Dom.seconds(value("solve_iqr"))}.`;
    return [
      h("h3", {}, `Time ${Dom.seconds(sum)}`),
      h("div", { class: "bars" }, parts.flatMap(([name, v]) => [h("span", {}, name), bar(v), h("span", {}, Dom.seconds(v))])),
      value("repeats") > 1 ? h("p", { class: "scope" }, repeats) : "",
    ];
  }

  function commands(command) {
    if (!command) {
      const absent = "Of so many rows this page has the facts of some failures only: the others are in the results file.";
      return [h("p", { class: "scope" }, absent)];
    }
    const onclick = async () => {
      await navigator.clipboard.writeText(command);
      copy.textContent = "Copied";
    };
    const copy = h("button", { type: "button", onclick }, "Copy"),
      answer = [h("h3", {}, "Its answer, written to a file"), preformatted(`${command} -o answer.npy`)];
    const again = [h("h3", {}, "Again ", copy), preformatted(command)];
    return command.startsWith("cpbench solve ") ? [...again, ...answer] : again;
  }

  function open(context, row) {
    const { columns, facts } = context, details = kept(context, row),
      problem = columns.problem[row],
      origin = facts.origins[facts.problems.family[problem]] ?? {},
      message = details.text("message");
    App.opened(row);
    show(
      [facts.problems.name[problem], " × ", facts.labels.name[columns.label[row]]],
      list([
        ...verdict(context, row, details),
        ["problem", h("span", {}, h("code", {}, facts.problems.address[problem]), sizes(facts.problems.sizes[problem]))],
        ["its source", origin.source],
        ["its licence", origin.licence],
      ]),
      ...times(details),
      ...(message ? [h("h3", {}, "Its log: what it said"), preformatted(message)] : []),
      ...numbers("Residuals", details.text("parts")),
      ...numbers("Counters", details.text("counters")),
      ...commands(details.text("command")),
    );
  }

  function slip(parts) {
    const angle = parts ? (JSON.parse(parts)["slip_angle [deg]"] ?? null) : null;
    return angle === null ? "" : `${Dom.number(angle)}° off the direction that the law prescribes`;
  }

  function sizes(of) {
    const all = Object.entries(of).map(([k, v]) => `${k} ${v}`);
    return all.length ? ` (${all.join(", ")})` : "";
  }

  /* The failures of a solver on a family. */
  function failures(context, family, s, problems) {
    const { columns, facts } = context,
      failed = problems.map((p) => context.rowAt(p, s)).filter((r) => r >= 0 && !context.solved(r)),
      detailed = failed.filter((r) => columns.detail[r] > 0);
    const rows = detailed.slice(0, 100).map((r) => [
      facts.problems.name[columns.problem[r]],
      badge(context, context.statusOf(r)),
      Dom.number(columns.error[r]),
      h("button", { type: "button", onclick: () => open(context, r) }, "open"),
    ]);
    const counts = `${failed.length} of ${problems.length} not solved; ${detailed.length} of these have their facts on this page.`,
      head = ["problem", "verdict", "error", ""];
    const table = rows.length ? Dom.table({ caption: "Failures", head, right: [2], rows }) : "";
    show([family || "(no family)", " × ", context.name(s)], h("p", {}, counts), table);
  }

  return Object.freeze({ open, list: failures });
})();
