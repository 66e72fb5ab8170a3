"use strict";
// Several fronts in the planes of their objectives.

(function comparison() {
  const found = data();
  const place = document.getElementById("plots");
  const charts = [];
  const size = found.objectives.length;
  for (let a = 0; a < size; a += 1) {
    for (let b = a + 1; b < size; b += 1) {
      const series = found.runs.map((run, at) => ({
        kind: size === 2 ? "line" : "dots", name: `${run.label}, ${run.aims[a].length} points`, x: run.aims[a], y: run.aims[b],
        colour: ["--front", ...HUES][at % (HUES.length + 1)], dash: at && size === 2 ? DASHES[(at - 1) % DASHES.length] : "",
        width: size === 2 ? 2 : 5,
      }));
      const host = element("div");
      place.append(host, legend(series));
      charts.push(chart(host, { x: found.objectives[a], y: found.objectives[b], series }));
    }
  }
  window.addEventListener("resize", () => charts.forEach((one) => one.draw()));
})();
