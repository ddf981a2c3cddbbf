// Filters and sorts the table of runs. Without it the table stands as it was written: what went wrong first.

const table = document.querySelector("#runs table");
const heads = [...table.tHead.rows[0].cells];
const rows = [...table.tBodies[0].rows];
const bar = document.querySelector("#filter");
const words = bar.querySelector("input");
const text = (row, column) => row.cells[column].textContent;

function inOrder(one, two) {
  const both = [one, two].map((value) => (value === "" ? NaN : Number(value)));
  return both.some(Number.isNaN) ? one.localeCompare(two, "en", { numeric: true }) : both[0] - both[1];
}

function choice(column) {
  const select = document.createElement("select");
  const values = [...new Set(rows.map((row) => text(row, column)))].sort(inOrder);
  select.add(new Option("all", "all"));
  values.forEach((value, number) => select.add(new Option(value || "none", number)));
  const label = document.createElement("label");
  label.append(`${heads[column].textContent} `, select);
  if (values.length > 1) words.parentElement.before(label);
  return (row) => select.value === "all" || text(row, column) === values[Number(select.value)];
}

const choices = bar.dataset.columns.split(" ").map((column) => choice(Number(column)));

function filter() {
  const wanted = words.value.toLowerCase().split(/\s+/);
  let shown = 0;
  for (const row of rows) {
    // Not in the last column: the name of the campaign's file stands in every command.
    const said = [...row.cells].slice(0, -1).map((cell) => cell.textContent.toLowerCase()).join(" ");
    row.hidden = !(choices.every((fits) => fits(row)) && wanted.every((word) => said.includes(word)));
    shown += row.hidden ? 0 : 1;
  }
  bar.querySelector("output").textContent = `${shown} of ${rows.length} rows`;
}

function sortBy(column) {
  const up = heads[column].ariaSort !== "ascending";
  heads.forEach((head) => (head.ariaSort = "none"));
  heads[column].ariaSort = up ? "ascending" : "descending";
  rows.sort((one, two) => (up ? 1 : -1) * inOrder(text(one, column), text(two, column)));
  table.tBodies[0].append(...rows);
}

heads.forEach((head, column) => {
  head.ariaSort = "none";
  head.tabIndex = 0;
  head.addEventListener("click", () => sortBy(column));
  head.addEventListener("keydown", (event) => event.key === "Enter" && sortBy(column));
});
bar.addEventListener("input", filter);
bar.hidden = false;
filter();
