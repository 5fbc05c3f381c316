"use strict";
// Tables: a press on a heading sorts by that column, a second press the other way round.
function cellValue(row, column) {
  const cell = row.cells[column];
  const text = cell.dataset.value ?? cell.textContent.trim();
  const number = parseFloat(text);
  return Number.isNaN(number) ? text : number;
}
function compareCells(a, b) {
  if (typeof a === "number" && typeof b === "number") return a - b;
  if (typeof a === "number") return -1;
  if (typeof b === "number") return 1;
  return a.localeCompare(b);
}
function sortTable(table, heading) {
  const headings = [...heading.parentNode.cells];
  const column = headings.indexOf(heading);
  const ascending = heading.getAttribute("aria-sort") !== "ascending";
  for (const other of headings) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", ascending ? "ascending" : "descending");
  const body = table.tBodies[0];
  const rows = [...body.rows].sort((a, b) => compareCells(cellValue(a, column), cellValue(b, column)));
  body.append(...(ascending ? rows : rows.reverse()));
}
for (const table of document.querySelectorAll("table.sortable")) {
  for (const heading of table.tHead.rows[table.tHead.rows.length - 1].cells) {
    heading.tabIndex = 0;
    heading.addEventListener("click", () => sortTable(table, heading));
    heading.addEventListener("keydown", event => {
      if (event.key === "Enter" || event.key === " ") { event.preventDefault(); sortTable(table, heading); }
    });
  }
}
// Before/after: the range input lies invisibly over the pictures, so mouse, touch and arrow keys all work.
for (const stage of document.querySelectorAll(".compare-stage")) {
  const input = stage.querySelector("input");
  input.addEventListener("input", () => stage.style.setProperty("--share", input.value + "%"));
}
// Blink: two pictures in turn, twice a second, until pressed again.
for (const figure of document.querySelectorAll("figure.blink")) {
  let timer = null;
  figure.querySelector("button").addEventListener("click", () => {
    if (timer === null) { timer = setInterval(() => figure.classList.toggle("second"), 500); }
    else { clearInterval(timer); timer = null; }
  });
  figure.querySelector(".blink-stage").addEventListener("click", () => figure.classList.toggle("second"));
}
