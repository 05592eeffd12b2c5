"use strict";
/* What is chosen, as the part of the page's address behind the #: a section, then `?` and the filters by name, so that a
   link shows the same to whoever has the same file. */
const Address = (() => {
  const list = (names) => names.map(encodeURIComponent).join(",");
  const names = (text) => (text ? text.split(",").map(decodeURIComponent) : []);
  const number = (text) => (text === null || text === "" || !Number.isFinite(Number(text)) ? null : Number(text));

  /* The section and the values in the address. */
  function parts() {
    const [section, query = ""] = location.hash.slice(1).split("?");
    return { section, query: new URLSearchParams(query) };
  }

  /* The state that an address asks for, null where it asks for none; names that are not there are passed over. */
  function read(facts, query = parts().query) {
    if (![...query.keys()].length) return null;
    const codes = new Map(facts.labels.name.map((name, k) => [name, k])),
      group = facts.groups.findIndex((g) => g.name === query.get("group")),
      k = group < 0 ? facts.first : group;
    const metric = facts.metrics.find((m) => m.name === query.get("cost"))?.name;
    return {
      ...Filters.initial(k),
      ...(metric ? { metric } : {}),
      tolerance: number(query.get("tolerance")),
      families: new Set(names(query.get("without"))),
      symbol: query.get("size") ?? "",
      low: number(query.get("from")),
      high: number(query.get("to")),
      exact: query.get("exact") === "1",
      hidden: new Set(names(query.get("hidden")).flatMap((name) => (codes.has(name) ? [codes.get(name)] : []))),
    };
  }

  /* The filters of a state that are not those of a page as it opens. */
  function written(facts, state, row, columns) {
    const group = facts.groups[state.group],
      sized = state.low !== null || state.high !== null;
    const told = [
      ["group", state.group === facts.first ? "" : group.name],
      ["cost", state.metric === "time" ? "" : state.metric],
      ["tolerance", state.tolerance ?? ""],
      ["without", list([...state.families].sort())],
      ["size", sized ? state.symbol : ""],
      ["from", state.low ?? ""],
      ["to", state.high ?? ""],
      ["exact", state.exact ? "1" : ""],
      ["hidden", list([...state.hidden].map((code) => facts.labels.name[code]).sort())],
    ];
    if (row !== null)
      told.push(["problem", facts.problems.name[columns.problem[row]]], ["solver", facts.labels.name[columns.label[row]]]);
    return new URLSearchParams(told.filter(([, value]) => value !== "")).toString();
  }

  function write(facts, state, row, columns) {
    const query = written(facts, state, row, columns),
      { section } = parts();
    history.replaceState(null, "", query || section ? `#${section}${query ? `?${query}` : ""}` : location.pathname);
  }

  /* The row of the pair that an address names; -1 without one. */
  function pair({ facts, columns }, k, query = parts().query) {
    const problem = facts.problems.name.indexOf(query.get("problem") ?? "\n"),
      label = facts.labels.name.indexOf(query.get("solver") ?? "\n"),
      { first, count } = facts.groups[k];
    if (problem < 0 || label < 0) return -1;
    for (let r = first; r < first + count; r++)
      if (columns.problem[r] === problem && columns.label[r] === label) return r;
    return -1;
  }

  return Object.freeze({ parts, read, write, pair });
})();
