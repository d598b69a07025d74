"""Twins: simulated flights that nothing downstream can tell from logged ones.

Sensors are simulated, never results: `trajectory` moves the airframe, `sensors` looks at it through explicit
error processes, `twins` writes down as a flight what the sensors said. Every number comes from a file in
``data/twins`` that says whether it was published or chosen, and why (`parameters`).
"""
