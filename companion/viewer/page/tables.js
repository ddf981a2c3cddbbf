// The tables of a record, and its settings and versions in folds.

import { make } from "viewer/dom.js";

/** A number, perhaps with how far it is from another in brackets; or a sign for none. */
const NUMBER = /^([-−+]?\d[\d.,\s]*%?( \([-−+±]\d[\d.]*\))?|[-–]|)$/;
/** A word that is wider than a column should be. */
const LONG = /\S{14}/;
/** The same of a heading: beside each other there are several records. */
const LONG_NAME = /[^\s-]{11}/;

/** All tables, then what the run was made with. */
export function buildTables(record) {
  const { settings = {}, versions = {} } = record.scene;
  const fold = (title, values) =>
    make(
      "details",
      {},
      make("summary", {}, title),
      table(
        ["name", "value"],
        Object.entries(values).map(([name, value]) => [
          name,
          typeof value === "string" ? value : JSON.stringify(value),
        ]),
      ),
    );
  return make(
    "div",
    { class: "tables" },
    ...record.tables.map(({ title, head, rows }) => make("section", {}, make("h2", {}, title), table(head, rows))),
    fold("Settings", settings),
    fold("Versions", versions),
  );
}

function table(head, rows) {
  const numeric = head.map((_, i) => rows.every((row) => NUMBER.test(String(row[i] ?? "–"))));
  const shown = (value) => (value === "-" ? "–" : String(value ?? "–"));
  const kind = (value, i) => (numeric[i] ? "right" : LONG.test(String(value)) ? "long" : null);
  const headed = (name, i) => [numeric[i] && "right", LONG_NAME.test(name) && "long"].filter(Boolean).join(" ") || null;
  const cell = (value, i) => make("td", { class: kind(value, i) }, shown(value));
  return make(
    "div",
    { class: "scroll" },
    make(
      "table",
      {},
      make(
        "thead",
        {},
        make("tr", {}, ...head.map((name, i) => make("th", { class: headed(name, i) }, name))),
      ),
      make("tbody", {}, ...rows.map((row) => make("tr", {}, ...row.map(cell)))),
    ),
  );
}
