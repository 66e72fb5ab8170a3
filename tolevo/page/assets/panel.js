"use strict";
// The selected allocation: what matters, what to write on the drawing, beside a reference.

const SOURCES = {
  multiplier: ["proven", "by the multiplier of the proven optimum"],
  front: ["front", "by the slope of the front around this point"],
  estimate: ["estimate", "by the conditions of an optimum"],
};

const ROUGH = 30; // percent: the residual of the conditions of an optimum beyond which no price is stated

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
  const label = named.length > 2 ? `${named[0]} and ${named.length - 1} more rules` : named.join(", ");
  const which = found.whole === 1 ? "The allocation" : `Allocation ${found.rows[at] + 1} of ${found.whole}${label ? ` (${label})` : ""}`;
  return `${which}: ${values.join("; ")}`;
}

function distance(found, at) {
  const bound = found.bound[at];
  if (bound === null || bound === undefined) return "No bound of its cost is proven.";
  if (!found.informative) return "The proven bound of the cost is not informative here: it leaves out limits that hold the points back.";
  const gap = found.gap[at] < 0.001 ? "less than 0.001" : number(found.gap[at], 3);
  return `Proven: at equal other objectives nothing costs less than ${withUnit(number(bound), found.unit)}; this point lies ${gap} % above.`;
}

// "What does one arc minute cost here": a sentence for each requirement that has a price.
function slopes(found, needs) {
  const known = (need) => need.price && (need.source === "multiplier" || !(need.spread > ROUGH));
  return needs.filter(known).map((need) => {
    const more = need.tighter === "more";
    const room = more && (need.unit === "percent" || need.unit === "%") ? 100 - need.value : need.value;
    const part = room ? 10 ** Math.floor(Math.log10(Math.abs(room))) / 100 : 0.01; // a price holds for small changes
    const how = SOURCES[need.source] || ["", ""];
    const met = need.source !== "multiplier" && need.spread ? `, conditions of an optimum met to within ${number(need.spread, 2)} %` : "";
    const rate = need.unit ? `${number(Math.abs(need.price), 3)} per ${need.unit}; ` : "";
    return `${withUnit(number(part), need.unit)} ${need.tighter} ${need.label} costs about ${withUnit(number(Math.abs(need.price) * part, 3), found.unit)} here `
      + `(${rate}${how[1]}${met}).`;
  });
}

// What to loosen first, as the model has tried it at the chosen allocations.
function firsts(found, at) {
  const own = found.choices.find((one) => one.row === found.rows[at] && one.advice);
  return element("p", own ? own.advice : "What to loosen first was tried by the model at the chosen allocations alone: select one of them.", { id: "first" });
}

function stepOf(found, step) {
  const box = element("span", step.to);
  const cost = withUnit(step.cost ? signed(step.cost, 3) : "0", found.unit);
  const each = found.changed.map((need, place) => (step.each[place] ? `${need.label} ${withUnit(signed(step.each[place], 3), need.unit)}` : "")).filter(Boolean);
  box.append(element("small", ` ${cost}; ${step.broken ? `breaks ${step.broken}` : each.join("; ")}`.replace(/; $/, "")));
  return box;
}

function mattering(found, model, at) {
  const needs = model.requirements(at);
  const first = needs[0] || null;
  const hint = "next value that can be ordered, all others kept: its effect on the cost, and on the requirements or the limit that it breaks, by the full model";
  const heads = [["tolerance", ""], ["value", ""],
    ["share", `share of all tolerances, fixed ones included, in ${first ? first.label : ""}: they add up to 100 %`],
    ["next tighter", hint], ["next looser", hint]];
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
    const value = element("span", withUnit(number(own), tolerance.unit));
    if (typeof own !== "number" || tolerance.kind === "nominal") return [name, value, cell, "", ""];
    const held = model.bound(tolerance, own);
    if (held) value.append(" ", element("small", held));
    const steps = model.steps(tolerance, at) || [];
    const listed = (some) => {
      const box = element("span");
      some.forEach((step, place) => box.append(...(place ? [element("br")] : []), stepOf(found, step)));
      return box;
    };
    return [name, value, cell, listed(steps.filter((one) => one.cost > 0)), listed(steps.filter((one) => one.cost <= 0))];
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
  }
  if (found.changes.some((one) => one.row === found.rows[at])) said.push("Steps: + is a higher cost, \u2212 a saving; each was evaluated by the full model with all other tolerances kept.");
  return said.join(" ");
}

function ordered(found, at) { // what to write on the drawing
  const order = found.orders[found.rows[at]];
  if (!order) return [element("p", "This allocation is not rounded: select one of the chosen allocations, whose rounded values the full model has verified.", { class: "hint" })];
  return [element("p", `Rounded to what can be ordered; verified by the full model${order.verdict}.`, { class: "hint verified" }),
    tableOf(order.heads.map((text) => [text, ""]), order.rows)];
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
  const values = found.rounded[found.rows[at]] || {};
  const lines = [["name", "unit", "value", "rounded"]];
  found.variables.forEach((one, place) => lines.push([one.name, one.unit, found.values[place][at], values[one.name]]));
  found.objectives.forEach((one, place) => lines.push([one.name, one.unit, found.aims[place][at], ""]));
  return lines.map((line) => line.map(cell).join(",")).join("\n") + "\n";
}

function asDesigns(found, model, at) {
  const values = found.rounded[found.rows[at]] || {};
  const names = found.variables.map((one) => one.name);
  return [names, names.map((name, place) => values[name] ?? found.values[place][at])].map((line) => line.map(cell).join(",")).join("\n") + "\n";
}
