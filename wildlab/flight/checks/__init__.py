"""Is a flight usable, for what, and does it make sense? `check_flight` asks all.

A finding is a code with facts; it names a table and a field, in the units and frames of `wildlab.flight`, and
nothing is changed. What is asked stands in the tables of `check`: plain questions, and those about meaning,
where two things that say the same disagree and usual mistakes are tried. The mistakes are rows of
``data/messages/mistakes.toml``, the sentences of ``data/messages/checks.toml``.
"""
