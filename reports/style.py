"""The style sheet of all pages: plain, light or dark as the reader's system is."""

STYLE = """
:root { color-scheme: light dark; --ink: #1b1b1b; --paper: #ffffff; --line: #d0d0d0;
  --mark: #fff3cf; --front: #1f5fa8; --mark-ink: #b8860b; --a: #c4501b; --b: #2b7a3d; --c: #7b3fa0;
  --d: #6b5500; --e: #b0245f; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e4e4; --paper: #16181b; --line: #444a52; --mark: #4a3f16; --front: #7db4f0;
    --mark-ink: #f2c14e; --a: #ff9a6b; --b: #7fd394; --c: #cfa0ee; --d: #d8c06a; --e: #ff8ab8; }
  figure svg { filter: invert(0.9) hue-rotate(180deg); }
}
body { color: var(--ink); background: var(--paper); font: 16px/1.5 system-ui, sans-serif;
  max-width: 84rem; margin: 0 auto; padding: 1rem; }
h1, h2, h3, p, li, summary { overflow-wrap: anywhere; }
h2 { border-bottom: 1px solid var(--line); margin-top: 2rem; }
figure { margin: 0; }
figure svg { max-width: 100%; height: auto; }
.scroll { overflow: auto; max-height: 30rem; border: 1px solid var(--line); }
table { border-collapse: collapse; font-size: 0.85rem; }
caption { text-align: left; padding: 0.3rem 0.6rem; }
th, td { border-bottom: 1px solid var(--line); padding: 0.2rem 0.6rem; text-align: left;
  vertical-align: top; }
thead th { position: sticky; top: 0; background: var(--paper); }
td.n { text-align: right; font-variant-numeric: tabular-nums; }
tr.mark { background: var(--mark); }
.explorer { display: grid; gap: 1rem; grid-template-columns: minmax(0, 1fr); }
.plot { width: 100%; min-height: 20rem; }
.hint { font-size: 0.9rem; margin: 0.3rem 0; }
.panel label { display: block; margin: 0.4rem 0; }
.panel select, .panel input[type="range"] { width: 100%; max-width: 34rem; display: block; }
.panel button { font: inherit; padding: 0.3rem 0.8rem; }
.panel fieldset { border: 1px solid var(--line); margin: 0.8rem 0; }
.panel :focus-visible, .scroll:focus-visible { outline: 3px solid var(--front);
  outline-offset: 2px; }
#detail .scroll { max-height: none; }
td.bars { min-width: 10rem; white-space: nowrap; }
.bar { display: block; height: 0.5rem; margin: 1px 0; }
.bar span { display: block; height: 100%; box-sizing: border-box; border: 1px solid var(--ink); }
.bar .own { background: var(--front); }
.bar .other { background: repeating-linear-gradient(45deg, var(--ink) 0 2px, transparent 2px 5px); }
tbody th { font-weight: normal; }
@media (max-width: 700px) {
  #detail table { font-size: 0.78rem; }
  #detail th, #detail td { padding: 0.2rem 0.25rem; }
  td.bars { min-width: 4.5rem; }
}
@media (min-width: 1000px) {
  .explorer { grid-template-columns: minmax(0, 3fr) minmax(0, 2fr); }
  .explorer > .hint, #detail { grid-column: 1 / -1; }
}
pre { overflow: auto; border: 1px solid var(--line); padding: 0.6rem; }
"""
