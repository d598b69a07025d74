"""What `wildlab` itself offers, one file for each subject: flights, tracks, figures.

Thin: every function calls the rooms below with defaults that its docstring states, and gives a small result
that prints in a few lines (`wildlab.summary_table`). Whoever wants something else calls the rooms.
"""
