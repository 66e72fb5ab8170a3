"use strict";
// What the page knows of a point: the requirements with their shares and prices, and the ends of ranges.

const EDGE = 1e-6; // of a range

function modelOf(found) {
  const place = Object.fromEntries(found.variables.map((one, at) => [one.name, at]));

  function nearestRow(rows, row) {
    let best = 0;
    rows.forEach((one, at) => { if (Math.abs(one - row) < Math.abs(rows[best] - row)) best = at; });
    return best;
  }

  function value(at, name) {
    return name in place ? found.values[place[name]][at] : null;
  }

  // Share of each tolerance, sum of t dy/dt, and price of every requirement at a point.
  function requirements(at) {
    return found.contributions.map((own) => {
      const row = nearestRow(own.rows, found.rows[at]);
      const priced = found.prices.find((one) => one.output === own.output);
      const rank = priced ? nearestRow(priced.rows, found.rows[at]) : 0;
      const aim = found.objectives.findIndex((axis) => axis.name === own.output);
      const limit = found.limits.find((one) => one.name === own.output) || null;
      return {
        output: own.output, label: own.label, unit: priced ? priced.unit : own.unit, tighter: priced ? priced.tighter[rank] : "less", explained: own.explained, limit,
        aim, value: aim >= 0 ? found.aims[aim][at] : limit ? limit.values[at] : null, along: own.along[row],
        share: (name) => { const column = own.names.indexOf(name); return column < 0 ? null : own.shares[column][row]; },
        price: priced ? priced.price[rank] : null, source: priced ? priced.source[rank] : "", spread: priced && priced.spread ? priced.spread[rank] : 0,
      };
    });
  }

  function bound(tolerance, own) {
    const edge = EDGE * (tolerance.high - tolerance.low);
    if (!tolerance.free) return "fixed";
    if (own <= tolerance.low + edge) return "tightest allowed";
    return own >= tolerance.high - edge ? "loosest allowed" : "";
  }

  // The steps of one tolerance, or of its process, that the model has tried at a point; null where none were.
  function steps(tolerance, at) {
    const tried = found.changes.filter((one) => one.row === found.rows[at]);
    return tried.length ? tried.filter((one) => one.variable === tolerance.name || one.variable === tolerance.process) : null;
  }

  return { requirements, value, bound, steps };
}
