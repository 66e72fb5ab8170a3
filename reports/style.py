"""The design of all pages: one type scale, spacing, palette, in light, dark and print.

The colours of series are those of Okabe & Ito (2008), darkened on white and lightened on black
until each stands out from its background by 3 to 1 and texts by 4.5 to 1 (WCAG 2.2).
"""

LIGHT = """--ink: #1b1b1b; --soft: #55595f; --paper: #ffffff; --card: #f6f7f9; --line: #d3d7dc;
  --mark: #fff0c2; --front: #0a63b0; --mark-ink: #9a5b00; --a: #b5400a; --b: #007558; --c: #99407a;
  --d: #6b5500; --e: #1d7fa8; --quiet: #8a8f96; --away: #c3c8ce; --link: #0a58a0;"""
DARK = """--ink: #e6e7e9; --soft: #a9afb7; --paper: #15181c; --card: #1d2126; --line: #3d444d;
  --mark: #463a12; --front: #6db5f2; --mark-ink: #f0b94a; --a: #ff9466; --b: #4fd0a9; --c: #e79ac9;
  --d: #d9c46a; --e: #7fd0f0; --quiet: #8b939d; --away: #454c55; --link: #8cc4ff;"""
STYLE = f"""
:root {{ color-scheme: light dark; {LIGHT}
  --s1: .25rem; --s2: .5rem; --s3: 1rem; --s4: 2rem; --small: .8125rem; --text: 1rem; }}
@media (prefers-color-scheme: dark) {{ :root {{ {DARK} }} }}
@media print {{ :root {{ color-scheme: light; {LIGHT} }} }}
"""
STYLE += """
* { box-sizing: border-box; }
body { color: var(--ink); background: var(--paper); font: var(--text)/1.45 system-ui, sans-serif;
  max-width: 96rem; margin: 0 auto; padding: var(--s2) var(--s3); }
h1 { font-size: 1.4rem; margin: var(--s1) 0; }
h2 { font-size: 1.15rem; margin: var(--s4) 0 var(--s2); border-bottom: 1px solid var(--line); }
h3 { font-size: 1rem; margin: var(--s3) 0 var(--s1); }
h1, h2, h3, p, li, summary, dd { overflow-wrap: anywhere; }
td, th { overflow-wrap: break-word; }
p { margin: var(--s1) 0; }
a { color: var(--link); }
th a { color: inherit; text-decoration: underline dotted; }
summary { cursor: pointer; }
:focus-visible { outline: 3px solid var(--front); outline-offset: 1px; }
figure { margin: 0; }
figure svg { max-width: 100%; height: auto; background: #ffffff; border-radius: 4px; }
figcaption, .hint, caption { font-size: var(--small); color: var(--soft); text-align: left; }
.answers { margin: 0; padding: 0; list-style: none; font-size: .875rem; }
.answers li { margin: 1px 0; }
.asked { font-weight: 600; margin: 0; font-size: .9rem; }
.scroll { overflow: auto; max-height: 30rem; border: 1px solid var(--line); border-radius: 4px; }
table { border-collapse: collapse; font-size: var(--small); }
caption { padding: var(--s1) var(--s2); }
th, td { border-bottom: 1px solid var(--line); padding: 2px var(--s2); text-align: left;
  vertical-align: top; }
thead th { position: sticky; top: 0; background: var(--card); }
tbody th { font-weight: normal; }
td.n { text-align: right; font-variant-numeric: tabular-nums; }
td small { color: var(--soft); font-size: .75rem; }
tr.mark { background: var(--mark); }
pre { overflow: auto; border: 1px solid var(--line); padding: var(--s2); font-size: var(--small); }
.bar { display: block; height: .4rem; margin: 1px 0; min-width: 3rem; }
.bar span { display: block; height: 100%; background: var(--front); }
.bar .other { background: var(--a); }
.bar .ref { background: repeating-linear-gradient(45deg, var(--ink) 0 2px, transparent 2px 5px);
  border: 1px solid var(--ink); }
.bars { display: block; min-width: 6rem; }
.work { display: grid; gap: var(--s2) var(--s3); grid-template-columns: minmax(0, 1fr);
  background: var(--card); border: 1px solid var(--line); border-radius: 6px; padding: var(--s2);
  margin-top: var(--s2); }
.work[hidden] { display: none; }
.work h2 { margin: 0; border: 0; font-size: 1.05rem; }
.left, .right { min-width: 0; }
.plot { position: relative; width: 100%; height: 24rem; background: var(--paper);
  border: 1px solid var(--line); border-radius: 4px; touch-action: pan-y; overflow: hidden; }
.chart { display: block; width: 100%; height: 100%; font-size: 12px; user-select: none; }
.chart text { fill: var(--soft); }
.chart .small { font-size: 10px; }
.chart .grid, .chart .axis { stroke: var(--line); fill: none; stroke-width: 1; }
.chart .ring { fill: none; stroke: var(--ink); stroke-width: 3; }
.chart .brush { fill: var(--mark-ink); fill-opacity: .35; stroke: var(--mark-ink); }
.tip { position: absolute; pointer-events: none; background: var(--ink); color: var(--paper);
  font-size: var(--small); padding: 2px var(--s2); border-radius: 4px; max-width: 15rem;
  z-index: 2; }
.key { position: absolute; top: var(--s1); right: var(--s1); max-width: 60%; z-index: 1;
  background: var(--paper); border: 1px solid var(--line); border-radius: 4px; padding: 2px 6px;
  font-size: var(--small); }
.legend { list-style: none; margin: 0; padding: 0; font-size: var(--small); }
.legend li { display: flex; gap: 6px; align-items: center; }
.legend svg { flex: none; }
.asks { display: flex; flex-wrap: wrap; gap: 2px var(--s3); align-items: center;
  margin-bottom: var(--s1); font-size: .875rem; }
.asks > details, .asks > p { margin: 0; }
.asks > details[open], .asks > p:not(:empty) { flex-basis: 100%; }
.asks input { width: 5.5rem; }
input, select, button { font: inherit; color: var(--ink); background: var(--paper);
  border: 1px solid var(--quiet); border-radius: 4px; padding: 1px 6px; }
button { padding: 2px 10px; }
[role="tab"][aria-selected="true"] { background: var(--front); color: var(--paper); }
#views { display: flex; gap: var(--s1); margin: var(--s1) 0; }
#controls { display: flex; flex-wrap: wrap; gap: 2px var(--s3); font-size: .875rem; }
#controls label { display: flex; gap: 6px; align-items: center; flex: 1 1 14rem; }
#controls select, #controls input { flex: 1; min-width: 0; width: 100%; }
#controls [hidden] { display: none; }
#slope p { font-size: .875rem; }
#exports { display: flex; flex-wrap: wrap; gap: var(--s1); }
[data-filter] .scroll { max-height: none; }
#told { font-size: .875rem; font-weight: 600; }
.unverified { color: var(--a); }
.verified { color: var(--b); }
.fields > div { display: flex; flex-wrap: wrap; gap: 4px; margin: 2px 0; font-size: var(--small); }
.fields > div > span { min-width: 14rem; }
.histogram .plot { height: 13rem; }
#parallel .plot { height: 26rem; }
.many { display: grid; gap: var(--s2);
  grid-template-columns: repeat(auto-fit, minmax(15rem, 1fr)); }
.many .plot { height: 15rem; }
dl.terms { font-size: .875rem; }
dl.terms dt { font-weight: 600; }
dl.terms dd { margin: 0 0 var(--s1) var(--s3); }
details { margin: var(--s1) 0; }
@media (min-width: 1000px) {
  .work { grid-template-columns: minmax(0, 4fr) minmax(0, 5fr); }
  #allocation { max-height: 21.5rem; }
  .plot { height: 26rem; }
}
@media (max-width: 999px) { #allocation { max-height: none; } }
@media print, (min-width: 601px) { section.sheet td:nth-child(2) { white-space: nowrap; } }
@media (max-width: 600px) {
  .cards thead { position: absolute; width: 1px; height: 1px; overflow: hidden;
    clip-path: inset(50%); }
  .cards, .cards caption, .cards tbody, .cards tr, .cards td, .cards th { display: block;
    width: 100%; }
  .cards tr { border-bottom: 2px solid var(--line); padding: var(--s1) 0; }
  .cards th, .cards td { border: 0; padding: 1px var(--s2); overflow-wrap: anywhere; }
  .cards tbody th { font-weight: 600; }
  .cards td { display: flex; justify-content: space-between; gap: var(--s3); text-align: right; }
  .cards td:empty { display: none; }
  .cards td::before { content: attr(data-head); color: var(--soft); text-align: left; }
  .fields > div > span { min-width: 100%; }
  .scroll { max-height: none; }
}
@page { margin: 14mm; }
@media print {
  section:not(.sheet) .scroll table { font-size: 8pt; }
  body { max-width: none; padding: 0; font-size: 10pt; }
  .scroll { overflow: visible; max-height: none !important; border: 0; }
  .work { grid-template-columns: minmax(0, 1fr); border: 0; background: none; padding: 0; }
  #asks, #controls, #views, #exports, #parallel, .work .hint, .key summary { display: none; }
  .key:not([open]) { display: none; }
  .plot { height: 11cm; break-inside: avoid; }
  tr, figure, section.sheet { break-inside: avoid; }
  section.sheet { break-after: page; }
  body.sheet > main > :not(.work), body.sheet > header > :not(h1), body.sheet .left,
  body.sheet #slope, body.sheet #units, body.sheet > footer { display: none; }
}
"""
