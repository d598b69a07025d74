"""How the page for partners looks: on paper one A4 sheet, on a phone one column, bright and dark."""

from __future__ import annotations

STYLE = """:root { --ink: #18222d; --dim: #4f5b68; --line: #d5dbe1; --back: #fff;
  --ground: #e9f1ef; --way: #55626f; --seen: #b04a00; --true: #18222d; --blue: #00609b;
  --good: #0b6b43; --warn: #8f4d00; --bad: #a3201a; --neutral: #4f5b68; --on: #fff }
* { box-sizing: border-box }
html { -webkit-text-size-adjust: 100%; text-size-adjust: 100%; background: var(--back) }
body { margin: 0 auto; max-width: 60rem; padding: 1.6rem 1.4rem 2rem; color: var(--ink);
  background: var(--back);
  font: 17px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif;
  overflow-wrap: break-word }
h1 { font-size: 1.9rem; line-height: 1.15; letter-spacing: -.012em; margin: .1rem 0 1rem; text-wrap: balance }
h2 { font-size: 1.06rem; line-height: 1.25; margin: 0 0 .35rem }
p, ul, ol, figure { margin: 0; padding: 0 }
.kicker { color: var(--dim); font-size: .9rem }
.twin { border: 2px dashed var(--warn); border-radius: .5rem; padding: .4rem .8rem; margin: 0 0 .9rem;
  font-weight: 600 }
.verdict { display: grid; grid-template-columns: auto 1fr; gap: .1rem 1rem; align-items: center;
  border-radius: .7rem; padding: .95rem 1.2rem; color: var(--on); background: var(--level) }
.sign { grid-row: 1 / span 3; width: 3rem; height: 3rem; border: 3px solid var(--on); border-radius: 50%;
  font-size: 1.7rem; line-height: 2.65rem; text-align: center; font-weight: 700 }
.word { font-size: 1.5rem; line-height: 1.2; font-weight: 700 }
.verdict .next { font-weight: 600 }
.good { --level: var(--good) } .warn { --level: var(--warn) }
.bad { --level: var(--bad) } .neutral { --level: var(--neutral) }
.top { display: grid; grid-template-columns: minmax(0, 1.75fr) minmax(0, 1fr); gap: 1.4rem; margin: 1.2rem 0 }
.top.alone { grid-template-columns: 1fr }
.tiles { list-style: none; display: flex; flex-direction: column; gap: .7rem }
.alone .tiles { flex-flow: row wrap } .alone .tiles li { flex: 1 1 10rem }
.tiles li { border-left: 4px solid var(--line); padding: .1rem 0 .1rem .8rem }
.tiles b { display: block; font-size: 1.6rem; line-height: 1.2; font-variant-numeric: tabular-nums }
.tiles span { display: block; color: var(--dim); font-size: .92rem; line-height: 1.35 }
figure svg, figure img { display: block; width: 100%; height: auto }
figure img { border-radius: .5rem }
figcaption { color: var(--dim); font-size: .88rem; line-height: 1.4; margin-top: .35rem }
.legend { list-style: none; display: flex; flex-wrap: wrap; gap: .1rem 1.1rem; color: var(--ink) }
.legend i { display: inline-block; width: .75rem; height: .75rem; border-radius: 50%; margin-right: .4rem;
  vertical-align: -1px }
.legend .way { height: .25rem; width: 1.3rem; border-radius: 1px; background: var(--way);
  vertical-align: 3px }
.legend .start { border: 2px solid var(--way) }
.legend .median, .legend .about { border: 2px solid var(--blue) }
.legend .p90 { border: 2px dashed var(--blue) }
.legend .seen { background: var(--seen) } .legend .true { background: var(--true) }
svg text { font: 600 17px system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif;
  fill: var(--ink) }
svg .mid { text-anchor: middle }
svg .ground { fill: var(--ground) } svg .way { fill: none; stroke: var(--way); stroke-width: 2.2;
  stroke-linejoin: round }
svg .seen { fill: var(--seen); fill-opacity: .75 } svg .true { fill: var(--true); stroke: var(--ground);
  stroke-width: .8 }
svg .start { fill: var(--back); stroke: var(--way); stroke-width: 2.5 }
svg .scale, svg .cross { fill: none; stroke: var(--ink); stroke-width: 2.5 }
svg .lead { stroke: var(--dim); stroke-width: 1.2; stroke-dasharray: 3 3 }
svg .north { fill: var(--ink) }
svg .ring { stroke: var(--blue); stroke-width: 2.5; fill: var(--blue); fill-opacity: .16 }
svg .p90 { stroke-dasharray: 8 5; fill-opacity: .08 }
svg .whole { fill: none; stroke: var(--blue); stroke-width: 2.5 } svg .part { fill: var(--blue) }
.parts { display: grid; grid-template-columns: 1fr 1fr; gap: 1.1rem 1.6rem }
section { border-top: 3px solid var(--line); padding-top: .6rem }
section.do { border-color: var(--blue) }
section ul, section ol { padding-left: 1.3rem }
section li { margin: .3rem 0 }
.more { color: var(--dim); font-size: .92rem; padding-left: 1.3rem }
.place { border-top: 3px solid var(--line); margin-top: 1.1rem; padding-top: .6rem }
footer { margin-top: 1rem; color: var(--dim); font-size: .84rem }
@media screen and (prefers-color-scheme: dark) {
  :root { --ink: #e8edf2; --dim: #aab5c0; --line: #3a4651; --back: #12181f;
    --ground: #1c2a2b; --way: #97a6b4; --seen: #ffa257; --true: #f2f5f8; --blue: #62b8ea;
    --good: #7fd6a8; --warn: #f2b063; --bad: #ff9d94; --neutral: #b4bfca; --on: #12181f }
}
@media screen and (max-width: 44rem) {
  body { padding: 1rem .9rem 1.6rem; font-size: 16px }
  h1 { font-size: 1.5rem; margin-bottom: .8rem }
  .verdict { padding: .8rem .9rem; gap: .1rem .8rem }
  .sign { width: 2.4rem; height: 2.4rem; line-height: 2.1rem; font-size: 1.35rem; align-self: start }
  .word { font-size: 1.25rem }
  .top, .parts { grid-template-columns: 1fr; gap: 1rem }
  .tiles { display: grid; grid-template-columns: 1fr 1fr; gap: .7rem .9rem }
  .tiles b { font-size: 1.35rem }
}
@page { size: A4; margin: 10mm 13mm }
@media print {
  html { font-size: 9pt }
  body { max-width: none; padding: 0; font-size: 1rem; line-height: 1.3 }
  h1 { font-size: 1.7rem; margin-bottom: 2.5mm }
  .verdict, .legend i, svg { print-color-adjust: exact; -webkit-print-color-adjust: exact }
  .verdict { padding: 2.6mm 4mm }
  .top { margin: 3mm 0; gap: 6mm }
  .top:not(.alone) { grid-template-columns: 86mm 1fr }
  figure svg, figure img { max-height: 64.5mm; width: auto; max-width: 100% }
  .parts { gap: 2.5mm 6mm }
  section { padding-top: 1.2mm }
  section li { margin: .6mm 0 }
  .tiles { gap: 2.2mm }
  section, .verdict, figure { break-inside: avoid }
  .twin { margin-bottom: 2mm; padding: 1mm 3mm }
  .place { margin-top: 2.5mm; padding-top: 1.2mm }
  footer { margin-top: 1.5mm }
}"""
