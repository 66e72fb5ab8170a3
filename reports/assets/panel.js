"use strict";
// The selected allocation: what matters, what to write on the drawing, beside a reference.

const SOURCES = {
  multiplier: ["proven", "by the multiplier of the proven optimum"],
  front: ["front", "by the slope of the front around this point"],
  estimate: ["estimate", "by the conditions of an optimum, which this point meets only roughly"],
};

function bar(share, kind) {
  const outer = element("span", "", { class: "bar", "aria-hidden": "true" });
  const inner = element("span", "", { class: share < 0 ? "other" : kind });
  inner.style.width = `${Math.min(100, Math.abs(share))}%`;
  outer.append(inner);
  return outer;
}

function headline(found, at) {
  const values = found.objectives.map((axis, place) => withUnit(`${axis.label} ${number(found.aims[place][at])}`, axis.unit));
  const named = found.choices.filter((one) => one.row === found.rows[at]).map((one) => one.name.replace(/_/g, " "));
  const label = named.length ? ` (${named.length > 2 ? `${named[0]} and ${named.length - 1} more rules` : named.join(", ")})` : "";
  return `Point ${found.rows[at]}${label}: ${values.join("; ")}`;
}

function distance(found, at) {
  const bound = found.bound[at];
  if (bound === null || bound === undefined) return "No bound of its cost is proven.";
  if (!found.informative) return "The proven bound of the cost is not informative here: it leaves out limits that hold the points back.";
  const gap = found.gap[at] < 0.001 ? "less than 0.001" : number(found.gap[at], 3);
  return `Proven: at equal other objectives nothing costs less than ${number(bound)}; this point lies ${gap} % above.`;
}

// "What does one arc minute cost here": a sentence for each requirement that has a price.
function slopes(found, needs) {
  return needs.filter((need) => need.price).map((need) => {
    const unit = need.unit || "unit";
    const part = need.value ? 10 ** Math.floor(Math.log10(Math.abs(need.value))) / 10 : 0.1;
    const how = SOURCES[need.source] || ["", ""];
    return `${number(part)} ${unit} less ${need.label} costs about ${withUnit(number(Math.abs(need.price) * part, 3), found.unit)} here `
      + `(${number(Math.abs(need.price), 3)} per ${unit}; ${how[1]}).`;
  });
}

// Which tolerance to loosen first: what saves most for what it takes of the first requirement.
function firsts(found, model, at, needs) {
  const all = found.tolerances.flatMap((tolerance) => {
    const own = model.value(at, tolerance.name);
    if (!tolerance.free || typeof own !== "number" || tolerance.kind === "nominal" || !tolerance.costs.length) return [];
    const [, next] = model.neighbours(tolerance, own);
    if (!next) return [];
    const effect = model.effect(tolerance, at, next[0], needs);
    return effect.cost < 0 ? [{ tolerance, next, effect, rate: effect.cost / Math.max(effect.each[0] || 0, 1e-12) }] : [];
  });
  if (!all.length || !needs.length) return element("p", "Nothing can be loosened to the next standard value within its range.", { id: "first" });
  const best = all.reduce((one, other) => (other.rate < one.rate ? other : one));
  const need = needs[0];
  return element("p", `Loosen first: ${best.tolerance.label}, to ${best.next[1] || withUnit(number(best.next[0]), best.tolerance.unit)}: saves `
    + `${withUnit(number(-best.effect.cost, 3), found.unit)} ${best.effect.each[0] > 0 ? "for" : "and changes"} ${signed(best.effect.each[0], 2)} ${need.unit} ${best.effect.each[0] > 0 ? "of" : ""} ${need.label}.`, { id: "first" });
}

function mattering(found, model, at) {
  const needs = model.requirements(at);
  const first = needs[0] || null;
  const cost = found.unit || "cost";
  const heads = [["tolerance", ""], ["value", ""],
    ["share", `share of all tolerances, fixed ones included, in ${first ? first.label : ""}: they add up to 100 %`],
    ["1 \u00b5m tighter", "price of 1 \u00b5m (or a tenth) tighter, all requirements kept by the others"],
    ["1 \u00b5m looser", "gain of 1 \u00b5m (or a tenth) looser, all requirements kept by the others"],
    ["next tighter", `next standard value: its effect on ${cost}, and on ${first ? first.label : "the requirement"}, all others kept`],
    ["next looser", `next standard value: its effect on ${cost}, and on ${first ? first.label : "the requirement"}, all others kept`]];
  const rows = found.tolerances.map((tolerance) => {
    const own = model.value(at, tolerance.name);
    const share = first && own !== null ? first.share(tolerance.name) : null;
    return { tolerance, own, share };
  }).filter((one) => one.own !== null);
  rows.sort((a, b) => Math.abs(b.share ?? -1) - Math.abs(a.share ?? -1));
  return tableOf(heads, rows.map(({ tolerance, own, share }) => {
    const name = element("span", tolerance.label, { title: `${tolerance.name}: ${tolerance.meaning}` });
    const cell = element("span");
    if (share !== null) cell.append(`${signed(share, 3).replace("+", "")} %`, bar(share, "own"));
    const plain = typeof own !== "number" || tolerance.kind === "nominal" || !tolerance.free;
    const value = element("span", withUnit(number(own), tolerance.unit));
    const held = model.bound(tolerance, own);
    if (held) value.append(" ", element("small", held));
    if (plain) return [name, value, cell, "", "", "", ""];
    const [by, said] = model.step(tolerance, own);
    const price = (t) => {
      if (tolerance.kind === "grade" || t < tolerance.low * (1 - 1e-9) || t > tolerance.high * (1 + 1e-9)) return null;
      return model.worth(tolerance, at, t, needs);
    };
    const priced = (amount, looser) => {
      if (amount === null) return "";
      const text = signed(looser ? -amount : amount, 2);
      return said === "10 %" ? `${text} (10 %)` : text;
    };
    const next = model.neighbours(tolerance, own).map((one) => {
      if (!one) return "";
      const effect = model.effect(tolerance, at, one[0], needs);
      const box = element("span", one[1] || number(one[0]), { title: `${cost} ${signed(effect.cost)}${first ? `, ${first.label} ${signed(effect.each[0])} ${first.unit}` : ""}` });
      box.append(element("small", ` ${signed(effect.cost, 2)}${first ? `; ${signed(effect.each[0], 2)} ${first.unit}` : ""}`));
      return box;
    });
    return [name, value, cell, priced(price(own - by), false), priced(price(own + by), true), ...next];
  }));
}

function explained(found, model, at) {
  const needs = model.requirements(at);
  const first = needs[0];
  const said = [];
  if (first) {
    const negative = found.tolerances.some((one) => (first.share(one.name) || 0) < 0);
    said.push(`Share: t\u00b7dy/dt of ${first.label}${first.explained === first.output ? "" : ` (by ${first.explained.replace(/_/g, " ")})`} over its sum for all tolerances.`
      + (negative ? " Negative: wider is better there, for what it adds to the mean lowers the requirement." : ""));
    const how = SOURCES[first.source];
    if (how) said.push(`Prices are first order in ${found.unit || "cost"}, ${how[1]}; a gain below zero is a loss.`);
  }
  return said.join(" ");
}

function ordered(found, model, at) { // what to write on the drawing
  const stored = found.rounded[found.rows[at]] || null;
  const own = stored ? null : model.rounded(at);
  const values = stored || own.values;
  const parts = [];
  if (stored) parts.push(element("p", "Rounded to what can be ordered; verified by the full model.", { class: "hint verified" }));
  else {
    const needs = own.needs.filter((need) => need.aim >= 0).map((need, place) => {
      const change = own.each[own.needs.indexOf(need)];
      return withUnit(`${need.label} ${number(need.value + change)}`, need.unit);
    });
    const base = found.objectives.findIndex((axis) => axis.name === "cost");
    if (base >= 0) needs.unshift(withUnit(`cost ${number(found.aims[base][at] + own.cost)}`, found.unit));
    parts.push(element("p", `Rounded by the linear model of this point, not verified: ${needs.join(", ")}. `
      + "Copy the designs below into designs.csv and run: tolevo evaluate config.toml designs.csv --out verified.csv", { class: "hint unverified" }));
  }
  const heads = [["tolerance", ""], ["on the drawing", ""], ["upper dev.", ""], ["lower dev.", ""], ["nominal", ""], ["unit", ""], ["process", ""], ["grade, class", ""]];
  const rows = found.tolerances.filter((one) => values[one.name] !== undefined && !one.labels.length).map((one) => {
    const t = values[one.name];
    const half = one.kind === "half_width";
    const middle = one.mid || 0;
    const name = (one.grades.find(([, width]) => Math.abs(width - t) <= 1e-9 * t) || [""])[0];
    const made = values[one.process] ?? model.value(at, one.process);
    const tidy = (value) => signed(Number(value.toPrecision(10)), 6);
    return [element("span", one.label, { title: one.name }), model.notation(one, t), half ? tidy(middle + t) : one.kind === "full_clearance" ? tidy(t) : "",
      half ? tidy(middle - t) : one.kind === "full_clearance" ? "0" : "", one.nominal ?? "" , one.unit, made ?? "", one.class || name]
      .map((cell) => (typeof cell === "number" ? number(cell, 8) : cell));
  });
  parts.push(tableOf(heads, rows));
  return parts;
}

function beside(found, model, at, reference) {
  if (!reference) return element("p", "This run has no reference to compare with.");
  const rows = found.variables.map((variable, place) => {
    const [own, other] = [found.values[place][at], reference.values[place]];
    const bars = element("span", "", { class: "bars" });
    if (typeof own === "number" && typeof other === "number") {
      const most = Math.max(Math.abs(own), Math.abs(other)) || 1;
      bars.append(bar(100 * Math.abs(own) / most, "own"), bar(100 * Math.abs(other) / most, "ref"));
    }
    const ratio = typeof own === "number" && typeof other === "number" && other ? `${number(own / other, 3)} \u00d7` : "";
    return [element("span", variable.label, { title: variable.meaning }), withUnit(number(own), variable.unit), withUnit(number(other), variable.unit), ratio, bars];
  });
  found.objectives.forEach((axis, place) => rows.unshift([axis.label, withUnit(number(found.aims[place][at]), axis.unit), withUnit(number(reference.aims[place]), axis.unit),
    reference.aims[place] ? `${signed(100 * (found.aims[place][at] / reference.aims[place] - 1))} %` : "", ""]));
  return tableOf([["quantity", ""], ["this point", ""], [reference.label + (reference.feasible ? "" : " (breaks limits)"), ""], ["ratio", ""], ["side by side", ""]], rows);
}

function cell(value) {
  const text = value === null || value === undefined ? "" : String(value);
  return /[",\n\r]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
}

function asCSV(found, model, at) {
  const values = found.rounded[found.rows[at]] || model.rounded(at).values;
  const lines = [["name", "unit", "value", "rounded"]];
  found.variables.forEach((one, place) => lines.push([one.name, one.unit, found.values[place][at], values[one.name]]));
  found.objectives.forEach((one, place) => lines.push([one.name, one.unit, found.aims[place][at], ""]));
  return lines.map((line) => line.map(cell).join(",")).join("\n") + "\n";
}

function asDesigns(found, model, at) {
  const values = found.rounded[found.rows[at]] || model.rounded(at).values;
  const names = found.variables.map((one) => one.name);
  return [names, names.map((name, place) => values[name] ?? found.values[place][at])].map((line) => line.map(cell).join(",")).join("\n") + "\n";
}
