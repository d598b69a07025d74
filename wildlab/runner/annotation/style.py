"""How the page looks."""

STYLE = """:root { --ink: #18222d; --dim: #55626f; --line: #dce1e6; --soft: #f4f6f8; --blue: #0072b2;
  --good: #0b7a4b; --bad: #b3261e }
* { box-sizing: border-box }
html, body { height: 100% }
body { margin: 0; display: flex; flex-direction: column; color: var(--ink); background: #fff;
  font: 15px/1.45 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif }
header { display: flex; align-items: center; gap: .4rem 1.25rem; flex-wrap: wrap; padding: .5rem .9rem;
  border-bottom: 1px solid var(--line) }
h1 { font-size: 1rem; margin: 0; max-width: 16rem }
h1, #image { overflow: hidden; text-overflow: ellipsis; white-space: nowrap }
h2 { font-size: .82rem; font-weight: 600; color: var(--dim); margin: 0 0 .4rem }
nav { display: flex; align-items: center; gap: .45rem; min-width: 0; flex: 1 }
#image { font-weight: 600; margin-left: .5rem }
#of { color: var(--dim); white-space: nowrap }
button, input { font: inherit; color: inherit; border: 1px solid #b8c0c8; border-radius: .3rem;
  background: #fff; padding: .2rem .6rem }
button { cursor: pointer }
button:hover { background: var(--soft) }
:focus-visible { outline: 2px solid var(--blue); outline-offset: 1px }
#jump { width: 4.6rem; text-align: right }
#saved { color: var(--good); font-size: .9rem; white-space: nowrap }
#saved.bad { color: var(--bad); font-weight: 600; white-space: normal }
main { display: flex; flex: 1; min-height: 0 }
#area { position: relative; flex: 1; min-width: 0; background: #22272c }
canvas { position: absolute; inset: 0; width: 100%; height: 100%; cursor: crosshair; touch-action: none }
canvas:focus-visible { outline-offset: -3px }
#problem { position: absolute; inset: 0; margin: 0; padding: 2rem; color: #fff; text-align: center;
  pointer-events: none }
#problem:empty { display: none }
aside { width: 19rem; flex: none; overflow-y: auto; border-left: 1px solid var(--line) }
section { padding: .8rem .9rem; border-bottom: 1px solid var(--line) }
section:last-child { border: 0 }
#name { width: 100% }
ol { list-style: none; margin: .5rem 0 0; padding: 0 }
li button { display: flex; gap: .6rem; width: 100%; text-align: left; border-color: transparent;
  padding: .15rem .4rem }
li button[aria-pressed=true] { background: #e3f0f8; border-color: var(--blue) }
li kbd { color: var(--dim); min-width: 1rem; font: .86rem/1.6 ui-monospace, Menlo, Consolas, monospace }
li b { font-weight: 600; overflow-wrap: anywhere; flex: 1 }
li i { font-style: normal; color: var(--dim); font-variant-numeric: tabular-nums; white-space: nowrap }
#names { max-height: 11rem; overflow-y: auto }
#points { max-height: 14rem; overflow-y: auto }
#where { margin: .4rem 0 0; color: var(--dim); font-variant-numeric: tabular-nums; min-height: 1.4em }
dl { display: grid; grid-template-columns: auto 1fr; gap: .2rem .8rem; margin: 0; font-size: .86rem }
dt { color: var(--dim); white-space: nowrap }
dd { margin: 0 }
.dim { color: var(--dim); font-size: .86rem; margin: .7rem 0 0 }
.hidden { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%) }
@media (max-width: 720px) {
  main { flex-direction: column }
  #area { flex: none; height: 60vh }
  aside { width: auto; border: 0 }
  nav { order: 3; flex-basis: 100% }
  #saved { margin-left: auto }
}
"""
