"""The page on which points are marked: one file, its script and style known by a number used once."""

from __future__ import annotations

from wildlab.runner.annotation.script import SCRIPT
from wildlab.runner.annotation.style import STYLE

_BODY = """<header>
  <h1 id="title">Marks</h1>
  <nav aria-label="Images">
    <button id="before" type="button" title="Page up, or left"
      aria-label="image before">&#8592;</button>
    <label class="hidden" for="jump">Number of the image</label>
    <input id="jump" type="number" min="1" value="1"><span id="of"></span>
    <button id="after" type="button" title="Page down, or right"
      aria-label="next image">&#8594;</button>
    <strong id="image"></strong>
  </nav>
  <span id="saved" role="status">Loading</span>
  <button id="finish" type="button">Finish</button>
</header>
<main>
  <div id="area"><canvas id="canvas" tabindex="0" role="application"
    aria-label="The image. Enter marks the middle of the view; arrow keys move what is chosen."></canvas>
    <p id="problem" role="alert"></p></div>
  <aside>
    <section>
      <h2>Mark as</h2>
      <label class="hidden" for="name">Name of the next point</label>
      <input id="name" maxlength="60" autocomplete="off" placeholder="Name, or none (key N)">
      <ol id="names"></ol>
    </section>
    <section>
      <h2>In this image <span id="count"></span></h2>
      <ol id="points"></ol>
      <p id="where"></p>
    </section>
    <section id="keys">
      <h2>Keys</h2>
      <dl>
        <dt>Click, Enter</dt><dd>mark here, or in the middle of the view</dd>
        <dt>1 to 9, N</dt><dd>choose a name, or type one</dd>
        <dt>Arrows</dt><dd id="arrows"></dd>
        <dt>Del</dt><dd>take the chosen point away</dd>
        <dt>[ ]</dt><dd>choose another point</dd>
        <dt>Esc</dt><dd>choose none</dd>
        <dt>Page up, down</dt><dd>image before, next image</dd>
        <dt>+ &minus; 0, wheel</dt><dd>nearer, farther, whole image</dd>
        <dt>W A S D, drag</dt><dd>move the view</dd>
      </dl>
      <p class="dim">Saved at every click. The middle of the first pixel is 0, 0.</p>
    </section>
  </aside>
</main>"""


def make_page(nonce: str) -> str:
    """The page, whose own script and style alone may run.

    Parameters
    ----------
    nonce
        A number used once, of letters that stand in an attribute.

    Returns
    -------
    str
        HTML; names of images and points come to it as data, and are shown as text.
    """
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>Marks</title>'
        '<meta name="viewport" content="width=device-width"><link rel="icon" href="data:,">'
        f'<style nonce="{nonce}">{STYLE}</style></head><body>{_BODY}'
        f'<script nonce="{nonce}">{SCRIPT}</script></body></html>\n'
    )
