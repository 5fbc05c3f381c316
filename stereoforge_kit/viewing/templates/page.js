"use strict";
// Tables: a press on a heading sorts by that column, a second press the other way round; what is no number among
// numbers (a dash) comes last either way.
function cellValue(row, column) {
  const cell = row.cells[column];
  const text = cell.dataset.value ?? cell.textContent.trim();
  const number = parseFloat(text);
  return Number.isNaN(number) ? text : number;
}
function compareCells(a, b, sign) {
  if (typeof a === "number" && typeof b === "number") return sign * (a - b);
  if (typeof a === "number") return -1;
  if (typeof b === "number") return 1;
  return sign * a.localeCompare(b);
}
function sortTable(table, heading) {
  const headings = [...heading.parentNode.cells];
  const column = headings.indexOf(heading);
  const ascending = heading.getAttribute("aria-sort") !== "ascending";
  for (const other of headings) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", ascending ? "ascending" : "descending");
  const body = table.tBodies[0];
  const sign = ascending ? 1 : -1;
  body.append(...[...body.rows].sort((a, b) => compareCells(cellValue(a, column), cellValue(b, column), sign)));
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
// A table that has been scrolled sideways shows where its first column, which stays, ends.
for (const box of document.querySelectorAll(".table-scroll")) {
  box.addEventListener("scroll", () => box.classList.toggle("scrolled", box.scrollLeft > 0), { passive: true });
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
// Plots: a pointer (or a finger) over one reads every curve at that place.
function nearestPoint(curve, x) {
  let best = null;
  for (let i = 0; i < curve.x.length; i++) {
    if (curve.x[i] === null || curve.y[i] === null) continue;
    if (best === null || Math.abs(curve.x[i] - x) < Math.abs(curve.x[best] - x)) best = i;
  }
  return best;
}
function plotReader(plot) {
  const facts = JSON.parse(plot.dataset.plot);
  const [left, top, width, height] = facts.box;
  const drawing = plot.querySelector("svg");
  const line = Object.assign(document.createElement("span"), { className: "plot-line" });
  const note = Object.assign(document.createElement("div"), { className: "plot-note" });
  plot.append(line, note);
  plot.addEventListener("pointerleave", () => plot.classList.remove("reading"));
  plot.addEventListener("pointermove", event => {
    const frame = drawing.getBoundingClientRect(), home = plot.getBoundingClientRect();
    const share = ((event.clientX - frame.left) / frame.width - left) / width;
    if (share < 0 || share > 1) { plot.classList.remove("reading"); return; }
    const x = facts.x[0] + share * (facts.x[1] - facts.x[0]);
    const rows = facts.curves.map(curve => [curve, nearestPoint(curve, x)]).filter(([, i]) => i !== null);
    if (rows.length === 0) return;
    const at = rows[0][0].x[rows[0][1]];
    note.replaceChildren(...[`${facts.x_label}: ${at}`, ...rows.map(([c, i]) => `${c.name}: ${c.y[i]}`)].map(text =>
      Object.assign(document.createElement("div"), { textContent: text })));
    const place = (at - facts.x[0]) / (facts.x[1] - facts.x[0]);
    const offset = frame.left - home.left + plot.scrollLeft, across = offset + frame.width * (left + width * place);
    Object.assign(line.style, { left: `${across}px`, top: `${frame.height * top}px`, height: `${frame.height * height}px` });
    note.style.top = `${frame.height * top}px`;
    note.style.left = place < 0.5 ? `${across + 8}px` : "auto";
    note.style.right = place < 0.5 ? "auto" : `${home.width - across + 8}px`;
    plot.classList.add("reading");
  });
}
for (const plot of document.querySelectorAll(".plot[data-plot]")) plotReader(plot);
