"""The look of the report: one style sheet for phones, wide screens, dark rooms and paper."""

from pgm_places.palette import METHOD_COLOURS

__all__ = ["STYLE"]

_DARK_METHOD_COLOURS = ("#63b3ed", "#f6ad55", "#68d391", "#b794f4", "#f687b3", "#cbd5e0")
_DASHES = ("none", "7 4", "2 3", "9 3 2 3", "4 2", "12 4")

_BASE = """
:root {
  color-scheme: light dark;
  --page: #ffffff; --card: #f6f7f9; --ink: #1a202c; --muted: #5a6472; --rule: #d8dde4;
  --accent: #2b6cb0; --warn: #8a4b00; --warn-page: #fff6e5; --heat: 33, 113, 181;
  --heat-ink: #ffffff;
METHODS
}
@media (prefers-color-scheme: dark) {
  :root {
    --page: #14181f; --card: #1d232c; --ink: #e6e9ee; --muted: #a3adba; --rule: #343c48;
    --accent: #63b3ed; --warn: #f6c177; --warn-page: #2c2415; --heat: 99, 179, 237;
    --heat-ink: #0b1520;
DARK_METHODS
  }
}
* { box-sizing: border-box; }
html { scroll-behavior: smooth; scroll-padding-top: 4rem; -webkit-text-size-adjust: 100%; }
body {
  margin: 0 auto; padding: 1.5rem clamp(1rem, 3vw, 3rem) 4rem; max-width: 100rem;
  background: var(--page); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif;
}
h1 { font-size: clamp(1.5rem, 4vw, 2.2rem); line-height: 1.2; margin: 0 0 .25rem; }
h2 {
  font-size: 1.4rem; margin: 3rem 0 .75rem; padding-top: .75rem;
  border-top: 1px solid var(--rule);
}
h3 { font-size: 1.1rem; margin: 2rem 0 .5rem; }
h4 { font-size: 1rem; margin: 1.25rem 0 .4rem; }
h1, h2, h3, h4, td, th, li, code { overflow-wrap: anywhere; }
p { margin: .4rem 0 .8rem; max-width: 75ch; }
a { color: var(--accent); }
.muted, caption, figcaption { color: var(--muted); font-size: .9rem; }
nav ul {
  display: flex; flex-wrap: wrap; gap: .25rem 1.25rem; margin: 1rem 0 0; padding: 0;
  list-style: none;
}
nav a { display: inline-block; padding: .3rem 0; }
.cards {
  display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 9.5rem), 1fr));
  gap: 1rem; margin: 1.5rem 0; padding: 0; list-style: none;
}
.cards li {
  background: var(--card); border: 1px solid var(--rule); border-radius: .5rem;
  padding: .8rem 1rem;
}
.cards b {
  display: block; font-size: 1.7rem; line-height: 1.25; font-variant-numeric: tabular-nums;
}
.warnings {
  background: var(--warn-page); color: var(--warn); border-left: 4px solid currentColor;
  border-radius: .25rem; padding: .75rem 1rem; margin: 1.5rem 0;
}
.warnings ul { margin: .25rem 0 0; padding-left: 1.2rem; }
.scroll { overflow-x: auto; margin: 0 0 1.5rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding-bottom: .4rem; }
th, td {
  padding: .4rem .75rem; text-align: right; border-bottom: 1px solid var(--rule);
  white-space: nowrap;
}
thead th { color: var(--muted); font-weight: 600; vertical-align: bottom; }
th[scope=row], thead th:first-child { text-align: left; }
th[scope=row] { position: sticky; left: 0; background: var(--page); font-weight: 600; }
td.best { font-weight: 700; }
.kind { display: block; color: var(--muted); font-size: .8rem; font-weight: 400; }
.figures td::after, .figures th[scope=col]:not(:first-child)::after {
  content: "\\00a0●"; visibility: hidden; font-size: .6rem;
}
.figures td.best::after { visibility: visible; color: var(--accent); }
.figures td:has(.interval) { position: relative; padding-bottom: 1.6rem; min-width: 6.6rem; }
.interval {
  position: absolute; right: 1.5rem; bottom: .3rem; color: var(--muted); font-weight: 400;
}
.picture { margin: 1.5rem 0; }
.picture img {
  display: block; max-width: 100%; height: auto; border: 1px solid var(--rule);
  border-radius: .3rem; background: #ffffff;
}
.facts td { text-align: left; white-space: normal; }
.group { border-left: 1px solid var(--rule); }
thead .group { text-align: center; }
.swatch {
  display: inline-block; width: .95em; height: .95em; border-radius: .15em;
  border: 1px solid rgba(90, 100, 114, .6); vertical-align: -.1em; margin-right: .45em;
  flex: none;
}
.striped {
  background: repeating-linear-gradient(135deg, #ffffff 0 3px, #d5d5d5 3px 4px) !important;
}
.legend {
  display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; margin: 0; padding: .5rem 0;
  list-style: none; font-size: .92rem;
}
.legend li { display: flex; align-items: center; }
.sticky {
  position: sticky; top: 0; z-index: 2; background: var(--page);
  border-bottom: 1px solid var(--rule);
}
.pair {
  display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 26rem), 1fr));
  gap: 1rem 1.5rem; margin-bottom: 1rem;
}
.small { grid-template-columns: repeat(auto-fill, minmax(min(100%, 15rem), 1fr)); }
.map, .chart { margin: 0; min-width: 0; }
.map button {
  display: block; width: 100%; padding: 0; border: 1px solid var(--rule); border-radius: .3rem;
  overflow: hidden; background: #dcdcdc; cursor: zoom-in;
}
.map button:focus-visible, .scroll:focus-visible, summary:focus-visible, a:focus-visible {
  outline: 3px solid var(--accent); outline-offset: 2px;
}
.map img { display: block; width: 100%; height: auto; }
.scale {
  display: block; height: .45rem; margin-top: .4rem; border: 2px solid var(--muted);
  border-top: 0;
}
.map figcaption {
  display: flex; flex-wrap: wrap; gap: 0 1rem; justify-content: space-between;
  padding-top: .3rem;
}
.charts {
  display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 24rem), 1fr));
  gap: 1.5rem;
}
.chart > svg { display: block; width: 100%; height: auto; max-width: 34rem; }
.chart text { font-size: 12px; fill: var(--muted); }
.chart .grid { stroke: var(--rule); } .chart .axis { stroke: var(--muted); }
.chart .diagonal { stroke: var(--muted); stroke-dasharray: 2 4; fill: none; }
.line { fill: none; stroke-width: 2; stroke-linejoin: round; }
.lines {
  display: flex; flex-wrap: wrap; gap: .1rem 1.2rem; margin: .3rem 0 0; padding: 0;
  list-style: none;
}
.lines li { display: flex; align-items: center; gap: .45rem; }
.lines svg { width: 28px; height: 12px; flex: none; }
LINES
.confusions { display: flex; flex-wrap: wrap; gap: 1rem 2.5rem; }
.confusions > .scroll { flex: 0 1 auto; max-width: 100%; }
.confusion td {
  text-align: center; min-width: 5.5rem; border: 2px solid var(--page); line-height: 1.25;
  padding: .55rem .6rem;
}
.confusion td.dark { color: var(--heat-ink); }
.confusion small { display: block; opacity: .85; }
details { margin: .5rem 0; }
summary { cursor: pointer; padding: .4rem 0; font-weight: 600; }
pre {
  overflow-x: auto; background: var(--card); border: 1px solid var(--rule);
  border-radius: .3rem; padding: 1rem; font-size: .85rem; line-height: 1.45;
}
code { font-size: .85rem; }
footer { margin-top: 3rem; color: var(--muted); font-size: .9rem; }
dialog {
  width: 100vw; height: 100dvh; max-width: none; max-height: none; margin: 0; padding: 0;
  border: 0; background: #20242b; color: #ffffff;
}
dialog[open] { display: flex; flex-direction: column; }
dialog .bar { display: flex; flex-wrap: wrap; gap: .35rem; padding: .5rem; }
dialog .bar :is(button, select) {
  font: inherit; font-size: .95rem; color: inherit; background: #39414d;
  border: 1px solid #566070; border-radius: .3rem; padding: .4rem .75rem; cursor: pointer;
}
dialog .bar select { flex: 1 1 12rem; max-width: 24rem; }
dialog .bar button:nth-last-of-type(4) { margin-left: auto; }
dialog .bar :focus-visible { outline: 2px solid #90cdf4; }
dialog .stage { flex: 1; overflow: auto; background: #dcdcdc; }
dialog .stage img { display: block; margin: auto; image-rendering: pixelated; }
@media (max-width: 40rem) {
  body { font-size: 15px; }
  th, td { padding: .35rem .5rem; }
  .confusion td { min-width: 4.4rem; }
}
@media print {
  body { max-width: none; padding: 0; font-size: 10pt; }
  nav, dialog { display: none; }
  .sticky, th[scope=row] { position: static; }
  .scroll, pre { overflow: visible; }
  pre { white-space: pre-wrap; }
  figure, tr, .cards li, .confusions > .scroll { break-inside: avoid; }
  h2, h3, h4, .legend { break-after: avoid; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
}
"""


def _variables(colours: tuple[str, ...]) -> str:
    return " ".join(f"--m{index}: {colour};" for index, colour in enumerate(colours))


def _lines() -> str:
    rules = [
        f".line.m{index} {{ stroke: var(--m{index}); stroke-dasharray: {dash}; }} "
        f".dot.m{index} {{ fill: var(--m{index}); }}"
        for index, dash in enumerate(_DASHES)
    ]
    return "\n".join(rules)


STYLE = (
    _BASE.replace("DARK_METHODS", "    " + _variables(_DARK_METHOD_COLOURS))
    .replace("METHODS", "  " + _variables(METHOD_COLOURS))
    .replace("LINES", _lines())
)
