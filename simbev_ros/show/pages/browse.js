"use strict";
// Sorts and filters the page's table. The choice is kept in the address, so that "back" and shared links restore it.
(() => {
  const form = document.querySelector("form.filters");
  if (!form) return;
  const table = document.querySelector("table.browse");
  const rows = [...table.tBodies[0].rows];
  const heads = [...table.tHead.rows[0].cells];
  const controls = [...form.elements].filter((element) => element.name);
  const shown = document.querySelector("#shown");
  let order = null; // { column, descending }

  const value = (row, column) => row.cells[column].dataset.value;
  const tests = {
    text: (control, text) => text.toLowerCase().includes(control.value.trim().toLowerCase()),
    choice: (control, text) => text.split(" ").includes(control.value),
    min: (control, text) => Number(text) >= Number(control.value),
    max: (control, text) => Number(text) <= Number(control.value),
  };

  function compare(a, b) {
    const [one, two] = [value(a, order.column), value(b, order.column)];
    const isNumber = heads[order.column].dataset.kind === "number";
    return (isNumber ? Number(one) - Number(two) : one.localeCompare(two, "en", { numeric: true })) * (order.descending ? -1 : 1);
  }

  function filter() {
    const used = controls.filter((control) => control.value.trim() !== "");
    let count = 0;
    for (const row of rows) {
      row.hidden = !used.every((control) => tests[control.dataset.test](control, value(row, control.dataset.column)));
      count += !row.hidden;
    }
    shown.textContent = `${count} of ${rows.length} scenes`;
  }

  function sort() {
    const sorted = order ? [...rows].sort(compare) : rows;
    table.tBodies[0].append(...sorted);
    heads.forEach((head, column) => {
      if (!head.querySelector("button")) return;
      const isSorted = order && order.column === column;
      head.setAttribute("aria-sort", isSorted ? (order.descending ? "descending" : "ascending") : "none");
    });
  }

  function save() {
    const state = new URLSearchParams();
    controls.filter((control) => control.value.trim() !== "").forEach((control) => state.set(control.name, control.value));
    if (order) state.set("sort", `${order.descending ? "-" : ""}${order.column}`);
    history.replaceState(null, "", `#${state}`);
  }

  function restore() {
    const state = new URLSearchParams(location.hash.slice(1));
    controls.forEach((control) => { control.value = state.get(control.name) ?? ""; });
    const sorted = /^(-?)(\d+)$/.exec(state.get("sort") ?? "");
    order = sorted && heads[sorted[2]]?.querySelector("button") ? { column: Number(sorted[2]), descending: sorted[1] === "-" } : null;
    sort();
    filter();
  }

  heads.forEach((head, column) => head.querySelector("button")?.addEventListener("click", () => {
    order = { column, descending: order?.column === column && !order.descending };
    sort();
    save();
  }));
  for (const kind of ["input", "change"]) form.addEventListener(kind, () => { filter(); save(); });
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("reset", () => setTimeout(() => { order = null; sort(); filter(); save(); }));
  window.addEventListener("hashchange", restore);
  form.hidden = false;
  restore();
})();
