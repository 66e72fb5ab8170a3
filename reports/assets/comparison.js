"use strict";
// Several fronts in the planes of their objectives.

(function comparison() {
  const found = data();
  const place = document.getElementById("plots");
  if (typeof Plotly === "undefined") return;
  const size = found.objectives.length;
  const pairs = [];
  for (let a = 0; a < size; a += 1) for (let b = a + 1; b < size; b += 1) pairs.push([a, b]);
  const planes = pairs.map((pair) => ({ pair, div: element("div", "", { class: "plot" }) }));
  planes.forEach(({ div }) => place.append(div));

  function trace(run, at, a, b) {
    const colour = tone(["--front", ...HUES][at % (HUES.length + 1)]);
    return {
      type: "scatter", mode: size === 2 ? "lines+markers" : "markers", name: entry(`${run.label}, ${run.aims[a].length} points`),
      x: run.aims[a], y: run.aims[b], line: { width: 1, dash: DASHES[at % DASHES.length], color: colour },
      marker: { size: 6, symbol: ["circle", ...SYMBOLS][at % (SYMBOLS.length + 1)] + (at % 2 ? "-open" : ""), color: colour },
    };
  }

  drawn(() => planes.forEach(({ pair: [a, b], div }) => Plotly.react(
    div, found.runs.map((run, at) => trace(run, at, a, b)),
    layout(title(found.objectives[a]), title(found.objectives[b]), found.runs.map((run) => entry(run.label))), CONFIG)));
})();
