"""Twins: simulated flights that nothing downstream can tell from logged ones.

Sensors are simulated, never results: `trajectory`, `routes`, `surveys` and `courses` move the platform,
`targets` and `animals` what it looks for; `imu`, `gnss`, `gimbal` and `sensors` err as data sheets say,
`aboard` and `seen` (with `partly_seen` and `animals_seen`, through a `view`) write the tables, and `twins`
puts the flight together. Every number comes from a file in ``data/twins`` that says whether it was published
or chosen, and why (`parameters`, `models`, `subjects`, `quantities`).
"""
