"use strict";
// A chart as SVG: axes, lines, thousands of points in one path, marks, and picking of the nearest.

const xmlns="http://www.w3.org/2000/svg";
const SHAPES = {
  circle: "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0-10 0", square: "M-5-5h10v10h-10z", triangle: "M0-6l6 11h-12z",
  diamond: "M0-7l6 7l-6 7l-6-7z", cross: "M-5-5l10 10M-5 5l10-10", down: "M0 6l6-11h-12z", plus: "M-6 0h12M0-6v12",
  star: "M0-8l2 5.4h5.7l-4.6 3.5 1.7 5.6-4.8-3.3-4.8 3.3 1.7-5.6-4.6-3.5h5.7z",
};

function svg(tag, attributes = {}, text = "") {
  const found = document.createElementNS(xmlns, tag);
  for (const [name, value] of Object.entries(attributes)) if (value !== undefined) found.setAttribute(name, value);
  if (text) found.textContent = text;
  return found;
}

function ticks(low, high, most) {
  const rough = (high - low) / Math.max(1, most);
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((one) => one * power >= rough * 0.999);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const found = [];
  for (let at = Math.ceil(low / step - 1e-9); at * step <= high * (1 + 1e-12) + 1e-300; at += 1) {
    found.push([at * step, (at * step).toFixed(Math.min(digits, 12))]);
  }
  return found;
}

function extent(columns) {
  let low = Infinity;
  let high = -Infinity;
  columns.forEach((column) => column.forEach((value) => {
    if (typeof value === "number" && Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
  }));
  if (low > high) return [0, 1];
  const pad = (high - low || Math.abs(high) || 1) * 0.04;
  return [low - pad, high + pad];
}

// What a series looks like, for the drawing and for the legend alike.
function painted(node, series) {
  const colour = `var(${series.colour || "--front"})`;
  const hollow = series.hollow || series.kind === "line" || series.kind === "dots";
  node.setAttribute("style", [
    `stroke:${colour}`, `fill:${series.kind === "area" ? colour : hollow ? "none" : colour}`,
    `stroke-width:${series.width || 1.5}`, series.dash ? `stroke-dasharray:${series.dash}` : "",
    series.kind === "area" ? "stroke:none;fill-opacity:.18" : "", series.kind === "dots" ? "stroke-linecap:round" : "",
  ].filter(Boolean).join(";"));
  return node;
}

function swatch(series) {
  const box = svg("svg", { width: 26, height: 14, viewBox: "0 0 26 14", "aria-hidden": "true" });
  const path = series.kind === "mark" ? svg("path", { d: SHAPES[series.symbol], transform: "translate(13 7) scale(.8)" })
    : svg("path", { d: series.kind === "area" ? "M1 2h24v10h-24z" : series.kind === "dots" ? "M5 7h0M13 7h0M21 7h0" : "M1 7h24" });
  box.append(painted(path, series));
  return box;
}

// `spec`: x, y (axes with label and unit), series of {kind: line | dots | mark | area, x, y, name, ...},
// points {x, y} that can be picked, `pick(at)`, and `hint(at)`. Returns {select, shade, draw}.
function chart(host, spec) {
  const picture = svg("svg", { role: "img", "aria-label": `${title(spec.y)} against ${title(spec.x)}`, class: "chart" });
  const tip = element("div", "", { class: "tip", hidden: "" });
  const state = { at: null, kept: null, tangent: null };
  let place = null;
  let layer = null;
  host.classList.add("plot");
  host.append(picture, tip);

  function path(x, y, joined) {
    let text = "";
    let pen = false;
    for (let at = 0; at < x.length; at += 1) {
      if (typeof x[at] !== "number" || typeof y[at] !== "number") { pen = false; continue; }
      const here = `${place.x(x[at]).toFixed(1)} ${place.y(y[at]).toFixed(1)}`;
      text += joined ? (pen ? `L${here}` : `M${here}`) : `M${here}h0`;
      pen = true;
    }
    return text;
  }

  function area(series) {
    const there = path(series.x, series.y, true);
    const back = path([...series.x2].reverse(), [...series.y2].reverse(), true);
    return there && back ? `${there}${back.replace("M", "L")}Z` : "";
  }

  function scales() {
    const box = host.getBoundingClientRect();
    const width = Math.max(240, box.width);
    const height = Math.max(220, host.clientHeight || 420);
    const edge = { left: 62, right: 14, top: 10, bottom: 44 };
    const drawn = spec.series.filter((one) => !one.beyond);
    const [x0, x1] = extent(drawn.map((one) => one.x));
    const [y0, y1] = extent(drawn.map((one) => one.y));
    place = {
      width, height, edge, x0, x1, y0, y1,
      x: (value) => edge.left + (value - x0) / (x1 - x0) * (width - edge.left - edge.right),
      y: (value) => height - edge.bottom - (value - y0) / (y1 - y0) * (height - edge.top - edge.bottom),
    };
  }

  function axes() {
    const { width, height, edge, x0, x1, y0, y1 } = place;
    let lines = "";
    const texts = [];
    ticks(x0, x1, width / 90).forEach(([value, text]) => {
      lines += `M${place.x(value).toFixed(1)} ${edge.top}V${height - edge.bottom}`;
      texts.push(svg("text", { x: place.x(value), y: height - edge.bottom + 16, "text-anchor": "middle" }, text));
    });
    ticks(y0, y1, height / 60).forEach(([value, text]) => {
      lines += `M${edge.left} ${place.y(value).toFixed(1)}H${width - edge.right}`;
      texts.push(svg("text", { x: edge.left - 6, y: place.y(value) + 4, "text-anchor": "end" }, text));
    });
    const middle = (height - edge.bottom + edge.top) / 2;
    texts.push(svg("text", { x: (width + edge.left) / 2, y: height - 8, "text-anchor": "middle", class: "name" }, title(spec.x)),
      svg("text", { x: 14, y: middle, "text-anchor": "middle", class: "name", transform: `rotate(-90 14 ${middle})` }, title(spec.y)));
    return [svg("path", { d: lines, class: "grid" }), ...texts];
  }

  function drawSeries(series) {
    if (series.kind === "mark") {
      const found = svg("g");
      series.x.forEach((value, at) => {
        if (typeof value !== "number" || typeof series.y[at] !== "number") return;
        found.append(painted(svg("path", { d: SHAPES[series.symbol], transform: `translate(${place.x(value).toFixed(1)} ${place.y(series.y[at]).toFixed(1)})` }), series));
      });
      return found;
    }
    const text = series.kind === "area" ? area(series) : path(series.x, series.y, series.kind === "line");
    return painted(svg("path", { d: text }), series);
  }

  function overlay() {
    const parts = [];
    if (state.kept && spec.points) {
      const some = spec.points.x.map((_, at) => at).filter((at) => !state.kept[at]);
      parts.push(painted(svg("path", { d: path(some.map((at) => spec.points.x[at]), some.map((at) => spec.points.y[at]), false), class: "away" }),
        { kind: "dots", colour: "--away", width: 6 }));
    }
    if (state.tangent) {
      const { x, y, slope } = state.tangent;
      const half = (place.x1 - place.x0) * 0.12;
      parts.push(painted(svg("path", { d: path([x - half, x + half], [y - slope * half, y + slope * half], true), class: "tangent" }),
        { kind: "line", colour: "--mark-ink", width: 2 }));
    }
    if (state.at !== null) {
      parts.push(svg("circle", { class: "ring", r: 9, cx: place.x(spec.points.x[state.at]).toFixed(1), cy: place.y(spec.points.y[state.at]).toFixed(1) }));
    }
    layer.replaceChildren(...parts);
  }

  function draw() {
    scales();
    picture.setAttribute("viewBox", `0 0 ${place.width} ${place.height}`);
    layer = svg("g");
    const inner = svg("svg", { x: 0, y: 0, width: place.width, height: place.height });
    inner.append(...spec.series.map(drawSeries), layer);
    picture.replaceChildren(...axes(), inner);
    overlay();
  }

  function nearest(event) {
    const box = picture.getBoundingClientRect();
    const [x, y] = [event.clientX - box.x, event.clientY - box.y];
    let best = null;
    let least = Infinity;
    spec.points.x.forEach((value, at) => {
      const away = (place.x(value) - x) ** 2 + (place.y(spec.points.y[at]) - y) ** 2;
      if (away < least && !(state.kept && !state.kept[at])) { least = away; best = at; }
    });
    return [best, Math.sqrt(least)];
  }

  let dragged = false;
  if (spec.pick) {
    picture.addEventListener("pointerdown", (event) => {
      dragged = true;
      picture.setPointerCapture(event.pointerId);
      const [at] = nearest(event);
      if (at !== null) spec.pick(at);
    });
    picture.addEventListener("pointerup", () => { dragged = false; });
    picture.addEventListener("pointerleave", () => { tip.hidden = true; });
    picture.addEventListener("pointermove", (event) => {
      const [at, away] = nearest(event);
      if (dragged && at !== null) spec.pick(at);
      tip.hidden = at === null || away > 30;
      if (!tip.hidden) {
        tip.textContent = spec.hint(at);
        tip.style.left = `${Math.min(place.x(spec.points.x[at]) + 12, place.width - 180)}px`;
        tip.style.top = `${Math.max(0, place.y(spec.points.y[at]) - 34)}px`;
      }
    });
  }
  draw();
  return {
    draw,
    select(at, tangent = null) { state.at = at; state.tangent = tangent; overlay(); },
    shade(kept) { state.kept = kept; overlay(); },
    where(at) { return [place.x(spec.points.x[at]), place.y(spec.points.y[at])]; },
    get ring() { return state.at; },
  };
}

function legend(series) {
  const list = element("ul", "", { class: "legend" });
  series.filter((one) => one.name).forEach((one) => {
    const line = element("li");
    line.append(swatch(one), element("span", one.name));
    list.append(line);
  });
  return list;
}
