"""The front page, ``reports/index.html``, and pages beside it: what was asked, what came out, where to go."""
