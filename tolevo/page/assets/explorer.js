"use strict";
// One screen to work on: the front, what is asked of a point, and the selected allocation.

(function explorer() {
  const found = data();
  const count = found.rows.length;
  const host = document.getElementById("work");
  if (!count || !host) return;
  host.hidden = false;
  const model = modelOf(found);
  const cost = found.objectives.findIndex((axis) => axis.name === "cost");
  const size = found.objectives.length;
  const state = { at: place(found.choices.length ? found.choices[0].row : found.rows[0]), against: 0, view: "matters",
                  most: {}, grade: null, ranges: {}, kept: null };
  const byId = (id) => document.getElementById(id);
  const charts = [];
  let parallel = null;

  function place(row) { return Math.max(0, found.rows.indexOf(row)); }

  // ---- what is drawn

  function seriesOf(a, b) {
    const two = size === 2;
    const pick = (aims) => [aims[a], aims[b]];
    const list = [];
    const bounded = two && cost >= 0 && found.informative && found.bound.some((value) => value !== null);
    if (bounded) {
      const other = (axis) => (axis === cost ? found.bound : found.aims[axis]);
      list.push({ kind: "area", name: "gap between points and bound", x: found.aims[a], y: found.aims[b], x2: other(a), y2: other(b), colour: "--b" },
        { kind: "line", name: "proven bound of the cost", x: other(a), y: other(b), colour: "--b", dash: "2 3" });
    }
    if (found.exact && two) list.push({ kind: "line", name: "exact front", x: found.exact[a], y: found.exact[b], colour: "--quiet", width: 3 });
    found.relaxed.forEach((one, at) => {
      const [x, y] = pick(one.aims);
      list.push({ kind: two ? "line" : "dots", name: `limits as loose as ${one.label}`, x, y, colour: HUES[at % HUES.length], width: two ? 1 : 4, dash: two ? "8 3" : "" });
    });
    found.overlays.forEach((one, at) => {
      const [x, y] = pick(one.aims);
      list.push({ kind: two ? "line" : "dots", name: one.label, x, y, colour: HUES[(at + 1) % HUES.length], width: two ? 1 : 3, dash: two ? DASHES[at % DASHES.length] : "" });
    });
    const [x, y] = pick(found.aims);
    if (two) list.push({ kind: "line", x, y, width: 1 });
    list.push({ kind: "dots", name: `front, ${count} points`, x, y, width: 5 });
    const rows = [...new Set(found.choices.map((one) => one.row))].filter((row) => found.rows.includes(row));
    const stars = (some, name, colour) => some.length && list.push({ kind: "mark", symbol: "star", name, colour,
      x: some.map((row) => found.aims[a][place(row)]), y: some.map((row) => found.aims[b][place(row)]) });
    stars(rows.slice(1), "chosen by other rules", "--c");
    stars(rows.slice(0, 1), rows.length ? found.choices[0].name.replace(/_/g, " ") : "", "--mark-ink");
    found.references.forEach((one, at) => list.push({ kind: "mark", symbol: SYMBOLS[at % SYMBOLS.length], name: `${one.label}${one.feasible ? "" : " (breaks limits)"}`,
      x: [one.aims[a]], y: [one.aims[b]], colour: HUES[at % HUES.length], hollow: !one.feasible }));
    return list;
  }

  function plots() {
    const box = byId("plots");
    const one = size === 1;
    if (one) { box.append(lineOf()); return; }
    for (let a = 0; a < size; a += 1) {
      for (let b = a + 1; b < size; b += 1) {
        const [x, y] = size === 2 && cost === 0 ? [b, a] : [a, b];
        const div = element("div");
        box.append(div);
        const series = seriesOf(x, y);
        if (!charts.length) {
          const key = element("details", "", { class: "key" });
          key.open = window.innerWidth >= 1000 && series.filter((one) => one.name).length < 8;
          key.append(element("summary", "Legend"), legend(series));
          div.append(key);
        }
        charts.push({ x, y, view: chart(div, { x: found.objectives[x], y: found.objectives[y], series,
          points: { x: found.aims[x], y: found.aims[y] }, pick: select, hint: (at) => headline(found, at) }) });
      }
    }
    box.classList.toggle("many", charts.length > 1);
  }

  function lineOf() { // one objective: nothing to trade, so the values in words
    const axis = found.objectives[0];
    const rows = [["found optimum", withUnit(number(found.aims[0][state.at]), axis.unit), ""],
      ...found.references.map((one) => [one.label, withUnit(number(one.aims[0]), axis.unit), one.feasible ? "keeps all limits" : "breaks limits"])];
    return tableOf([["allocation", ""], [title(axis), ""], ["limits", ""]], rows, "One objective: there is one optimum and no front.");
  }

  // ---- what is asked

  function passes(at) {
    const aims = Object.entries(state.most).every(([axis, most]) => found.aims[axis][at] <= most * (1 + 1e-12));
    const ranges = Object.entries(state.ranges).every(([name, [low, high]]) => {
      const column = columnOf(name);
      return column[at] >= low && column[at] <= high;
    });
    return aims && ranges && (state.grade === null || found.tolerances.every((one) => keepsGrade(one, at)));
  }

  function columnOf(name) {
    const aim = found.objectives.findIndex((axis) => axis.name === name);
    return aim >= 0 ? found.aims[aim] : found.values[found.variables.findIndex((axis) => axis.name === name)];
  }

  function keepsGrade(tolerance, at) {
    const own = model.value(at, tolerance.name);
    if (own === null || !tolerance.free) return true;
    if (tolerance.kind === "grade") return own >= state.grade;
    const finest = tolerance.grades.find(([name]) => name === `IT${state.grade}`);
    return !finest || own >= finest[1] * (1 - 1e-9);
  }

  function ask() {
    const asked = Object.keys(state.most).length || Object.keys(state.ranges).length || state.grade !== null;
    state.kept = asked ? found.rows.map((_, at) => passes(at)) : null;
    charts.forEach((one) => one.view.shade(state.kept));
    const kept = found.rows.map((_, at) => at).filter((at) => !state.kept || state.kept[at]);
    const told = byId("told");
    if (!asked) told.textContent = "";
    else if (!kept.length) told.textContent = "No point of this front satisfies that. Widen it, or set it in the configuration ([limits], [variables]) and run again.";
    else {
      const others = found.objectives.map((_, axis) => axis).filter((axis) => axis !== cost);
      const cheapest = cost >= 0 && !(String(cost) in state.most && !others.some((axis) => String(axis) in state.most));
      const worth = (at) => (cheapest ? found.aims[cost][at] : others.reduce((sum, axis) => sum + found.aims[axis][at] / (Math.abs(found.aims[axis][0]) || 1), 0));
      const best = kept.reduce((one, at) => (worth(at) < worth(one) ? at : one), kept[0]);
      const free = found.rows.map((_, at) => at).reduce((one, at) => (worth(at) < worth(one) ? at : one), 0);
      const beside = cheapest && cost >= 0 ? ` ${signed(100 * (found.aims[cost][best] / found.aims[cost][free] - 1))} % against the cheapest of the front.` : "";
      told.textContent = `${kept.length} of ${count} points satisfy that; the ${cheapest ? "cheapest" : "best"} is selected.${beside}`;
      state.at = best;
    }
    show();
  }

  function field(text, unit, changed, attributes = {}) {
    const input = element("input", "", { type: "number", step: "any", inputmode: "decimal", ...attributes });
    input.addEventListener("input", () => { changed(input.value === "" ? null : Number(input.value)); ask(); });
    const label = labelled(`${text} `, input);
    if (unit) label.append(` ${unit}`);
    return label;
  }

  function asks() {
    const form = byId("asks");
    form.addEventListener("submit", (event) => event.preventDefault());
    const order = found.objectives.map((_, axis) => axis).sort((a, b) => (a === cost) - (b === cost));
    order.forEach((axis) => form.append(field(`${found.objectives[axis].label} at most`, found.objectives[axis].unit, (value) => {
      if (value === null) delete state.most[axis]; else state.most[axis] = value;
    }, { "data-aim": found.objectives[axis].name })));
    if (found.tolerances.some((one) => one.free && (one.kind === "grade" || one.grades.length))) {
      form.append(field("no grade finer than IT", "", (value) => { state.grade = value; }, { "data-grade": "", step: "1", min: "1", max: "18" }));
    }
    const fold = element("details", "", { class: "ranges" });
    fold.append(element("summary", "Range of each tolerance"));
    const list = element("div", "", { class: "fields" });
    found.variables.forEach((variable, at) => {
      if (found.values[at].some((value) => typeof value !== "number") || !found.tolerances.find((one) => one.name === variable.name)?.free) return;
      const change = (end) => (value) => {
        const now = state.ranges[variable.name] || [-Infinity, Infinity];
        now[end] = value === null ? (end ? Infinity : -Infinity) : value;
        if (now.every((one) => !Number.isFinite(one))) delete state.ranges[variable.name];
        else state.ranges[variable.name] = now;
      };
      const group = element("div", "", { role: "group", "aria-label": variable.label });
      group.append(element("span", title(variable)), field("from", "", change(0)), field("to", "", change(1)));
      list.append(group);
    });
    fold.append(list);
    form.append(fold, element("p", "", { id: "told", role: "status" }));
    form.hidden = size === 1 && count === 1;
  }

  // ---- the selected point

  const along = element("input", "", { type: "range", min: 0, max: count - 1, step: 1, id: "along" });
  const named = element("select", "", { id: "named" });
  const said = element("span", "", { role: "status", id: "said" });

  function select(at) {
    state.at = Math.max(0, Math.min(count - 1, at));
    show();
  }

  function show() {
    const needs = model.requirements(state.at);
    charts.forEach((one) => {
      const need = needs.find((other) => other.aim === (one.x === cost ? one.y : one.x));
      const known = need && need.price && size === 2 && cost >= 0;
      const slope = known ? (one.y === cost ? -need.price : -1 / need.price) : null;
      one.view.select(state.at, known ? { x: found.aims[one.x][state.at], y: found.aims[one.y][state.at], slope } : null);
    });
    if (parallel) parallel.show(state.at, state.kept, state.ranges);
    byId("headline").textContent = headline(found, state.at);
    byId("slope").replaceChildren(firsts(found, state.at), ...slopes(found, needs).map((text) => element("p", text)), element("p", distance(found, state.at), { class: "hint" }));
    const parts = state.view === "matters" ? [mattering(found, model, state.at), element("p", explained(found, model, state.at), { class: "hint" })]
      : state.view === "drawing" ? ordered(found, state.at) : [beside(found, model, state.at, found.references[state.against])];
    byId("allocation").replaceChildren(...parts);
    along.value = String(state.at);
    along.setAttribute("aria-valuetext", headline(found, state.at));
    const own = found.choices.find((one) => one.row === found.rows[state.at]);
    const was = named.value.startsWith("choice") ? found.choices[Number(named.value.slice(6))] : null;
    if (!own || !was || was.row !== own.row) named.value = own ? `choice${found.choices.indexOf(own)}` : "";
    said.textContent = "";
    units();
  }

  function units() { // where the model states yield of the units, and their law, at every point
    const box = byId("units");
    if (!box) return;
    const rows = found.units.map((one) => [one.label, withUnit(number(one.values[state.at], 5), one.unit)]);
    if (!rows.length) { box.hidden = true; return; }
    const parts = [tableOf([["units at this point", ""], ["value", ""]], rows)];
    const law = histogram(found, state.at);
    if (law) parts.unshift(law);
    byId("units-body").replaceChildren(...parts);
  }

  function tabs() {
    const bar = byId("views");
    const views = [["matters", "Tolerances"], ["drawing", "For the drawing"], ["beside", "Compared"]];
    const buttons = views.map(([name, text]) => {
      const button = element("button", text, { type: "button", role: "tab", id: `view-${name}`, "aria-controls": "allocation", "aria-selected": String(name === state.view) });
      button.tabIndex = name === state.view ? 0 : -1;
      const choose = () => {
        state.view = name;
        buttons.forEach((one) => { one.setAttribute("aria-selected", String(one === button)); one.tabIndex = one === button ? 0 : -1; });
        byId("allocation").setAttribute("aria-labelledby", button.id);
        byId("against-line").hidden = name !== "beside" || !found.references.length;
        show();
      };
      button.addEventListener("click", choose);
      button.addEventListener("keydown", (event) => {
        const move = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!move) return;
        const next = buttons[(buttons.indexOf(button) + move + buttons.length) % buttons.length];
        next.focus();
        next.click();
      });
      return button;
    });
    bar.append(...buttons);
  }

  function controls() {
    const bar = byId("controls");
    named.append(element("option", "a point of the front", { value: "" }));
    found.choices.forEach((one, at) => named.append(element("option", `${one.name.replace(/_/g, " ")}: ${one.meaning}`, { value: `choice${at}` })));
    named.addEventListener("change", () => { if (named.value) select(place(found.choices[Number(named.value.slice(6))].row)); });
    along.addEventListener("input", () => select(Number(along.value)));
    const other = element("select", "", { id: "against" });
    found.references.forEach((one, at) => other.append(element("option", one.label, { value: at })));
    other.addEventListener("change", () => { state.against = Number(other.value); show(); });
    const line = labelled("Compare with ", other);
    line.id = "against-line";
    line.hidden = true;
    if (count > 1) bar.append(labelled("Along the front ", along), labelled("Choose by ", named));
    bar.append(line);
    const save = (id, text, made) => {
      const button = element("button", text, { type: "button", id });
      button.addEventListener("click", async () => {
        said.textContent = (await copied(made(found, model, state.at))) ? " copied" : " not allowed here: see front.csv";
      });
      return button;
    };
    const print = element("button", "Print this sheet", { type: "button", id: "print" });
    print.addEventListener("click", () => { byId("view-drawing").click(); document.body.classList.add("sheet"); window.print(); document.body.classList.remove("sheet"); });
    const folded = () => [...document.querySelectorAll(".key:not([open])")];
    let opened = [];
    window.addEventListener("beforeprint", () => { opened = folded(); opened.forEach((one) => { one.open = true; }); });
    window.addEventListener("afterprint", () => opened.forEach((one) => { one.open = false; }));
    byId("exports").append(save("copy", "Copy as CSV", asCSV), save("designs", "Copy as designs.csv", asDesigns), print, said);
  }

  function brushes() {
    const fold = byId("parallel");
    const inner = fold.querySelector("div");
    if (count < 2) { fold.hidden = true; return; }
    const begin = () => {
      if (parallel || !fold.open) return;
      parallel = parallelChart(inner, found, (name, range) => {
        if (range) state.ranges[name] = range; else delete state.ranges[name];
        ask();
      });
      parallel.show(state.at, state.kept, state.ranges);
    };
    fold.addEventListener("toggle", begin);
    if (size > 2) { fold.open = true; begin(); }
  }

  tabs();
  controls();
  asks();
  plots();
  brushes();
  show();
  window.addEventListener("resize", () => { charts.forEach((one) => one.view.draw()); if (parallel) parallel.draw(); });
  window.tolevo = { state, charts, model, found, get parallel() { return parallel; } }; // for tests and consoles
})();
