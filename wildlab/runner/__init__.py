"""What runs when, and what a run leaves behind.

Here: the catalogue of studies, the flights they need, and the commands that run them. `seeds` keeps what
was computed, `scheduling` has it computed, `ledger` says what there is. None of them names a case: they run
what the protocol of `wildlab.studies` offers.
"""
