"use strict";
/* What is chosen, as the part of the page's address behind the #: a section, then `?` and the filters by name, so that a
   link shows the same to whoever has the same file. */
const Address = (() => {
  const list = (names) => names.map(encodeURIComponent).sort().join(",");
  const names = (text) => (text ? text.split(",").map(decodeURIComponent) : []);
  const number = (text) => (text && Number.isFinite(Number(text)) ? Number(text) : null);

  /* The section and the values in the address. */
  function parts() {
    const [section, query = ""] = location.hash.slice(1).split("?");
    return { section, query: new URLSearchParams(query) };
  }

  /* The state that an address asks for, null where it asks for none; names that are not there are passed over. */
  function read(facts, { query } = parts()) {
    if (![...query.keys()].length) return null;
    const codes = new Map(facts.labels.name.map((name, k) => [name, k])),
      group = facts.groups.findIndex((g) => g.name === query.get("group")),
      metric = facts.metrics.find((m) => m.name === query.get("cost"))?.name;
    return {
      ...Filters.initial(group < 0 ? facts.first : group),
      ...(metric ? { metric } : {}),
      tolerance: facts.tolerances.find((t) => t === number(query.get("tolerance"))) ?? null,
      families: new Set(names(query.get("without"))),
      symbol: query.get("size") ?? "",
      low: number(query.get("from")),
      high: number(query.get("to")),
      exact: query.get("exact") === "1",
      hidden: new Set(names(query.get("hidden")).filter((name) => codes.has(name)).map((name) => codes.get(name))),
    };
  }

  /* The filters of a state that are not those of a page as it opens, and the pair of the row that is open. */
  function written({ problems, labels, groups, first }, state, row, columns) {
    const { low, high, group, metric } = state;
    const chosen = {
      group: group === first ? "" : groups[group].name,
      cost: metric === "time" ? "" : metric,
      tolerance: state.tolerance,
      without: list([...state.families]),
      size: low === null && high === null ? "" : state.symbol,
      from: low,
      to: high,
      exact: state.exact ? "1" : "",
      hidden: list([...state.hidden].map((code) => labels.name[code])),
      problem: row === null ? "" : problems.name[columns.problem[row]],
      solver: row === null ? "" : labels.name[columns.label[row]],
    };
    return new URLSearchParams(Object.entries(chosen).filter(([, value]) => (value ?? "") !== "")).toString();
  }

  function write(facts, state, row, columns) {
    const query = written(facts, state, row, columns), { section } = parts();
    history.replaceState(null, "", query || section ? `#${section}${query ? `?${query}` : ""}` : location.pathname);
  }

  /* The row of the pair that an address names; -1 without one. */
  function pair({ facts, columns }, k, { query } = parts()) {
    const { first, count } = facts.groups[k],
      problem = facts.problems.name.indexOf(query.get("problem") ?? "\n"),
      label = facts.labels.name.indexOf(query.get("solver") ?? "\n"),
      there = (p, r) => r >= first && r < first + count && p === problem && columns.label[r] === label;
    return columns.problem.findIndex(there);
  }

  return Object.freeze({ parts, read, write, pair });
})();
