"""Animals seen from above and tracked over time.

- `images`: what a camera along a way detects of animals that walk, drawn or in rendered frames, and what its
  images could have shown.
- `tracking`: tracks through these images, by a particle filter or by a Kalman filter, and what came of them;
  the loop closed, where the high-level planner of F 5.3.1 asks the tracks where to fly next.
"""
