"""The filter of all states at once, by which filters that keep some of them apart are judged."""

import numpy as np


def full_filter(times, R, look, move, start, estimated=None):
    """State, covariance and S after each measurement; states from ``estimated`` on have no gain.

    ``look(row, x)`` gives innovation and H, ``move(row, dt)`` gives F and Q; R (m, m) is that of all rows.
    """
    x, P, then = start.x, start.P, start.time
    for row, t in enumerate(times):
        F, Q = move(row, t - then)
        x, P, then = F @ x, F @ P @ F.T + Q, t
        innovation, H = look(row, x)
        S = H @ P @ H.T + R
        K = P @ H.T @ np.linalg.inv(S)
        K[len(x) if estimated is None else estimated :] = 0
        left = np.eye(len(x)) - K @ H
        x, P = x + K @ innovation, left @ P @ left.T + K @ R @ K.T
        yield x, P, S


def beside(one, other):
    """Both matrices on the diagonal of one."""
    n, m = len(one), len(other)
    return np.block([[one, np.zeros((n, m))], [np.zeros((m, n)), other]])
