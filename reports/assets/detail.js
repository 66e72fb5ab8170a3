"use strict";
// The allocation of one point: table, bars, shares, and its text as CSV.

function bar(share, kind) {
  const outer = element("span", "", { class: "bar" });
  const inner = element("span", "", { class: kind });
  inner.style.width = `${Math.max(0, Math.min(100, share))}%`;
  outer.append(inner);
  return outer;
}

function shareOf(found, output, row, name) {
  const own = found.contributions.find((one) => one.output === output);
  if (!own) return null;
  const column = own.names.indexOf(name);
  if (column < 0) return null;
  let best = 0;
  own.rows.forEach((at, place) => {
    if (Math.abs(at - row) < Math.abs(own.rows[best] - row)) best = place;
  });
  return own.shares[column][best];
}

function allocationTable(found, at, reference) {
  const row = found.rows[at];
  const ordered = found.rounded[row] || null;
  const output = found.contributions.length ? found.contributions[0].output : "";
  const table = element("table");
  const head = element("tr");
  const names = ["variable", "this point", "unit"];
  if (ordered) names.push("to order");
  if (reference) names.push(reference.label, "side by side");
  if (output) names.push("contribution");
  for (const name of names) head.append(element("th", name, { scope: "col" }));
  const top = element("thead");
  top.append(head);
  const body = element("tbody");
  found.variables.forEach((variable, place) => {
    const line = element("tr");
    const value = found.values[place][at];
    line.append(element("th", variable.label, { scope: "row", title: variable.meaning }));
    line.append(element("td", number(value), { class: "n" }), element("td", variable.unit));
    if (ordered) line.append(element("td", number(ordered[variable.name]), { class: "n" }));
    if (reference) sideBySide(line, value, reference.values[place]);
    if (output) contribution(line, shareOf(found, output, row, variable.name));
    body.append(line);
  });
  table.append(top, body);
  return table;
}

function sideBySide(line, value, other) {
  line.append(element("td", number(other), { class: "n" }));
  const cell = element("td", "", { class: "bars" });
  if (typeof value === "number" && typeof other === "number") {
    const most = Math.max(Math.abs(value), Math.abs(other)) || 1;
    cell.append(bar(100 * Math.abs(value) / most, "own"), bar(100 * Math.abs(other) / most, "other"));
  }
  line.append(cell);
}

function contribution(line, share) {
  const cell = element("td", "", { class: "bars" });
  if (share !== null) cell.append(bar(Math.abs(share), "own"), element("span", `${share.toFixed(1)} %`));
  line.append(cell);
}

function headline(found, at) {
  const values = found.objectives.map((axis, place) =>
    `${axis.label} ${number(found.aims[place][at])} ${axis.unit}`.trim());
  const named = found.choices.filter((one) => one.row === found.rows[at]).map((one) => one.name);
  const label = named.length ? ` (${named.join(", ")})` : "";
  return `Point ${found.rows[at]}${label}: ${values.join("; ")}`;
}

function distance(found, at) {
  const bound = found.bound[at];
  if (bound === null || bound === undefined) return "No bound of its cost is proven.";
  return `Proven: nothing of equal other objectives costs less than ${number(bound)}; this point `
    + `lies ${number(found.gap[at])} % above.`;
}

function cell(value) {
  const text = value === null || value === undefined ? "" : String(value);
  return /[",\n\r]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
}

function asCSV(found, at) {
  const row = found.rows[at];
  const ordered = found.rounded[row] || {};
  const lines = [["name", "unit", "value", "rounded"]];
  found.variables.forEach((one, place) =>
    lines.push([one.name, one.unit, found.values[place][at], ordered[one.name]]));
  found.objectives.forEach((one, place) => lines.push([one.name, one.unit, found.aims[place][at], ""]));
  return lines.map((line) => line.map(cell).join(",")).join("\n") + "\n";
}

async function copied(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch (error) { // not allowed here: the old way
    const area = element("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    const done = document.execCommand("copy");
    area.remove();
    return done;
  }
}
