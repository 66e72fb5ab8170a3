"use strict";
// Rows of marked tables by the value of one column.

(function filter() {
  document.querySelectorAll("[data-filter]").forEach((host) => {
    const wanted = host.getAttribute("data-filter");
    const columns = [...host.querySelectorAll("table")].map((table) => {
      const at = [...table.querySelectorAll("thead th")].findIndex((head) => head.title === wanted);
      return [...table.querySelectorAll("tbody tr")].map((row) => [row, at < 0 ? null : row.cells[at].textContent]).filter(([, text]) => text !== null);
    }).flat();
    const values = [...new Set(columns.map(([, text]) => text))];
    if (values.length < 2) return;
    const select = element("select", "", { id: "filter" });
    select.append(element("option", `all (${columns.length})`, { value: "" }));
    values.forEach((one) => select.append(element("option", `${one} (${columns.filter(([, text]) => text === one).length})`, { value: one })));
    select.addEventListener("change", () => columns.forEach(([row, text]) => { row.hidden = Boolean(select.value) && text !== select.value; }));
    const line = element("p", "", { class: "asks" });
    line.append(labelled(`Show ${wanted} `, select));
    host.prepend(line);
  });
})();
