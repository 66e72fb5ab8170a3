"use strict";
// Units at the selected point against the limits of the requirement: its law as the model states it.

const BINS = 41;

function histogram(found, at) {
  const law = found.law;
  if (!law) return null;
  const [mean, deviation] = [law.mean[at], law.deviation[at]];
  if (!(deviation > 0)) return null;
  const [low, high] = [law.low ?? -Infinity, law.high ?? Infinity];
  const ends = [mean - 4.5 * deviation, mean + 4.5 * deviation];
  const from = Math.min(ends[0], Number.isFinite(low) ? low - deviation : ends[0]);
  const to = Math.max(ends[1], Number.isFinite(high) ? high + deviation : ends[1]);
  const below = (x) => 0.5 * (1 + erf((x - mean) / deviation / Math.SQRT2));
  const x = [];
  const y = [];
  for (let bin = 0; bin < BINS; bin += 1) {
    const [a, b] = [from + (to - from) * bin / BINS, from + (to - from) * (bin + 1) / BINS];
    const share = 100 * (below(b) - below(a));
    x.push(a, a, b, b);
    y.push(0, share, share, 0);
  }
  const top = Math.max(...y);
  const box = element("div", "", { class: "histogram" });
  const host = element("div");
  const series = [{ kind: "area", name: "", x, y, x2: [from, to], y2: [0, 0] }, { kind: "line", x, y, width: 1 }];
  [[low, "--a"], [high, "--a"]].filter(([one]) => Number.isFinite(one)).forEach(([one, colour]) =>
    series.push({ kind: "line", x: [one, one], y: [0, top], colour, width: 2, dash: "6 3" }));
  const cpk = Math.min(high - mean, mean - low) / (3 * deviation);
  const yields = law.yield ? law.yield[at] : null;
  const parts = [`mean ${number(mean)} ${law.unit}`, `standard deviation ${number(deviation, 3)} ${law.unit}`];
  if (Number.isFinite(cpk)) parts.push(`Cpk ${number(cpk, 3)}`);
  if (typeof yields === "number") parts.push(`yield ${number(yields, 6)} %`, `${number((100 - yields) * 1e4, 3)} ppm outside`);
  box.append(host, element("p", `${law.label}: ${parts.join(", ")}. Bars: a normal law of that mean and standard deviation; the yield is the model's own.`, { class: "hint" }));
  requestAnimationFrame(() => chart(host, { x: { label: law.label, unit: law.unit }, y: { label: "units", unit: "%" }, series }));
  return box;
}
