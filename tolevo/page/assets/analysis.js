"use strict";
// The analysis of a stack: histograms of the sampled units, and what-if on the model of second order.

(function analysis() {
  const found = data();

  function histograms() {
    const host = document.getElementById("histograms");
    if (!host) return;
    found.requirements.filter((one) => found.bars[one.requirement]).forEach((one) => {
      const { edges, percent } = found.bars[one.requirement];
      const [x, y] = [[], []];
      percent.forEach((share, bin) => { x.push(edges[bin], edges[bin], edges[bin + 1], edges[bin + 1]); y.push(0, share, share, 0); });
      const top = Math.max(...percent);
      const series = [{ kind: "line", x, y, width: 1.5, name: "units" }];
      [one.lower, one.upper].filter((limit) => limit !== null).forEach((limit) =>
        series.push({ kind: "line", x: [limit, limit], y: [0, top], colour: "--a", width: 2, dash: "6 3", name: "limit" }));
      const box = element("div", "", { class: "histogram" });
      const plot = element("div");
      box.append(plot, element("p", `${one.requirement}: units (line) between the limits (dashed)`, { class: "hint" }));
      host.append(box);
      requestAnimationFrame(() => chart(plot, { x: { label: one.requirement, unit: one.unit }, y: { label: "units", unit: "%" }, series }));
    });
  }

  // A requirement with the parts as typed: ends, mean, deviation, Cpk, per cent outside.
  function state(one, parts) {
    const pieces = one.owner.map((owner, at) => ({ slope: one.slope[at], ...parts[owner] }));
    let [mean, variance, worst, curved] = [one.centre, 0, 0, 0];
    pieces.forEach((piece) => {
      mean += piece.slope * (piece.nominal + piece.middle);
      variance += (piece.slope * piece.sigma) ** 2;
      worst += Math.abs(piece.slope) * piece.t;
    });
    let still = one.centre + pieces.reduce((sum, piece) => sum + piece.slope * piece.nominal - piece.slope * piece.offset, 0);
    one.curvature.forEach((row, i) => row.forEach((bend, j) => {
      const [a, b] = [pieces[i], pieces[j]];
      mean += 0.5 * bend * (a.nominal + a.middle) * (b.nominal + b.middle) + (i === j ? 0.5 * bend * a.sigma ** 2 : 0);
      still += 0.5 * bend * a.nominal * b.nominal;
      variance += 0.5 * (bend * a.sigma * b.sigma) ** 2;
      curved += 0.5 * Math.abs(bend) * a.t * b.t;
    }));
    const deviation = Math.sqrt(variance);
    const [low, high] = [one.lower ?? -Infinity, one.upper ?? Infinity];
    const below = (limit) => 0.5 * (1 + erf((limit - mean) / deviation / Math.SQRT2));
    const outside = deviation > 0 ? 100 * ((Number.isFinite(low) ? below(low) : 0) + (Number.isFinite(high) ? 1 - below(high) : 0)) : (mean < low || mean > high ? 100 : 0);
    const cpk = Math.min(high - mean, mean - low) / (3 * deviation);
    return { mean, deviation, least: still - worst - curved, greatest: still + worst + curved, cpk, outside, limited: Number.isFinite(low) || Number.isFinite(high) };
  }

  function whatIf() {
    const host = document.getElementById("whatif");
    if (!host || !found.quick.parts) return;
    found.quick.parts.forEach((part) => { part.grades = part.grades || []; }); // pages of an earlier version have none
    const asked = found.quick.parts.map((part) => ({ t: part.t, shift: part.mean * part.t, nominal: 0, cp: part.std > 0 ? 1 / (3 * part.std) : Infinity }));
    const begun = asked.map((one) => ({ ...one }));
    const table = element("div", "", { class: "scroll", tabindex: "0", role: "group", "aria-label": "requirements as typed", "aria-live": "polite" });
    const fields = element("div", "", { class: "fields" });
    const inputs = [];
    const told = element("p", "", { class: "hint" });

    const partsOf = (of) => of.map((one, at) => ({ t: one.t, nominal: one.nominal, middle: one.shift, offset: found.quick.parts[at].offset, sigma: one.t / (3 * one.cp) }));

    function show() {
      const [now, before] = [partsOf(asked), partsOf(begun)];
      const rows = found.quick.requirements.map((one) => {
        const [own, old] = [state(one, now), state(one, before)];
        const more = own.outside - old.outside;
        return [one.name, one.unit, number(own.mean, 5), `${number(own.least, 5)} to ${number(own.greatest, 5)}`,
          `${number(own.mean - 3 * own.deviation, 5)} to ${number(own.mean + 3 * own.deviation, 5)}`,
          own.limited ? number(own.cpk, 3) : "", own.limited ? number(own.outside, 3) : "", own.limited ? signed(more, 3) || "0" : ""];
      });
      table.replaceChildren(tableOf([["requirement"], ["unit"], ["mean"], ["worst case"], ["mean ± 3 standard deviations"], ["Cpk"], ["outside [%]"], ["change [percentage points]"]], rows, "as typed"));
    }

    // Takes what was typed by an input: a number (a decimal comma is one) that is `allowed`, else it is told.
    function typed(input, text, rule, allowed, take) {
      input.addEventListener("input", () => {
        const value = Number(input.value.trim().replace("\u2212", "-").replace(",", "."));
        const valid = input.value.trim() !== "" && Number.isFinite(value) && allowed(value);
        input.setAttribute("aria-invalid", String(!valid));
        told.textContent = valid ? "" : `${text} must be a number${rule}`;
        if (valid) take(value);
      });
      return input;
    }

    function refill() {
      inputs.forEach(([input, at, key]) => { input.value = number(asked[at][key], 6); input.setAttribute("aria-invalid", "false"); });
      show();
    }

    // The best allocation that was solved at no more than a budget goes into the fields.
    function spend(most) {
      const best = found.budgets.filter((one) => one.cost <= most * (1 + 5e-4)).pop(); // a cost as it is shown, of four digits, is one
      const cheapest = found.budgets[0];
      if (!best) {
        told.textContent = `No allocation costs so little: the cheapest that was solved costs ${number(cheapest.cost, 5)}, with a least ratio of room to variation of ${number(cheapest.room_over_variation, 3)}.`;
        return;
      }
      found.quick.parts.forEach((part, at) => { if (`${part.name}_t` in best) asked[at].t = best[`${part.name}_t`]; if (part.mean) asked[at].shift = part.mean * asked[at].t; });
      refill();
      const ways = Object.entries(best).filter(([key]) => key.endsWith("_process")).map(([key, way]) => `${key.slice(0, -8)} ${way}`);
      told.textContent = `${number(best.cost, 5)} reaches a least ratio of room to variation of ${number(best.room_over_variation, 3)} (${best.weakest}): its half-widths are in the fields${ways.length ? `, its processes are ${ways.join(", ")}` : ""}. Tolerances for the drawing are rounded by tolevo run.`;
    }

    function cap(finest) {
      let wider = 0;
      found.quick.parts.forEach((part, at) => {
        const grade = part.grades.find(([name]) => name === `IT${finest}`);
        if (grade && grade[1] > asked[at].t) { asked[at].t = grade[1]; wider += 1; }
      });
      refill();
      told.textContent = `No grade finer than IT${finest}: ${wider} half-width${wider === 1 ? " was" : "s were"} widened.`;
    }

    const questions = element("div", "", { class: "fields" });
    const asks = element("div");
    if (found.budgets.length) asks.append(labelled("budget ", typed(element("input", "", { inputmode: "decimal", size: "8", "aria-label": "budget" }), "budget", "", () => true, spend)));
    if (found.quick.parts.some((part) => part.grades.length)) {
      const grade = element("input", "", { inputmode: "numeric", size: "4", "aria-label": "no grade finer than IT" });
      asks.append(labelled("no grade finer than IT ", typed(grade, "the grade", " from 1 to 18", (value) => Number.isInteger(value) && value >= 1 && value <= 18, cap)));
    }
    if (asks.childNodes.length) questions.append(asks);

    const keys = [["half-width", "t"], ["mean shift", "shift"], ["change of the nominal", "nominal"], ["Cp", "cp"]];
    found.quick.parts.forEach((part, at) => {
      const row = element("div");
      row.append(element("span", part.unit ? `${part.name} [${part.unit}]` : part.name));
      keys.forEach(([text, key]) => {
        const input = element("input", "", { inputmode: "decimal", size: "8", "aria-label": `${text} of ${part.name}` });
        input.value = number(asked[at][key], 6);
        const rule = key === "cp" ? " above 0" : key === "t" ? " of at least 0" : "";
        typed(input, `${text} of ${part.name}`, rule, (value) => (key === "t" ? value >= 0 : key !== "cp" || value > 0), (value) => { asked[at][key] = value; show(); });
        inputs.push([input, at, key]);
        row.append(labelled(`${text} `, input));
      });
      if (part.grades.length) {
        const grade = element("select", "", { "aria-label": `grade of ${part.name}` });
        grade.append(element("option", ""));
        part.grades.forEach(([name]) => grade.append(element("option", name)));
        grade.addEventListener("change", () => { const half = part.grades.find(([name]) => name === grade.value); if (half) { asked[at].t = half[1]; told.textContent = ""; refill(); } });
        row.append(labelled("grade ", grade));
      }
      fields.append(row);
    });
    const back = element("button", "as analysed", { type: "button" });
    back.addEventListener("click", () => {
      asked.forEach((one, at) => Object.assign(one, begun[at]));
      told.textContent = "";
      refill();
    });
    const checks = found.quick.requirements.map((one) => [one, found.requirements.find((row) => row.requirement === one.name)])
      .filter(([, row]) => row && row.yield_percent !== null)
      .map(([one, row]) => `${one.name} ${number(state(one, partsOf(begun)).outside, 3)} % (full model ${number(100 - row.yield_percent, 3)} %)`);
    host.append(table, questions, told, fields, back);
    if (checks.length) host.append(element("p", `Outside as analysed, by this model: ${checks.join("; ")}.`, { class: "hint" }));
    show();
  }

  histograms();
  whatIf();
}());
