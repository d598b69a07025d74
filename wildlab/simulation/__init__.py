"""Twins: simulated flights that nothing downstream can tell from logged ones.

Sensors are simulated, never results: `trajectory`, `routes` and `courses` move the airframe, `targets` what
it looks for; `imu`, `gnss` and `sensors` err as data sheets say, `aboard` and `seen` write the tables, and
`twins` puts the flight together. Every number comes from a file in ``data/twins`` that says whether it was
published or chosen, and why (`parameters`, `models`, `quantities`).
"""
