"use strict";
// Parallel coordinates of objectives and variables; a drag along an axis brushes a range of it.

const LINES = 240; // drawn at most

function parallelChart(host, found, brushed) {
  const axes = [
    ...found.objectives.map((axis, at) => ({ ...axis, column: found.aims[at] })),
    ...found.variables.map((axis, at) => ({ ...axis, column: found.values[at] })).filter((axis) => axis.column.every((one) => typeof one === "number")),
  ].map((axis) => ({ ...axis, low: Math.min(...axis.column), high: Math.max(...axis.column) })).filter((axis) => axis.high > axis.low);
  const picture = svg("svg", { role: "img", "aria-label": "Objectives and variables of all points, an axis each", class: "chart parallel" });
  const state = { kept: null, at: 0, ranges: {}, from: null };
  const edge = { left: 30, right: 30, top: 14, bottom: 120 };
  let size = { width: 0, height: 0 };
  host.classList.add("plot");
  host.append(picture);

  const x = (at) => edge.left + at * (size.width - edge.left - edge.right) / Math.max(1, axes.length - 1);
  const y = (axis, value) => size.height - edge.bottom - (value - axis.low) / (axis.high - axis.low) * (size.height - edge.top - edge.bottom);
  const back = (axis, place) => axis.low + (size.height - edge.bottom - place) / (size.height - edge.top - edge.bottom) * (axis.high - axis.low);

  function lines(rows) {
    return rows.map((row) => axes.map((axis, at) => `${at ? "L" : "M"}${x(at).toFixed(1)} ${y(axis, axis.column[row]).toFixed(1)}`).join("")).join("");
  }

  function draw() {
    size = { width: Math.max(300, host.getBoundingClientRect().width), height: Math.max(260, host.clientHeight || 420) };
    picture.setAttribute("viewBox", `0 0 ${size.width} ${size.height}`);
    const step = Math.max(1, Math.ceil(found.rows.length / LINES));
    const some = found.rows.map((_, at) => at).filter((at) => at % step === 0);
    const kept = some.filter((at) => !state.kept || state.kept[at]);
    const away = some.filter((at) => state.kept && !state.kept[at]);
    const path = (rows, colour, width, more = "") => svg("path", { d: lines(rows), style: `stroke:var(${colour});stroke-width:${width};fill:none;${more}` });
    picture.replaceChildren(path(away, "--away", 0.6), path(kept, "--front", 0.8, "opacity:.55"), path([state.at], "--ink", 2.5),
      ...axes.flatMap((axis, at) => {
        const range = state.ranges[axis.name];
        const parts = [svg("path", { d: `M${x(at)} ${edge.top}V${size.height - edge.bottom}`, class: "axis" }),
          svg("text", { transform: `translate(${x(at) + 4} ${size.height - edge.bottom + 16}) rotate(52)` }, title(axis)),
          svg("text", { x: x(at), y: edge.top - 3, "text-anchor": "middle", class: "small" }, number(axis.high, 3)),
          svg("text", { x: x(at), y: size.height - edge.bottom + 10, "text-anchor": "end", class: "small" }, number(axis.low, 3))];
        if (range) parts.push(svg("rect", { class: "brush", x: x(at) - 7, width: 14, y: y(axis, range[1]), height: Math.max(2, y(axis, range[0]) - y(axis, range[1])) }));
        return parts;
      }));
  }

  function here(event) {
    const box = picture.getBoundingClientRect();
    const place = event.clientX - box.x;
    const at = axes.reduce((best, _, one) => (Math.abs(x(one) - place) < Math.abs(x(best) - place) ? one : best), 0);
    return [at, Math.max(axes[at].low, Math.min(axes[at].high, back(axes[at], event.clientY - box.y)))];
  }

  picture.addEventListener("pointerdown", (event) => {
    state.from = here(event);
    picture.setPointerCapture(event.pointerId);
  });
  picture.addEventListener("pointerup", (event) => {
    if (!state.from) return;
    const [at, low] = state.from;
    const [, high] = [at, Math.max(axes[at].low, Math.min(axes[at].high, back(axes[at], event.clientY - picture.getBoundingClientRect().y)))];
    state.from = null;
    const range = Math.abs(y(axes[at], low) - y(axes[at], high)) < 4 ? null : [Math.min(low, high), Math.max(low, high)];
    brushed(axes[at].name, range); // a click takes the brush away
  });
  draw();
  return {
    draw, axes, place: (name, value) => { const at = axes.findIndex((axis) => axis.name === name); return [x(at), y(axes[at], value)]; },
    show(at, kept, ranges) { state.at = at; state.kept = kept; state.ranges = ranges; if (host.offsetParent) draw(); },
  };
}
