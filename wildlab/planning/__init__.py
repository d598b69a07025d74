"""Where to fly and where to look: rows over areas, swings of a gimbal, and what a plan will have seen.

Stands on geometry alone: arrays in, arrays out, SI units and radians, frame n (north-east-down). A planner
knows the map, the camera and its own plan; nothing of a simulation reaches it. F is A. Flodell and
C. Christensson, Wildlife Surveillance Using a UAV and Thermal Imagery, master's thesis, Linköping University
2016.

- `wildlab.planning.areas`: polygons, checked; what lies in them.
- `wildlab.planning.patterns`: lawn-mower patterns over one area and over several (F 5.2); `visits`: the
  order of the shortest way.
- `wildlab.planning.sea`: when tracked vessels have to be seen again, and level passes over them (H 8.2).
- `wildlab.planning.courses`: the way that is flown through a pattern, with turns, wind and times.
- `wildlab.planning.information`: what is known of each point of a grid, and what an image adds (F 5.3.2).
- `wildlab.planning.planner`: where to fly and look next, by what is to be learnt; `followers`: along way
  points, or by chance; `legs`: what platform and gimbal can do.
"""
