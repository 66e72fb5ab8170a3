"use strict";
// What all interactive pages share. Text from outside reaches the page through textContent, and
// Plotly through `plain`, which leaves it nothing to read as markup.

const SYMBOLS = ["square", "triangle-up", "diamond", "cross", "x", "triangle-down", "pentagon", "hexagon"];
const MARKS = ["star", "star-square", "star-diamond", "hexagram", "star-triangle-up", "hourglass", "bowtie"];
const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot"];
const HUES = ["--a", "--b", "--c", "--d", "--e"];
const NARROW = 700; // pixels

function data() {
  return JSON.parse(document.getElementById("data").textContent);
}

function element(tag, text = "", attributes = {}) {
  const found = document.createElement(tag);
  found.textContent = text;
  for (const [name, value] of Object.entries(attributes)) found.setAttribute(name, value);
  return found;
}

function plain(text) {
  return String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
}

function number(value) {
  if (value === null || value === undefined || value === "") return "";
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value) && Math.abs(value) < 1e15) return String(value);
  return Math.abs(value) >= 1e4 ? value.toFixed(0) : String(Number(value.toPrecision(4)));
}

function tone(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

function title(axis) {
  return axis.unit ? `${axis.label} [${axis.unit}]` : axis.label;
}

function narrow() {
  return window.innerWidth < NARROW;
}

// A name as the legend of a narrow screen has room for it: in lines.
function entry(name) {
  const words = plain(name).split(" ");
  if (!narrow()) return words.join(" ");
  const lines = [""];
  for (const word of words) {
    const last = lines[lines.length - 1];
    if (last && last.length + word.length > 34) lines.push(word);
    else lines[lines.length - 1] = last ? `${last} ${word}` : word;
  }
  return lines.join("<br>");
}

// `names` are those of the legend: long ones take a line each.
function layout(x, y, names) {
  const one = narrow() || names.some((name) => name.length > 42);
  const ink = tone("--ink");
  const line = tone("--line");
  const axis = (text) => ({
    title: { text: plain(text), standoff: 8 }, gridcolor: line, zeroline: false, linecolor: ink,
    automargin: true, ticks: "outside", tickcolor: line,
  });
  const lines = names.reduce((sum, name) => sum + name.split("<br>").length, 0);
  const below = 20 * (one ? lines : Math.ceil(names.length / 2));
  return {
    height: 410 + below,
    margin: { l: 55, r: 12, t: 12, b: 70 + below },
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: ink, size: 13, family: "system-ui, sans-serif" },
    showlegend: names.length > 0, hovermode: "closest", hoverlabel: { align: "left" },
    legend: { orientation: "h", x: 0, xanchor: "left", y: -0.24, yanchor: "top", font: { size: 12 },
              entrywidth: one ? 0.95 : 0.48, entrywidthmode: "fraction" },
    xaxis: axis(x), yaxis: axis(y), dragmode: narrow() ? false : "zoom",
  };
}

const CONFIG = { responsive: true, displaylogo: false, scrollZoom: false,
                 modeBarButtonsToRemove: ["select2d", "lasso2d", "toImage"] };

// Draws now, and again when the scheme of the system or the kind of screen changes.
function drawn(draw) {
  let was = narrow();
  draw();
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  window.addEventListener("resize", () => {
    if (narrow() !== was) { was = narrow(); draw(); }
  });
}
