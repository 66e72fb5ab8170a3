"use strict";
// What the page computes itself: costs by the cost curves, requirements by the linear model of the
// problem at a point, prices by both, and a rounded allocation. Tested against `tolevo evaluate`.

const EDGE = 1e-6; // of a range

function costAt(curve, t) {
  const of = {
    reciprocal: () => curve.a + curve.b / t,
    reciprocal_squared: () => curve.a + curve.b / t ** 2,
    reciprocal_power: () => curve.a + curve.b / t ** curve.k,
    exponential: () => curve.a + curve.b * Math.exp(-curve.m * t),
    combined: () => curve.a + curve.b / t ** curve.k + curve.c * Math.exp(-curve.m * t),
    table: () => {
      const at = curve.t.findIndex((one) => one >= t);
      if (at < 0 || (at === 0 && curve.t[0] > t)) return NaN; // nobody quoted that tolerance
      if (at === 0) return curve.cost_at[0];
      const share = (t - curve.t[at - 1]) / (curve.t[at] - curve.t[at - 1]);
      return curve.cost_at[at - 1] + share * (curve.cost_at[at] - curve.cost_at[at - 1]);
    },
  }[curve.model];
  return of ? curve.count * of() : NaN;
}

function modelOf(found) {
  const byName = Object.fromEntries(found.tolerances.map((one, at) => [one.name, at]));
  const place = Object.fromEntries(found.variables.map((one, at) => [one.name, at]));

  function nearestRow(rows, row) {
    let best = 0;
    rows.forEach((one, at) => { if (Math.abs(one - row) < Math.abs(rows[best] - row)) best = at; });
    return best;
  }

  function value(at, name) {
    return name in place ? found.values[place[name]][at] : null;
  }

  function chosen(tolerance, at) { // which of alternative processes makes it
    if (tolerance.costs.length < 2) return 0;
    const label = value(at, tolerance.process);
    const other = found.tolerances[byName[tolerance.process]];
    return Math.max(0, other ? other.labels.indexOf(label) : 0);
  }

  function cost(tolerance, at, t) {
    const curve = tolerance.costs[chosen(tolerance, at)];
    return curve ? costAt(curve, t) : 0;
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
        output: own.output, label: own.label, unit: own.unit, explained: own.explained, limit,
        aim, value: aim >= 0 ? found.aims[aim][at] : limit ? limit.values[at] : null, along: own.along[row],
        share: (name) => { const column = own.names.indexOf(name); return column < 0 ? null : own.shares[column][row]; },
        price: priced ? priced.price[rank] : null, source: priced ? priced.source[rank] : "",
      };
    });
  }

  // Change of a requirement where tolerances change: `moves` are [share in percent, old, new, grade?].
  function change(along, moves) {
    const sum = moves.reduce((total, [share, old, now, grade]) => {
      const ratio = grade ? Math.SQRT2 ** (now - old) : now / old;
      return total + share / 100 * (ratio ** 2 - 1);
    }, 0);
    return along * (Math.sqrt(Math.max(0, 1 + sum)) - 1);
  }

  function effect(tolerance, at, t, needs) { // of one change, all others kept
    const own = value(at, tolerance.name);
    const grade = tolerance.kind === "grade";
    const each = needs.map((need) => change(need.along, [[need.share(tolerance.name) || 0, own, t, grade]]));
    return { cost: cost(tolerance, at, t) - cost(tolerance, at, own), each };
  }

  // What a change costs where all requirements are kept by the others.
  function worth(tolerance, at, t, needs) {
    if (!tolerance.costs.length) return null;
    const found_ = effect(tolerance, at, t, needs);
    const rest = needs.reduce((sum, need, place_) => {
      if (!found_.each[place_]) return sum;
      return need.price === null ? NaN : sum + need.price * found_.each[place_];
    }, 0);
    const all = found_.cost + rest;
    return Number.isFinite(all) ? all : null;
  }

  function step(tolerance, own) { // 1 um, or a tenth where that is none or too much
    const um = tolerance.um;
    return um && um < 0.5 * own ? [um, "1 \u00b5m"] : [0.1 * own, "10 %"];
  }

  function bound(tolerance, own) {
    const edge = EDGE * (tolerance.high - tolerance.low);
    if (!tolerance.free) return "fixed";
    if (own <= tolerance.low + edge) return "tightest allowed";
    return own >= tolerance.high - edge ? "loosest allowed" : "";
  }

  function neighbours(tolerance, own) {
    if (tolerance.kind === "grade") {
      return [own - 1, own + 1].map((t) => (t >= tolerance.low && t <= tolerance.high ? [t, `grade ${t}`] : null));
    }
    const list = tolerance.grades.length ? tolerance.grades.map(([name, t]) => [t, name]) : tolerance.orderable;
    const fits = list.filter(([t]) => t >= tolerance.low * (1 - 1e-9) && t <= tolerance.high * (1 + 1e-9));
    const below = fits.filter(([t]) => t < own * (1 - 1e-9));
    const above = fits.filter(([t]) => t > own * (1 + 1e-9));
    return [below.length ? below[below.length - 1] : null, above.length ? above[0] : null];
  }

  // Rounded by the linear model: all tighter first, then looser where that saves most for what it uses.
  function rounded(at) {
    const needs = requirements(at);
    const result = {};
    const open = [];
    const room = needs.map((need) => {
      if (need.aim >= 0 || !need.limit || !need.along) return 0;
      const most = need.limit.high ?? null;
      if (most === null) return 0;
      return Math.max(0, (1 + (most - need.value) / need.along) ** 2 - 1);
    });
    const used = needs.map(() => 0);
    found.tolerances.forEach((tolerance) => {
      const own = value(at, tolerance.name);
      if (own === null) return;
      result[tolerance.name] = own;
      if (!tolerance.free || !tolerance.orderable.length) return;
      const fits = tolerance.orderable.map(([t]) => t);
      const below = fits.filter((t) => t <= own * (1 + 1e-9)).pop() ?? fits[0];
      const above = fits.find((t) => t >= own * (1 - 1e-9)) ?? fits[fits.length - 1];
      const nominal = tolerance.kind === "nominal";
      const [low, high] = nominal && above - own < own - below ? [above, above] : [below, nominal ? below : above];
      const use = (t) => needs.map((need) => (need.share(tolerance.name) || 0) / 100 * ((t / own) ** 2 - 1));
      result[tolerance.name] = low;
      if (!nominal) use(low).forEach((one, place_) => { used[place_] += one; });
      if (high > low) {
        const [from, to] = [use(low), use(high)];
        open.push({ name: tolerance.name, high, saved: cost(tolerance, at, low) - cost(tolerance, at, high), use: to.map((one, place_) => one - from[place_]) });
      }
    });
    open.sort((a, b) => b.saved / (Math.max(...b.use, 0) + 1e-12) - a.saved / (Math.max(...a.use, 0) + 1e-12));
    open.forEach((one) => {
      if (one.use.some((more, place_) => used[place_] + more > room[place_] + 1e-12 && more > 0)) return;
      one.use.forEach((more, place_) => { used[place_] += more; });
      result[one.name] = one.high;
    });
    return { values: result, ...judged(at, result, needs) };
  }

  function judged(at, values, needs) { // cost and requirements of other values, by the linear model
    let total = 0;
    const moves = needs.map(() => []);
    found.tolerances.forEach((tolerance) => {
      const [own, now] = [value(at, tolerance.name), values[tolerance.name]];
      if (typeof own !== "number" || own === now || tolerance.kind === "nominal") return;
      total += cost(tolerance, at, now) - cost(tolerance, at, own);
      needs.forEach((need, place_) => moves[place_].push([need.share(tolerance.name) || 0, own, now, tolerance.kind === "grade"]));
    });
    return { cost: total, each: needs.map((need, place_) => change(need.along, moves[place_])), needs };
  }

  function notation(tolerance, t) {
    if (t === null || t === undefined) return "";
    if (typeof t !== "number") return String(t);
    const plain = (one) => String(Number(one.toPrecision(10))).replace("-", "\u2212");
    if (tolerance.kind === "grade") return `grade ${plain(t)}`;
    if (tolerance.kind === "full_clearance") return withUnit(`0 to ${plain(t)}`, tolerance.unit);
    if (tolerance.kind === "standard_deviation") return withUnit(`\u03c3 \u2264 ${plain(t)}`, tolerance.unit);
    if (tolerance.kind !== "half_width") return withUnit(plain(t), tolerance.unit);
    const size = typeof tolerance.nominal === "number" ? `${plain(tolerance.nominal)} ` : "";
    const [low, high] = [(tolerance.mid || 0) - t, (tolerance.mid || 0) + t];
    const sign = (one) => (one > 0 ? `+${plain(one)}` : plain(one));
    const zone = Math.abs(low + high) < 1e-12 ? `\u00b1${plain(t)}` : `${sign(Number(high.toPrecision(10)))}/${sign(Number(low.toPrecision(10)))}`;
    const name = (tolerance.grades.find(([, half]) => Math.abs(half - t) <= 1e-9 * t) || [""])[0];
    return `${withUnit(`${size}${zone}`, tolerance.unit)}${name ? ` (${name})` : ""}`;
  }

  return { requirements, value, effect, worth, step, bound, neighbours, rounded, judged, notation, cost };
}
