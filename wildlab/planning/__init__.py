"""Where to fly and where to look: rows over areas, swings of a gimbal, and what a plan will have seen.

Stands on geometry alone: arrays in, arrays out, SI units and radians, frame n (north-east-down). A planner
knows the map, the camera and its own plan; nothing of a simulation reaches it. F is A. Flodell and
C. Christensson, Wildlife Surveillance Using a UAV and Thermal Imagery, master's thesis, Linköping University
2016.

- `wildlab.planning.areas`: polygons, checked; what lies in them.
- `wildlab.planning.patterns`: lawn-mower patterns over one area and over several (F 5.2); `visits`: the
  order of the shortest way.
- `wildlab.planning.courses`: the way that is flown through a pattern, with turns, wind and times; `heights`:
  above ground, within limits of climb and descent.
- `wildlab.planning.gimbal`: strategies of a gimbal and how they blur images (F 5.4).
- `wildlab.planning.sightings`, `coverage`: what images show of a terrain, how often, when last and how surely
  (F 5.8, 5.9); `moving`: animals that walk meanwhile.
- `wildlab.planning.information`: what is known of each point of a grid, and what an image adds (F 5.3.2).
- `wildlab.planning.planner`: where to fly and look next, by what is to be learnt; `followers`: along way
  points, or by chance; `legs`: what platform and gimbal can do.
- `wildlab.planning.high_level`: search on, or go back to an animal that is known (F 5.3.1).

>>> from wildlab.planning import fly, lawn_mower
>>> course = fly(lawn_mower([[0, 0], [0, 40], [100, 40], [100, 0]], 20.0), speed=5.0, turn_time=3.0)
>>> round(course.duration), round(course.length)
(50, 220)
"""

from wildlab.planning.areas import (
    area_of,
    check_area,
    contains,
    distance_to_border,
    is_convex,
    rectangle,
    stays_inside,
    way_inside,
)
from wildlab.planning.courses import Course, dubins, fly
from wildlab.planning.coverage import Coverage, Share, cover, from_sightings, nodes_in, share_seen
from wildlab.planning.gimbal import (
    GimbalAngles,
    adapt_roll,
    blur,
    camera_attitudes,
    camera_on_course,
    look_down,
    swing,
    swing_rate,
    swing_roll,
    swing_yaw,
    view_inside,
)
from wildlab.planning.heights import Profile, follow_terrain
from wildlab.planning.moving import first_seen, walks
from wildlab.planning.patterns import (
    Footprint,
    Pattern,
    footprint,
    lawn_mower,
    lawn_mowers,
    row_distance,
    rows_over,
)
from wildlab.planning.sightings import Sightings, see
from wildlab.planning.visits import AreaWay, visit_order

__all__ = [
    "AreaWay",
    "Course",
    "Coverage",
    "Footprint",
    "GimbalAngles",
    "Pattern",
    "Profile",
    "Share",
    "Sightings",
    "adapt_roll",
    "area_of",
    "blur",
    "camera_attitudes",
    "camera_on_course",
    "check_area",
    "contains",
    "cover",
    "distance_to_border",
    "dubins",
    "first_seen",
    "fly",
    "follow_terrain",
    "footprint",
    "from_sightings",
    "is_convex",
    "lawn_mower",
    "lawn_mowers",
    "look_down",
    "nodes_in",
    "rectangle",
    "row_distance",
    "rows_over",
    "see",
    "share_seen",
    "stays_inside",
    "swing",
    "swing_rate",
    "swing_roll",
    "swing_yaw",
    "view_inside",
    "visit_order",
    "walks",
    "way_inside",
]
