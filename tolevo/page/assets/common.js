"use strict";
// What all interactive pages share. Text from outside reaches the page through textContent only.

const SYMBOLS = ["square", "triangle", "diamond", "cross", "down", "plus"];
const DASHES = ["6 3", "2 3", "8 3 2 3", "10 4", "1 4"];
const HUES = ["--a", "--b", "--c", "--d", "--e"];

function data() {
  return JSON.parse(document.getElementById("data").textContent);
}

function element(tag, text = "", attributes = {}) {
  const found = document.createElement(tag);
  if (text) found.textContent = text;
  for (const [name, value] of Object.entries(attributes)) found.setAttribute(name, value);
  return found;
}

function number(value, digits = 4) {
  if (value === null || value === undefined || value === "") return "";
  if (typeof value !== "number") return String(value);
  if (!Number.isFinite(value)) return "";
  if (Number.isInteger(value) && Math.abs(value) < 1e15) return String(value);
  return Math.abs(value) >= 1e4 ? value.toFixed(0) : String(Number(value.toPrecision(digits)));
}

function signed(value, digits = 3) {
  const text = number(value, digits);
  return text && value > 0 ? `+${text}` : text.replace("-", "\u2212");
}

function erf(x) { // Abramowitz & Stegun 7.1.26, error below 1.5e-7
  const t = 1 / (1 + 0.3275911 * Math.abs(x));
  const rest = ((((1.061405429 * t - 1.453152027) * t + 1.421413741) * t - 0.284496736) * t + 0.254829592) * t * Math.exp(-x * x);
  return Math.sign(x) * (1 - rest);
}

function withUnit(value, unit) {
  return `${value} ${unit}`.trim();
}

function title(axis) {
  return axis.unit ? `${axis.label} [${axis.unit}]` : axis.label;
}

function labelled(text, control, className = "") {
  const label = element("label", text, className ? { class: className } : {});
  label.append(control);
  return label;
}

// A table of rows of cells: a cell is a text, a number, or an element; `heads` are [text, hint].
// Each cell knows its heading, so that a narrow screen can show a row as a card.
function tableOf(heads, rows, caption) {
  const table = element("table", "", { class: "cards" });
  if (caption) table.append(element("caption", caption));
  const top = element("thead");
  const line = element("tr");
  heads.forEach(([text, hint]) => line.append(element("th", text, hint ? { scope: "col", title: hint } : { scope: "col" })));
  top.append(line);
  const body = element("tbody");
  rows.forEach((cells) => {
    const row = element("tr");
    cells.forEach((cell, at) => {
      const found = at ? element("td", "", { "data-head": heads[at][0] }) : element("th", "", { scope: "row" });
      if (cell instanceof Node) found.append(cell);
      else found.textContent = cell;
      if (at && !(cell instanceof Node) && /^[+\u2212\d]/.test(cell)) found.classList.add("n");
      row.append(found);
    });
    body.append(row);
  });
  table.append(top, body);
  return table;
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
