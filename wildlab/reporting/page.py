"""The one page frame of everything we show: head, security policy, style.

Reports, failure pages and the ledger all come out of `page`, so a page that asks the network for something,
or runs something, cannot be made by accident: the policy in its head forbids both.
"""

from __future__ import annotations

from wildlab.reporting.text import escape

POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"

#: What each kind of report is called.
TAGS = {
    "logged": "logged flight",
    "twin": "simulated flight (twin)",
    "computed": "computed, no flight",
    "images": "images",
}

# System fonts only: a font file would be a request, or a megabyte. Words hold 4.5:1 against what lies behind
# them, by day and by night (a test computes it); `--on` is written on the status colours, `--plate` lies
# behind pictures, whose ink is dark.
STYLE = """:root { color-scheme: light dark; --ink: #18222d; --dim: #55626f; --line: #dce1e6; --bg: #ffffff;
  --soft: #f4f6f8; --blue: #0072b2; --band: #9cc7e0; --link: #00598c; --good: #0b7a4b; --warn: #9a5200;
  --bad: #b3261e; --on: #ffffff; --plate: #ffffff; --shade: #18222d33; --gap: 1.6rem;
  --mono: ui-monospace, Menlo, Consolas, "DejaVu Sans Mono", monospace }
/* Of the screen alone: paper is white. */
@media screen and (prefers-color-scheme: dark) { :root { --ink: #e6ebf0; --dim: #a7b2bd; --line: #323d48;
  --bg: #11171d; --soft: #1a222a; --blue: #4aa8e0; --band: #2c5878; --link: #82c4f2; --good: #4fc98f;
  --warn: #f0ab55; --bad: #ff9188; --on: #11171d; --shade: #000000b3 } }
* { box-sizing: border-box }
html { -webkit-text-size-adjust: 100%; text-size-adjust: 100% }
body { margin: 0 auto; max-width: 58rem; padding: 1.75rem 1.25rem 3.5rem; color: var(--ink);
  background: var(--bg);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif;
  overflow-wrap: break-word }
h1 { font-size: 1.9rem; line-height: 1.18; letter-spacing: -.012em; margin: .15rem 0 .45rem;
  text-wrap: balance }
h2 { font-size: 1.22rem; line-height: 1.3; margin: 2.5rem 0 .6rem }
h3 { font-size: 1.02rem; margin: 1.7rem 0 .4rem }
p, ul, ol { margin: .55rem 0; max-width: 46rem }
ul, ol { padding-left: 1.4rem }
li { margin: .3rem 0 }
a { color: var(--link) }
code { font: .88em var(--mono); overflow-wrap: anywhere }
code.short, .source { white-space: nowrap }
pre { font: .8rem/1.45 var(--mono); background: var(--soft); padding: .8rem 1rem; margin: .6rem 0;
  overflow-x: auto }
.kicker { margin: 0; color: var(--dim); font-size: .86rem }
.sub { color: var(--dim); margin: .2rem 0 0 }
.dim { color: var(--dim) }
.tag { display: inline-block; border: 1px solid currentColor; border-radius: 1rem; padding: 0 .6rem;
  margin-right: .45rem; font-size: .8rem; font-weight: 400; line-height: 1.5; color: var(--dim);
  white-space: nowrap }
.tag.logged { color: var(--good) }
.tag.twin { color: var(--link) }
.summary { border-left: 6px solid var(--dim); background: var(--soft); padding: .85rem 1.1rem;
  margin: 1.4rem 0 }
.summary.good { border-color: var(--good) }
.summary.warn { border-color: var(--warn) }
.summary.bad { border-color: var(--bad) }
.summary p { margin: 0; font-size: 1.08rem; max-width: none }
.summary p.verdict { margin-top: .55rem; font-size: 1rem }
.verdict .pill { margin-right: .3rem; font-weight: 600; white-space: normal; overflow-wrap: anywhere }
.alert { border: 1px solid var(--bad); border-left-width: 6px; padding: .6rem 1.1rem; margin: 1rem 0 }
.alert ul, .alert p { margin: .25rem 0; max-width: none }
a.word { color: inherit; text-decoration: underline dotted; text-underline-offset: .18em }
.words { margin: .6rem 0; max-width: 46rem; display: grid; grid-template-columns: max-content 1fr;
  gap: .35rem 1.2rem; font-size: .93rem }
.words dt { font-weight: 600; max-width: 12rem }
.words dd { margin: 0 }
.words dt:target, .words dt:target + dd { background: var(--soft) }
.get { white-space: nowrap }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(9.5rem, 1fr)); gap: .75rem;
  margin: 1.3rem 0; padding: 0; list-style: none; max-width: none }
.tiles li { border: 1px solid var(--line); border-radius: .4rem; padding: .65rem .85rem; margin: 0 }
.tiles b { display: block; font-size: 1.5rem; line-height: 1.25; font-variant-numeric: tabular-nums }
.tiles span { display: block; color: var(--dim); font-size: .86rem; line-height: 1.35 }
figure { margin: var(--gap) 0 }
figure.table { margin: .8rem 0 var(--gap) }
.row { display: flex; flex-wrap: wrap; gap: 0 1.5rem }
.row figure { flex: 1 1 20rem; min-width: 0; margin: .8rem 0 }
figure img { display: block; width: 100%; height: auto; background: var(--plate); border-radius: .25rem }
figcaption, .note { color: var(--dim); font-size: .88rem; line-height: 1.45; margin-top: .45rem;
  max-width: 46rem }
/* Shadows at the sides say that there is more; white patches that move along cover them at the ends. */
.scroll { overflow-x: auto; max-width: 100%; background-color: var(--bg); background-repeat: no-repeat;
  background-image: linear-gradient(to right, var(--bg) 30%, transparent),
  linear-gradient(to left, var(--bg) 30%, transparent),
  linear-gradient(to right, var(--shade), transparent), linear-gradient(to left, var(--shade), transparent);
  background-position: left, right, left, right; background-size: 40px 100%, 40px 100%, 12px 100%, 12px 100%;
  background-attachment: local, local, scroll, scroll }
.scroll:focus-visible, a:focus-visible, summary:focus-visible { outline: 2px solid var(--blue);
  outline-offset: 2px }
table { border-collapse: collapse; width: 100%; margin: .4rem 0; font-size: .93rem;
  font-variant-numeric: tabular-nums }
th, td { padding: .38rem .7rem; border-bottom: 1px solid var(--line); text-align: right; vertical-align: top;
  white-space: nowrap }
th:first-child, td:first-child { padding-left: 0 }
th:last-child, td:last-child { padding-right: 0 }
thead th { color: var(--dim); font-weight: 600; font-size: .82rem; vertical-align: bottom;
  white-space: normal }
tbody th { font-weight: 400 }
th.text, td.text { text-align: left; white-space: normal; min-width: 6.5rem; max-width: 28rem }
th.wide { min-width: 12rem }
td svg { display: block; margin-left: auto }
.formula { margin: .7rem 0; padding: .1rem 0; overflow-y: hidden }
math[display=block] { width: max-content; margin: 0 auto }
details { border-top: 1px solid var(--line); margin-top: 1.8rem; padding-top: .7rem }
details.plain { border: 0; margin-top: .6rem; padding: 0 }
summary { cursor: pointer; color: var(--dim) }
details[open] > summary { margin-bottom: .5rem }
footer { margin-top: 2.6rem; border-top: 1px solid var(--line); padding-top: .6rem; color: var(--dim);
  font-size: .82rem }
footer p { margin: .25rem 0; max-width: none }
.pill { display: inline-block; border-radius: 1rem; padding: .02rem .6rem; font-size: .82rem;
  color: var(--on);
  background: var(--dim); white-space: nowrap }
.pill.yes { background: var(--good) }
.pill.part { background: var(--warn) }
.pill.no { background: var(--bad) }
.look { border: 1px dashed var(--warn); border-radius: .4rem; padding: .5rem .85rem; max-width: none }
.key { white-space: nowrap; font-weight: 400 }
.key i { display: inline-block; vertical-align: -1px; margin: 0 .25rem 0 .6rem }
.hollow, .full { width: 9px; height: 9px; border-radius: 50% }
.hollow { border: 1.6px solid var(--ink) }
.full { background: var(--blue) }
.band { width: 18px; height: 6px; border-radius: 3px; background: var(--band) }
@media screen and (max-width: 36rem) {
  body { padding: 1.1rem .9rem 2.5rem; font-size: 15.5px }
  h1 { font-size: 1.5rem }
  .summary { padding: .75rem .9rem }
  .tiles b { font-size: 1.3rem }
  /* Narrow enough that what is published and what came out here stand side by side. */
  table { font-size: .86rem }
  th, td { padding: .34rem .4rem }
  thead th { font-size: .76rem }
  th.text, td.text { min-width: 4.6rem }
  th.wide { min-width: 8rem }
  .words { grid-template-columns: 1fr; gap: .1rem }
  .words dd { margin-bottom: .5rem }
  /* A row of many columns becomes an entry of a list: each cell after the name of its column. */
  table.many, table.many > tbody, table.many > tbody > tr { display: block }
  table.many > thead { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%) }
  table.many > tbody > tr { border-bottom: 1px solid var(--line); padding: .45rem 0 }
  table.many > tbody > tr > * { display: inline-block; border: 0; padding: 0; margin: 0 1rem .1rem 0;
    text-align: left; white-space: normal; min-width: 0; max-width: 100%; overflow-wrap: anywhere }
  table.many > tbody > tr > td::before { content: attr(data-label) "\\a0 "; color: var(--dim);
    font-size: .8rem }
  table.many > tbody > tr > th { display: block; font-weight: 600 }
  /* A figure whose letters would be too small to read is wider than the screen, and says so. */
  .slides::before { content: "wider than the screen: push it sideways \\2192"; display: block;
    position: sticky; left: 0; width: max-content; color: var(--dim); font-size: .8rem;
    padding-bottom: .2rem }
}
@page { size: A4; margin: 16mm 15mm 18mm; @bottom-right { content: counter(page) " / " counter(pages);
  font: 8pt system-ui, sans-serif } }
@media print {
  body { max-width: none; padding: 0; font-size: 10.2pt; line-height: 1.42; orphans: 3; widows: 3 }
  h1 { font-size: 17pt }
  h2 { font-size: 12.5pt; margin-top: 1.5rem }
  h1, h2, h3 { break-after: avoid }
  figure:not(.table), tr, .summary, .alert, .tiles, .formula, .words > * { break-inside: avoid }
  figcaption { break-before: avoid }
  /* Paper cannot be unfolded. */
  details::details-content { content-visibility: visible; block-size: auto }
  details > summary { list-style: none; font-weight: 600; color: inherit; break-after: avoid }
  .row { gap: 0 5mm }
  .row figure { flex: 1 1 80mm }
  /* Lower than half a page: what has no room leaves less than that empty. */
  figure img { max-height: 88mm; width: auto; max-width: 100% !important; min-width: 0 !important }
  .summary, .tag, .pill, .band, .full { print-color-adjust: exact; -webkit-print-color-adjust: exact }
  .scroll { overflow: visible; background: none }
  table { font-size: 8.4pt }
  th, td { padding: .22rem .45rem; white-space: normal }
  a { color: inherit; text-decoration: none }
  a.word { text-decoration: none }
  .get { display: none }
}"""


def first_look_notice(look: str, again: str) -> str:
    """What is said of a first look, as HTML.

    Parameters
    ----------
    look
        What it shows of what: "5 of 200 flights".
    again
        What to type for the full numbers.
    """
    return (
        f'<p class="look"><span class="pill part">first look</span> {escape(look)}. '
        f"For the full numbers: <code>make reports</code>, or <code>{escape(again)}</code>.</p>"
    )


def page(*, title: str, body: str, kicker: str = "", footer: str = "", style: str = "") -> str:
    """A whole HTML document.

    Parameters
    ----------
    title
        Text of ``<title>``; escaped here.
    body, kicker, footer
        HTML, made of `wildlab.reporting.text` pieces. ``kicker`` is the line above the ``<h1>`` in ``body``.
    style
        CSS that this page has besides `STYLE`.
    """
    above = f'<p class="kicker">{kicker}</p>\n' if kicker else ""
    below = f"<footer>{footer}</footer>\n" if footer else ""
    rules = f"{STYLE}\n{style}" if style else STYLE
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="referrer" content="no-referrer">\n'
        f"<title>{escape(title)}</title>\n<style>\n{rules}\n</style>\n</head>\n<body>\n"
        f"<main>\n{above}{body}\n</main>\n{below}</body>\n</html>\n"
    )
