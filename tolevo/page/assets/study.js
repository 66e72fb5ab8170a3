"use strict";
// The settings of a study: rows that fit what is asked, and two settings side by side.

(function study() {
  const found = data();
  const host = document.getElementById("settings");
  if (!host || !found.points.length) return;
  const asks = element("form", "", { class: "asks" });
  const table = element("div", "", { class: "scroll", tabindex: "0", role: "group", "aria-label": "medians by setting" });
  const beside = element("div");
  const asked = {};

  const name = (point) => found.keys.map((key, at) => `${key.label} ${number(point.levels[at])}`).join(", ");
  const interval = (one) => (one ? `${number(one.median)} (${number(one.low, 3)} to ${number(one.high, 3)})` : "");

  function rows() {
    const kept = found.points.filter((point) => found.keys.every((key, at) => asked[at] === undefined || String(point.levels[at]) === asked[at]));
    const heads = [...found.keys.map((key) => [key.label, key.name]), ...found.responses.map((one) => [one.label, `${one.name}: median and its interval`])];
    table.replaceChildren(kept.length ? tableOf(heads, kept.map((point) => [...point.levels.map((one) => number(one)), ...point.medians.map(interval)]),
      `${kept.length} of ${found.points.length} settings`) : element("p", "No setting of this study fits that."));
  }

  found.keys.forEach((key, at) => {
    const select = element("select");
    select.append(element("option", "any", { value: "" }));
    [...new Set(found.points.map((point) => String(point.levels[at])))].forEach((one) => select.append(element("option", number(Number.isNaN(Number(one)) ? one : Number(one)), { value: one })));
    select.addEventListener("change", () => { if (select.value) asked[at] = select.value; else delete asked[at]; rows(); });
    asks.append(labelled(`${key.label} `, select));
  });

  const two = ["first", "second"].map((which, at) => {
    const select = element("select", "", { id: `${which}-setting` });
    found.points.forEach((point, place) => select.append(element("option", name(point), { value: place })));
    select.value = String(Math.min(at, found.points.length - 1));
    select.addEventListener("change", compare);
    return select;
  });

  function compare() {
    const [a, b] = two.map((select) => found.points[Number(select.value)]);
    beside.replaceChildren(tableOf([["response", ""], ["first setting", ""], ["second setting", ""], ["second less first", "difference of the medians"], ["better", ""]],
      found.responses.map((one, at) => {
        const [x, y] = [a.medians[at], b.medians[at]];
        if (!x || !y) return [one.label, interval(x), interval(y), "", ""];
        const apart = x.high < y.low || y.high < x.low;
        const better = (one.larger ? y.median > x.median : y.median < x.median) ? "second" : "first";
        return [one.label, interval(x), interval(y), signed(y.median - x.median), apart ? better : "intervals overlap: not shown"];
      })));
  }

  const line = element("p", "", { class: "asks" });
  line.append(labelled("Compare ", two[0]), labelled("with ", two[1]));
  host.append(asks, table, line, beside);
  rows();
  compare();
})();
