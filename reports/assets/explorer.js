"use strict";
// The front of a run: planes and parallel coordinates that share one selected point.

(function explorer() {
  const found = data();
  const count = found.rows.length;
  const host = document.getElementById("explorer");
  if (!count || typeof Plotly === "undefined") return;
  host.hidden = false;
  const state = { at: place(found.choices.length ? found.choices[0].row : found.rows[0]), against: 0 };
  const two = found.objectives.length === 2;
  const MARKED = 1200; // markers in a plane at most
  const LINES = 300; // parallel coordinates at most
  const planes = pairs(found.objectives.length).map((pair) => ({ pair, div: element("div", "", { class: "plot" }) }));
  const parallel = element("div", "", { class: "plot" });

  function place(row) {
    return Math.max(0, found.rows.indexOf(row));
  }

  function pairs(size) {
    const all = [];
    for (let a = 0; a < size; a += 1) for (let b = a + 1; b < size; b += 1) all.push([a, b]);
    return all;
  }

  // ---- traces

  function hover(a, b) {
    const [x, y] = [found.objectives[a], found.objectives[b]];
    return `${plain(x.label)} %{x:.4g} ${plain(x.unit)}<br>${plain(y.label)} %{y:.4g} ${plain(y.unit)}`;
  }

  function marks(name, x, y, marker, more) {
    return { type: "scatter", mode: "markers", name: entry(name), x, y, marker, ...more };
  }

  // Thousands of markers take seconds to draw: a long front is a line alone (its points can be
  // clicked all the same), a cloud shows every so manieth point.
  function frontTrace(a, b, end) {
    const step = two ? 1 : Math.ceil(count / MARKED);
    const shown = found.rows.map((_, at) => at).filter((at) => at % step === 0);
    const lined = two && count > MARKED;
    return { type: "scatter", mode: lined ? "lines" : two ? "lines+markers" : "markers",
             x: shown.map((at) => found.aims[a][at]), y: shown.map((at) => found.aims[b][at]),
             name: step > 1 ? `front, every ${step}. of ${count} points` : `front, ${count} points`,
             marker: { size: 6, color: tone("--front") },
             line: { width: lined ? 3 : 1, color: tone("--front") }, customdata: shown,
             hovertemplate: hover(a, b) + end };
  }

  function lineTraces(a, b) {
    const traces = [];
    const line = (name, x, y, dash) => traces.push({ type: "scatter", mode: "lines", name, x, y,
      hoverinfo: "skip", line: { dash, width: 1.5, color: tone("--ink") } });
    if (found.exact && two) line("exact front", found.exact[a], found.exact[b], "dash");
    const cost = found.objectives.findIndex((axis) => axis.name === "cost");
    if (two && cost >= 0 && found.bound.some((value) => value !== null)) {
      line("proven bound of the cost", a === cost ? found.bound : found.aims[a],
           b === cost ? found.bound : found.aims[b], "dot");
    }
    return traces;
  }

  function referenceTraces(a, b) {
    return found.references.map((one, at) => marks(
      one.feasible ? one.label : `${one.label} (breaks limits)`, [one.aims[a]], [one.aims[b]],
      { symbol: SYMBOLS[at % SYMBOLS.length] + (one.feasible ? "" : "-open"), size: 11,
        color: tone(HUES[at % HUES.length]), line: { width: one.feasible ? 0 : 2 } },
      { hovertemplate: hover(a, b) }));
  }

  function overlayTraces(a, b) {
    return found.overlays.map((one, at) => ({ type: "scatter", mode: two ? "lines+markers" : "markers",
      name: entry(one.label), x: one.aims[a], y: one.aims[b],
      marker: { symbol: "circle-open", size: 5, color: tone(HUES[at % HUES.length]) },
      line: { dash: DASHES[1 + at % 5], width: 1, color: tone(HUES[at % HUES.length]) },
      hovertemplate: hover(a, b) }));
  }

  function choiceTraces(a, b, end) {
    const rows = [...new Set(found.choices.map((one) => one.row))];
    return rows.filter((row) => found.rows.includes(row)).map((row, at) => {
      const names = found.choices.filter((one) => one.row === row).map((one) => one.name.replace(/_/g, " "));
      const told = names.length > 1 ? `${names[0]} (and ${names.length - 1} more)` : names[0];
      return marks(told, [found.aims[a][place(row)]], [found.aims[b][place(row)]],
        { symbol: MARKS[at % MARKS.length], size: 14, color: tone("--mark-ink"), line: { width: 1, color: tone("--paper") } },
        { customdata: [place(row)], hovertemplate: hover(a, b) + end });
    });
  }

  function idealTrace(a, b) {
    const x = found.ideal[found.objectives[a].name];
    const y = found.ideal[found.objectives[b].name];
    return typeof x === "number" && typeof y === "number"
      ? [marks("ideal", [x], [y], { symbol: "asterisk-open", size: 11, color: tone("--ink"), line: { width: 1.5 } },
               { hovertemplate: hover(a, b) })] : [];
  }

  function selected(a, b) {
    return marks("selected", [found.aims[a][state.at]], [found.aims[b][state.at]],
      { symbol: "circle-open", size: 20, color: tone("--ink"), line: { width: 3 } }, { hoverinfo: "skip" });
  }

  function scaledLine(values) {
    return values.map((value, at) => {
      const low = Math.min(...found.aims[at]);
      const high = Math.max(...found.aims[at]);
      return high > low ? (value - low) / (high - low) : 0;
    });
  }

  function parallelTraces() {
    const step = Math.max(1, Math.ceil(count / LINES));
    const axes = found.objectives.map((_, at) => at);
    const x = [];
    const y = [];
    const whose = [];
    for (let at = 0; at < count; at += step) {
      x.push(...axes, null);
      y.push(...scaledLine(found.aims.map((column) => column[at])), null);
      whose.push(...axes.map(() => at), null);
    }
    const line = (name, values, dash, width, colour) => ({ type: "scatter", mode: "lines+markers", name: entry(name),
      x: axes, y: scaledLine(values), line: { dash, width, color: colour }, marker: { size: 7 }, hoverinfo: "name" });
    return [
      { type: "scatter", mode: "lines+markers", name: `front, every ${step}. of ${count} points`, x, y, customdata: whose,
        marker: { size: 4, color: tone("--front") }, line: { width: 0.6, color: tone("--front") }, opacity: 0.6, hoverinfo: "skip" },
      ...found.references.map((one, at) => line(one.label, one.aims, DASHES[1 + at % 5], 2, tone(HUES[at % HUES.length]))),
      line("selected", found.aims.map((column) => column[state.at]), "solid", 4, tone("--ink")),
    ];
  }

  // ---- drawing

  function shaped(x, y, traces) {
    return layout(x, y, traces.map((trace) => trace.name));
  }

  function draw() {
    planes.forEach(({ pair: [a, b], div }, at) => {
      const end = "<extra>click to see it</extra>";
      const traces = [frontTrace(a, b, end), ...overlayTraces(a, b), ...lineTraces(a, b), ...choiceTraces(a, b, end), ...referenceTraces(a, b),
                      ...idealTrace(a, b), selected(a, b)];
      const shown = at ? [] : traces; // one legend for all planes
      Plotly.react(div, traces, shaped(title(found.objectives[a]), title(found.objectives[b]), shown), CONFIG);
    });
    if (parallel.isConnected) {
      const traces = parallelTraces();
      const shape = shaped("", "share of the range on the front", traces);
      shape.xaxis.tickvals = found.objectives.map((_, at) => at);
      shape.xaxis.ticktext = found.objectives.map((axis) => plain(title(axis)).replace(/ /g, "<br>"));
      shape.xaxis.range = [-0.3, found.objectives.length - 0.7];
      Plotly.react(parallel, traces, shape, CONFIG);
    }
    show();
  }

  function move() {
    planes.forEach(({ pair: [a, b], div }) => {
      Plotly.restyle(div, { x: [[found.aims[a][state.at]]], y: [[found.aims[b][state.at]]] }, [div.data.length - 1]);
    });
    if (parallel.isConnected) {
      Plotly.restyle(parallel, { y: [scaledLine(found.aims.map((column) => column[state.at]))] }, [parallel.data.length - 1]);
    }
    show();
  }

  function select(at) {
    state.at = Math.max(0, Math.min(count - 1, at));
    move();
  }

  // ---- controls

  const detail = document.getElementById("detail");
  const along = element("input", "", { type: "range", min: 0, max: count - 1, step: 1, id: "along" });
  const named = element("select", "", { id: "named" });
  const copy = element("button", "Copy this allocation as CSV", { type: "button", id: "copy" });
  const said = element("span", "", { role: "status", id: "said" });

  function show() {
    const reference = found.references[state.against] || null;
    const output = found.contributions.length ? found.contributions[0] : null;
    const parts = [element("p", distance(found, state.at))];
    if (output) {
      parts.push(element("p", `Contribution: share of each free tolerance in ${output.output}`
        + (output.explained === output.output ? "." : `, by ${output.explained}.`), { class: "hint" }));
    }
    const scroll = element("div", "", { class: "scroll", tabindex: "0", role: "region", "aria-label": "allocation" });
    scroll.append(allocationTable(found, state.at, reference));
    detail.querySelector("h3").textContent = headline(found, state.at);
    detail.querySelector("div").replaceChildren(...parts, scroll);
    along.value = String(state.at);
    along.setAttribute("aria-valuetext", headline(found, state.at));
    const own = found.choices.find((one) => one.row === found.rows[state.at]);
    if (!own || !named.value.startsWith("choice") || found.choices[Number(named.value.slice(6))].row !== own.row) {
      named.value = own ? `choice${found.choices.indexOf(own)}` : "";
    }
    said.textContent = "";
  }

  function labelled(text, control) {
    const label = element("label", text);
    label.append(control);
    return label;
  }

  function controls() {
    const bar = document.getElementById("controls");
    named.append(element("option", "a point of the front", { value: "" }));
    found.choices.forEach((one, at) =>
      named.append(element("option", `${one.name.replace(/_/g, " ")}: ${one.meaning}`, { value: `choice${at}` })));
    named.addEventListener("change", () => {
      if (named.value) select(place(found.choices[Number(named.value.slice(6))].row));
    });
    along.addEventListener("input", () => select(Number(along.value)));
    bar.append(labelled("Choose by ", named), labelled("Along the front ", along));
    if (found.references.length) {
      const other = element("select", "", { id: "against" });
      found.references.forEach((one, at) => other.append(element("option", one.label, { value: at })));
      other.addEventListener("change", () => { state.against = Number(other.value); show(); });
      bar.append(labelled("Compare with ", other));
    }
    copy.addEventListener("click", async () => {
      said.textContent = (await copied(asCSV(found, state.at))) ? " copied" : " not allowed here: see front.csv";
    });
    const line = element("p");
    line.append(copy, said);
    bar.append(line);
  }

  // The weight of an objective against the first: 50 is as much. The point whose pseudo-weights
  // (gains over the worst of the front, scaled, adding up to one) are nearest is selected.
  function sliders() {
    const box = document.getElementById("worth");
    const first = Math.max(0, found.objectives.findIndex((axis) => axis.name === "cost"));
    const others = found.objectives.map((_, at) => at).filter((at) => at !== first);
    if (!others.length) { box.hidden = true; return; }
    const own = pseudoWeights();
    const inputs = others.map((at) => {
      const input = element("input", "", { type: "range", min: 0, max: 100, step: 1, value: 50, class: "worth" });
      const shown = element("output", "50 : 50");
      const label = labelled(`What ${found.objectives[at].label} is worth against ${found.objectives[first].label} `, input);
      label.append(shown);
      box.append(label);
      input.addEventListener("input", () => { shown.textContent = `${input.value} : ${100 - input.value}`; weigh(); });
      return input;
    });
    function weigh() {
      const weights = found.objectives.map(() => 0);
      const odds = inputs.map((input) => Number(input.value) / 100);
      // against the first objective each has v : 1 - v
      const rest = odds.reduce((product, value) => product * (1 - value), 1);
      weights[first] = rest;
      others.forEach((at, place_) => {
        weights[at] = odds.reduce((product, value, other) => product * (other === place_ ? value : 1 - value), 1);
      });
      const sum = weights.reduce((a, b) => a + b, 0);
      if (sum > 0) select(nearest(own, weights.map((value) => value / sum)));
      else select(nearest(own, weights.map((_, at) => (at === first ? 0 : 1 / others.length))));
    }
  }

  function pseudoWeights() {
    const gains = found.aims.map((column) => {
      const low = Math.min(...column);
      const span = Math.max(...column) - low || 1;
      return column.map((value) => 1 - (value - low) / span);
    });
    return found.rows.map((_, at) => {
      const own = gains.map((column) => column[at]);
      const sum = own.reduce((a, b) => a + b, 0) || 1;
      return own.map((value) => value / sum);
    });
  }

  function nearest(own, weights) {
    let best = 0;
    let least = Infinity;
    own.forEach((row, at) => {
      const away = row.reduce((sum, value, axis) => sum + Math.abs(value - weights[axis]), 0);
      if (away < least) { least = away; best = at; }
    });
    return best;
  }

  // ---- begin

  const plots = document.getElementById("plots");
  planes.forEach(({ div }) => plots.append(div));
  if (found.objectives.length > 2) plots.append(parallel);
  controls();
  sliders();
  drawn(draw);
  [...planes.map((one) => one.div), parallel].filter((div) => div.on).forEach((div) => {
    div.on("plotly_click", (event) => {
      const at = event.points.map((point) => point.customdata).find((value) => typeof value === "number");
      if (at !== undefined) select(at);
    });
  });
})();
