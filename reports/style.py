"""The style sheet of all pages: plain, light or dark as the reader's system is."""

STYLE = """
:root { color-scheme: light dark; --ink: #1b1b1b; --paper: #ffffff; --line: #d0d0d0;
  --mark: #fff3cf; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e4e4; --paper: #16181b; --line: #444a52; --mark: #4a3f16; }
  figure svg { filter: invert(0.9) hue-rotate(180deg); }
}
body { color: var(--ink); background: var(--paper); font: 16px/1.5 system-ui, sans-serif;
  max-width: 72rem; margin: 0 auto; padding: 1rem; }
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
pre { overflow: auto; border: 1px solid var(--line); padding: 0.6rem; }
"""
