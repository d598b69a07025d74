"""Animals seen from above and followed over time: images along a way, tracks between them, and going back.

- `images`: what a camera along a way detects of animals that walk, and what its images could have shown.
- `frames`: the same images rendered, and what a detector finds in them, false alarms too.
- `follow`: tracks through these images, by a particle filter or by a Kalman filter, and what came of them.
- `revisit`: the loop closed, where the high-level planner of F 5.3.1 asks the tracks where to fly next.
"""
