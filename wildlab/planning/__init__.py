"""Where to fly and where to look: rows over areas, swings of a gimbal, and what a plan will have seen.

Stands on geometry alone: arrays in, arrays out, SI units and radians, frame n (north-east-down). A planner
knows the map, the camera and its own plan; nothing of a simulation reaches it. F is A. Flodell and
C. Christensson, Wildlife Surveillance Using a UAV and Thermal Imagery, master's thesis, Linköping University
2016.

- `wildlab.planning.patterns`: areas, checked, and lawn-mower patterns over one or several, in the order of
  the shortest way (F 5.2).
- `wildlab.planning.courses`: the way that is flown through a pattern, with turns, wind, heights and times.
- `wildlab.planning.gimbal`: strategies of a gimbal and how they blur images (F 5.4).
- `wildlab.planning.coverage`: what images show of a terrain, how often, when last and how surely (F 5.8,
  5.9); animals that walk meanwhile.
- `wildlab.planning.planner`: where to fly and look next, by what is to be learnt (F 5.3.2), and whether to go
  back to an animal that is known (F 5.3.1); `legs`: what platform and gimbal can do, and flights along way
  points or by chance.

>>> from wildlab.planning.courses import fly
>>> from wildlab.planning.patterns import lawn_mower
>>> course = fly(lawn_mower([[0, 0], [0, 40], [100, 40], [100, 0]], 20.0), speed=5.0, turn_time=3.0)
>>> round(course.duration), round(course.length)
(50, 220)
"""
