"""``reports/partners.html``: how a partner gets a report that gives no place away."""

from __future__ import annotations

from collections.abc import Sequence

from wildlab.reporting.page import page
from wildlab.reporting.text import escape, inline

_STEPS = (
    "Make a copy: `wildlab share REPORT --for partner`, where REPORT is a report's folder, like "
    "`reports/{example}`. It is one file. Before it is kept, every byte of it is searched for the "
    "true places, names "
    "and dates; where one is found, there is no copy.",
    "Read what it says was taken out. That list stays with you, and is no part of the copy.",
    "Send that file, never the folder of the report: the report itself holds the places.",
)
_TIERS = (
    ("public", "anybody. This is what you get without `--for`: places are withheld or made coarse"),
    ("partner", "a ranger or a reserve that you work with: places as coarse as was agreed with them"),
    ("team", "those who may know the places: nothing is coarse"),
)


def partners_page(reports: Sequence[str]) -> str:
    """The whole page.

    Parameters
    ----------
    reports
        Folders of the reports that are there to be shared; may be empty.

    Returns
    -------
    str
        HTML.
    """
    example = reports[0] if reports else "tuesday-overview"
    # A name may hold what would end a span of code.
    steps = "".join(f"<li>{inline(one.format(example=example.replace('`', '')))}</li>" for one in _STEPS)
    tiers = "".join(
        f'<tr><th scope="row" class="text"><code>{name}</code></th><td class="text">{inline(words)}</td></tr>'
        for name, words in _TIERS
    )
    named = ", ".join(f"<code>{escape(one)}</code>" for one in reports[:12])
    there = (
        f"<p>{len(reports)} report{'s' * (len(reports) > 1)} of your own flights could be shared: "
        f"{named}{' and others' * (len(reports) > 12)}.</p>"
        if reports
        else "<p>No flight of yours was evaluated here yet, so there is nothing to share. "
        "<code>wildlab evaluate FLIGHT</code> writes a flight's reports.</p>"
    )
    body = (
        "<header><h1>A copy that is safe to send</h1>"
        '<p class="sub">The reports on this computer can show where animals are. Whoever gets a copy '
        "should see what "
        "was found and how sure that is, and not where.</p></header>"
        f"<ol>{steps}</ol><h2>For whom</h2>"
        '<div class="scroll" role="region" tabindex="0" aria-label="For whom"><table>'
        '<thead><tr><th scope="col" class="text">--for</th><th scope="col" class="text">who reads '
        "it</th></tr></thead>"
        f"<tbody>{tiers}</tbody></table></div><h2>What there is to share</h2>{there}"
    )
    way = '<a href="index.html">wildlab</a> › for partners'
    return page(title="A copy that is safe to send", body=body, kicker=way)
