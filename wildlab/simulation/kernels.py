"""The hot loops of a simulated flight, compiled: its path, attitude, rates and sensor errors.

Tests hold each against the same in readable numpy. Arrays are contiguous and of doubles, so that each
function is compiled once.
"""

from __future__ import annotations

import math

import numpy as np

from wildlab.geometry.compilation import compiled
from wildlab.geometry.frames import Array

#: Sines are computed afresh after so many equal steps; in between they follow by the addition theorem.
BLOCK = 64
#: Newton steps until the angle on a circle has settled; one or two are enough but at the first time.
_STEPS = 100


@compiled
def sum_of_sines(times: Array, amplitudes: Array, frequencies: Array, phases: Array, out: Array) -> None:
    """A sum of sines and its derivatives, ``out`` (1 or 3, N): in equal steps one sine for many times.

    ``sin(w (t + j h) + phase)`` is made of sine and cosine at the start of a block of steps h, and of those
    of ``w j h``, which are the same for every block.
    """
    count, terms = len(times), len(amplitudes)
    step = (times[count - 1] - times[0]) / (count - 1) if count > 1 else 0.0
    sines, cosines = np.empty((terms, BLOCK)), np.empty((terms, BLOCK))
    for k in range(terms):
        for j in range(BLOCK):
            sines[k, j] = math.sin(frequencies[k] * (j * step))
            cosines[k, j] = math.cos(frequencies[k] * (j * step))
    derived = len(out) > 1
    out[:] = 0.0
    for first in range(0, count, BLOCK):
        # Indices of a block's own arrays count from zero, so the compiler makes vector instructions of loops.
        t, value = times[first : first + BLOCK], out[0, first : first + BLOCK]
        slope, bend = (
            (out[1, first : first + BLOCK], out[2, first : first + BLOCK]) if derived else (value, value)
        )
        even = True
        for j in range(len(t)):
            # A rounding of the times is far below what any signal changes in it.
            even &= abs(t[j] - t[0] - j * step) <= 1e-14 * (100.0 + abs(t[j]))
        for k in range(terms):
            w, a, phase, sine, cosine = frequencies[k], amplitudes[k], phases[k], sines[k], cosines[k]
            if even:
                s, c = a * math.sin(w * t[0] + phase), a * math.cos(w * t[0] + phase)
                for j in range(len(t)):
                    value[j] += s * cosine[j] + c * sine[j]
                if derived:
                    s, c = w * s, w * c
                    for j in range(len(t)):
                        slope[j] += c * cosine[j] - s * sine[j]
                    s, c = w * s, w * c
                    for j in range(len(t)):
                        bend[j] -= s * cosine[j] + c * sine[j]
            else:
                for j in range(len(t)):
                    s, c = a * math.sin(w * t[j] + phase), a * math.cos(w * t[j] + phase)
                    value[j] += s
                    if derived:
                        slope[j] += w * c
                        bend[j] -= w * w * s


@compiled
def piecewise_polynomial(
    times: Array, start: float, interval: float, coefficients: Array, p: Array, v: Array, a: Array
) -> None:
    """Three polynomials in pieces of one length, and two derivatives. ``coefficients`` (M, 3, D), ascending.

    NaN before ``start`` and after the last piece.
    """
    pieces, degree = coefficients.shape[0], coefficients.shape[2] - 1
    for n in range(len(times)):
        where = (times[n] - start) / interval
        if not 0.0 <= where <= pieces:
            for i in range(3):
                p[n, i] = v[n, i] = a[n, i] = np.nan
            continue
        m = min(int(where), pieces - 1)
        u = times[n] - (start + m * interval)
        for i in range(3):
            value, slope, bend = coefficients[m, i, degree], 0.0, 0.0
            for d in range(degree - 1, -1, -1):
                bend = bend * u + slope
                slope = slope * u + value
                value = value * u + coefficients[m, i, d]
            p[n, i], v[n, i], a[n, i] = value, slope, 2.0 * bend


@compiled
def _round_rate(
    angle: float, radius: float, airspeed: float, north: float, east: float, sense: float
) -> tuple[float, float]:
    """Angular rate around a circle in a wind (north, east), and its derivative with respect to the angle."""
    c, s = math.cos(angle), math.sin(angle)
    cross, along = c * north + s * east, c * east - s * north
    through_air = math.sqrt(airspeed * airspeed - cross * cross)
    slope = -sense * cross - cross * along / through_air
    return sense * (sense * along + through_air) / radius, sense * slope / radius


@compiled
def angles_on_circle(
    times: Array, circle: tuple[float, ...], mean: float, real: Array, imaginary: Array, out: Array
) -> None:
    """Bearing from the centre at every time: the time as a Fourier series of the angle, turned round.

    Each Newton iteration starts from the angle before, moved on with its rate and its acceleration. What
    would leave the bracket around the angle is halved instead: in a wind nearly as fast as the airframe,
    Newton's method alone may never settle.
    """
    radius, airspeed, north, east, sense, start = circle
    constant, width = real.sum(), 2.0 * np.sqrt(real * real + imaginary * imaginary).sum() / mean
    x, before, spin, slope = 0.0, 0.0, 0.0, 0.0
    for n in range(len(times)):
        ahead = times[n] - before
        if n > 0 and abs(ahead) * abs(spin) < 0.5:
            x += abs(spin) * ahead * (1.0 + 0.5 * slope * ahead)
        else:
            x = times[n] / mean
        low, high = times[n] / mean - width, times[n] / mean + width
        for _ in range(_STEPS):
            c, s = math.cos(x), math.sin(x)
            re, im = 0.0, 0.0
            for k in range(len(real) - 1, -1, -1):  # Horner
                re, im = re + real[k], im + imaginary[k]
                re, im = re * c - im * s, re * s + im * c
            spin, slope = _round_rate(start + sense * x, radius, airspeed, north, east, sense)
            late = mean * x + re - constant - times[n]
            step = late * abs(spin)
            if abs(step) < 1e-9:  # what is left after it is its square
                x -= step
                break
            if late < 0.0:
                low = x
            else:
                high = x
            x = x - step if low < x - step < high else (low + high) / 2.0
        before = times[n]
        out[n] = start + sense * x


@compiled
def circle_motion(
    angles: Array, circle: tuple[float, ...], off_circle: Array, p: Array, v: Array, a: Array
) -> None:
    """Horizontal motion about the origin at bearings (N,), off the circle by ``off_circle`` (3, N)."""
    radius, airspeed, north, east, sense, _ = circle
    for n in range(len(angles)):
        c, s = math.cos(angles[n]), math.sin(angles[n])
        spin, slope = _round_rate(angles[n], radius, airspeed, north, east, sense)
        r, r1, r2 = radius + off_circle[0, n], off_circle[1, n], off_circle[2, n]
        outward, clockwise = r2 - r * spin * spin, 2.0 * r1 * spin + r * slope * spin
        p[n, 0], p[n, 1] = r * c, r * s
        v[n, 0], v[n, 1] = r1 * c - r * spin * s, r1 * s + r * spin * c
        a[n, 0], a[n, 1] = outward * c - clockwise * s, outward * s + clockwise * c


@compiled
def coordinated_attitude(
    velocity: Array, acceleration: Array, wind: Array, trim_pitch: float, gravity: float, R: Array
) -> None:
    """Nose into the oncoming air but for the trim, no specific force along y."""
    st, ct = math.sin(trim_pitch), math.cos(trim_pitch)
    for n in range(len(velocity)):
        x0, x1, x2 = velocity[n, 0] - wind[0], velocity[n, 1] - wind[1], velocity[n, 2] - wind[2]
        size = math.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
        x0, x1, x2 = x0 / size, x1 / size, x2 / size
        f0, f1, f2 = acceleration[n, 0], acceleration[n, 1], acceleration[n, 2] - gravity
        y0, y1, y2 = x1 * f2 - x2 * f1, x2 * f0 - x0 * f2, x0 * f1 - x1 * f0
        size = math.sqrt(y0 * y0 + y1 * y1 + y2 * y2)
        y0, y1, y2 = y0 / size, y1 / size, y2 / size
        z0, z1, z2 = x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0
        R[n, 0, 0], R[n, 0, 1], R[n, 0, 2] = ct * x0 - st * z0, y0, st * x0 + ct * z0
        R[n, 1, 0], R[n, 1, 1], R[n, 1, 2] = ct * x1 - st * z1, y1, st * x1 + ct * z1
        R[n, 2, 0], R[n, 2, 1], R[n, 2, 2] = ct * x2 - st * z2, y2, st * x2 + ct * z2


@compiled
def turn(R: Array, roll: Array, pitch: Array, yaw: Array, out: Array) -> None:
    """``R`` (N, 3, 3) times the matrices of zyx Euler angles, H (5.10)."""
    for n in range(len(R)):
        sr, cr = math.sin(roll[n]), math.cos(roll[n])
        sp, cp = math.sin(pitch[n]), math.cos(pitch[n])
        sy, cy = math.sin(yaw[n]), math.cos(yaw[n])
        for i in range(3):
            x, y, z = R[n, i, 0], R[n, i, 1], R[n, i, 2]
            out[n, i, 0] = x * cy * cp + y * sy * cp - z * sp
            out[n, i, 1] = x * (cy * sp * sr - sy * cr) + y * (sy * sp * sr + cy * cr) + z * cp * sr
            out[n, i, 2] = x * (cy * sp * cr + sy * sr) + y * (sy * sp * cr - cy * sr) + z * cp * cr


@compiled
def _between(before: Array, after: Array, n: int) -> tuple[float, float, float]:
    """The rotation vector of the turn from one attitude to another, less than half a turn, in b."""
    xx = yy = zz = xy = yx = xz = zx = yz = zy = 0.0
    for i in range(3):
        x, y, z = before[n, i, 0], before[n, i, 1], before[n, i, 2]
        u, v, w = after[n, i, 0], after[n, i, 1], after[n, i, 2]
        xx, xy, xz = xx + x * u, xy + x * v, xz + x * w
        yx, yy, yz = yx + y * u, yy + y * v, yz + y * w
        zx, zy, zz = zx + z * u, zy + z * v, zz + z * w
    r0, r1, r2 = (zy - yz) / 2.0, (xz - zx) / 2.0, (yx - xy) / 2.0
    sine = math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
    scale = math.atan2(sine, (xx + yy + zz - 1.0) / 2.0) / sine if sine > 1e-12 else 1.0
    return scale * r0, scale * r1, scale * r2


@compiled
def body_rates(
    far_before: Array, before: Array, after: Array, far_after: Array, step: float, out: Array
) -> None:
    """Angular rate in b, (N, 3), half-way between attitudes a ``step`` (s) and two away, to fourth order."""
    for n in range(len(out)):
        near, far = _between(before, after, n), _between(far_before, far_after, n)
        for i in range(3):
            out[n, i] = (4.0 * near[i] / (2.0 * step) - far[i] / (4.0 * step)) / 3.0


@compiled
def felt_on_earth(R: Array, p: Array, v: Array, a: Array, earth: Array, force: Array, rate: Array) -> None:
    """Specific force in b, and the Earth's turning added to the rate of b against n, in b.

    ``earth`` is gravity, its gradient, the Earth's curvature, and the rate of n in n (3,).
    """
    gravity, gradient, curvature, w0, w1, w2 = earth[0], earth[1], earth[2], earth[3], earth[4], earth[5]
    for n in range(len(R)):
        down = gravity + gradient * p[n, 2]
        f0 = a[n, 0] + 2.0 * (w1 * v[n, 2] - w2 * v[n, 1]) + down * curvature * p[n, 0]
        f1 = a[n, 1] + 2.0 * (w2 * v[n, 0] - w0 * v[n, 2]) + down * curvature * p[n, 1]
        f2 = a[n, 2] + 2.0 * (w0 * v[n, 1] - w1 * v[n, 0]) - down
        for i in range(3):
            force[n, i] = R[n, 0, i] * f0 + R[n, 1, i] * f1 + R[n, 2, i] * f2
            rate[n, i] += R[n, 0, i] * w0 + R[n, 1, i] * w1 + R[n, 2, i] * w2


@compiled
def quaternions(R: Array, q: Array) -> None:
    """Unit quaternions (w, x, y, z) with w >= 0: from the largest of the four, which is at least a half."""
    for n in range(len(R)):
        xx, yy, zz = R[n, 0, 0], R[n, 1, 1], R[n, 2, 2]
        trace = xx + yy + zz
        largest = max(trace, xx, yy, zz)
        a, b, c = R[n, 2, 1] - R[n, 1, 2], R[n, 0, 2] - R[n, 2, 0], R[n, 1, 0] - R[n, 0, 1]
        d, e, f = R[n, 1, 0] + R[n, 0, 1], R[n, 0, 2] + R[n, 2, 0], R[n, 2, 1] + R[n, 1, 2]
        if largest == trace:
            w, x, y, z = 1.0 + trace, a, b, c
        elif largest == xx:
            w, x, y, z = a, 1.0 + 2.0 * xx - trace, d, e
        elif largest == yy:
            w, x, y, z = b, d, 1.0 + 2.0 * yy - trace, f
        else:
            w, x, y, z = c, e, f, 1.0 + 2.0 * zz - trace
        size = math.sqrt(w * w + x * x + y * y + z * z)
        if w < 0.0:
            size = -size
        q[n, 0], q[n, 1], q[n, 2], q[n, 3] = w / size, x / size, y / size, z / size


@compiled
def gauss_markov(draws: Array, sd: Array, kept: Array) -> None:
    """First-order Gauss-Markov processes from standard normal draws (N, K), in their place."""
    for k in range(draws.shape[1]):
        driven = math.sqrt(1.0 - kept[k] * kept[k])
        value = 0.0
        for n in range(len(draws)):
            value = kept[k] * value + draws[n, k] * sd[k] * (driven if n > 0 else 1.0)
            draws[n, k] = value


@compiled
def read_triad(
    true: Array, axes: Array, turn_on: Array, drift: Array, noise: Array, density: float, limits: Array
) -> None:
    """Stream of three axes in the place of their ``noise``: (N, 3) standard normal draws.

    ``axes`` (3, 3), ``turn_on`` (3,) and ``drift`` (N, 3) are the triad's misalignment and its biases;
    ``limits`` (2,) are range and resolution, of which 0 is none.
    """
    limit, resolution = limits[0], limits[1]
    for n in range(len(true)):
        for i in range(3):
            x = axes[i, 0] * true[n, 0] + axes[i, 1] * true[n, 1] + axes[i, 2] * true[n, 2]
            x = x + turn_on[i] + drift[n, i] + density * noise[n, i]
            if resolution > 0.0:
                x = np.rint(x / resolution) * resolution
            noise[n, i] = min(max(x, -limit), limit)
