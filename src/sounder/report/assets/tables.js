/* Tables that sort and filter. */

const SHOWN = 200;

/* Whether a row passes a filter: each part is a text in the row, or a comparison such as delay>300. */
function passes(row, columns, filter) {
  return filter.toLowerCase().split(/\s+/).filter(Boolean).every((part) => {
    const comparison = part.match(/^(.+)([<>])(-?[\d.]+)$/);
    if (comparison) {
      const column = columns.find((one) => one.label.toLowerCase().replace(/\s+/g, "").startsWith(comparison[1]));
      const value = column && column.value(row);
      if (column) return Number.isFinite(value) && (comparison[2] === "<" ? value < Number(comparison[3]) : value > Number(comparison[3]));
    }
    return columns.some((column) => column.text(row).toLowerCase().includes(part));
  });
}

/* Numbers by size, texts by their numbers and letters, unknown values last. */
function compare(a, b) {
  const unknown = (value) => value === null || value === undefined;
  if (unknown(a) || unknown(b)) return unknown(a) - unknown(b);
  return typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
}

/*
 * Make a table of rows.
 *   caption: text; columns: [{label, title, value: (row) => number or text, text: (row) => text}]
 *   pick: (row) => ..., called by the button in the first column

 */
function table(host, { caption, columns, rows, pick }) {
  let [sorted, direction, all] = [null, 1, false];
  const name = host.id;
  const search = html("input", { type: "search", id: `${name}-filter`, oninput: () => { all = false; draw(); } });
  const count = html("span", { role: "status" });
  const more = button("Show all rows", () => { all = true; draw(); });
  const heads = columns.map((column, i) => html("th", { scope: "col", title: column.title }, button(column.label, () => {
    direction = sorted === i ? -direction : 1;
    sorted = i;
    draw();
  })));
  const body = html("tbody");
  function draw() {
    let found = rows.filter((row) => passes(row, columns, search.value));
    if (sorted !== null) {
      const { value } = columns[sorted];
      const unknown = (row) => value(row) === null || value(row) === undefined;
      found = [...found].sort((a, b) => (unknown(a) || unknown(b) ? 1 : direction) * compare(value(a), value(b)));
    }
    heads.forEach((head, i) => {
      head.setAttribute("aria-sort", sorted !== i ? "none" : direction > 0 ? "ascending" : "descending");
    });
    const shown = all ? found : found.slice(0, SHOWN);
    body.replaceChildren(...shown.map((row) => html("tr", {}, ...columns.map((column, i) => {
      const text = column.text(row);
      return i ? html("td", {}, text) : html("th", { scope: "row" }, button(text, () => pick(row), { class: "link" }));
    }))));
    more.hidden = shown.length === found.length;
    count.textContent = `${shown.length} of ${found.length} rows${found.length < rows.length ? `, ${rows.length} in all` : ""}`;
  }
  host.replaceChildren(
    html("p", { class: "tools" }, html("label", { for: search.id }, "Filter"), search, count, more,
      html("span", { class: "hint" }, "A text, or a comparison such as delay>300.")),
    html("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": caption },
      html("table", {}, html("caption", {}, caption), html("thead", {}, html("tr", {}, ...heads)), body)),
  );
  draw();

}
