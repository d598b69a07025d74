"""Targets as one state: against all ways by hand, each by a Kalman filter."""

from itertools import permutations, product

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from wildlab.tracking.joint_state import RULES, JointScans, Rule, assign_jointly

STEP = 0.5


def motion(K):
    F, Q = np.eye(4), np.diag([0.01, 0.01, 0.02, 0.02])
    F[:2, 2:] = STEP * np.eye(2)
    return np.tile(F, (K, 1, 1)), np.tile(Q, (K, 1, 1))


def scene(seed, T=2, K=4, own=1.0, shared=5.0):
    """Targets side by side; some scans miss one of them."""
    rng = np.random.default_rng(seed)
    x = np.column_stack([np.arange(T) * 3.0, np.zeros(T), np.zeros(T), np.ones(T)])
    z, count, whose = [], [], []
    for k in range(1, K + 1):
        there = rng.permutation(T)[: rng.integers(1, T + 1)]
        z.append(
            x[there, :2] + [0, k * STEP] + rng.normal(0, own, (len(there), 2)) + rng.normal(0, shared, 2)
        )
        count.append(len(there))
        whose += there.tolist()
    P = np.kron(np.diag(np.arange(T) ** 2 + 1.0), np.diag([2.0, 2.0, 1.0, 1.0]))
    unlike = rng.exponential(1.0, (len(whose), T))
    return JointScans(np.concatenate(z), np.array(count), *motion(K), own, shared, unlike), x, P


def posterior(scans, x, P, ways):
    """Log of how likely measurements and looks are where they go together so: by one large Gaussian."""
    T, worth, first = len(x), 0.0, 0
    mean, cov = x.reshape(-1), P
    for k, way in enumerate(ways):
        F, Q = (np.kron(np.eye(T), part[k]) for part in (scans.F, scans.Q))
        mean, cov = F @ mean, F @ cov @ F.T + Q
        H = np.concatenate([np.eye(4 * T)[4 * t : 4 * t + 2] for t in way])
        R = np.kron(np.eye(len(way)), scans.own**2 * np.eye(2))
        R = R + np.kron(np.ones((len(way), len(way))), scans.shared**2 * np.eye(2))
        z = scans.z[first : first + len(way)].reshape(-1)
        S = H @ cov @ H.T + R
        worth += multivariate_normal.logpdf(z, H @ mean, S)
        worth -= sum(scans.unlike[first + i, t] for i, t in enumerate(way)) / 2
        gain = cov @ H.T @ np.linalg.inv(S)
        mean, cov = mean + gain @ (z - H @ mean), cov - gain @ H @ cov
        first += len(way)
    return worth, mean, cov


@pytest.mark.parametrize("T", [1, 2, 3])
def test_many_histories_find_the_likeliest_of_all(T):
    for seed in range(5):
        scans, x, P = scene(seed, T, K=3)
        every = list(product(*(permutations(range(T), int(n)) for n in scans.number)))
        best = max(every, key=lambda ways: posterior(scans, x, P, ways)[0])
        found = assign_jointly(scans, x, P, Rule(most=10_000))
        assert found.tolist() == [t for way in best for t in way]
        # The likeliest way of each scan, one after the other.
        chosen = []
        for n in scans.number:
            ways = [[*chosen, way] for way in permutations(range(T), int(n))]
            chosen = max(ways, key=lambda one: posterior(scans, x, P, one)[0])
        assert assign_jointly(scans, x, P, RULES["gnn"]).tolist() == [t for way in chosen for t in way]


@pytest.mark.parametrize("rule", ["jpda", "jpda-star"])
def test_merged_ways_are_moments_of_their_mixture(rule):
    """Scan after scan by hand: the likeliest way under the Gaussian with the moments of the mixture."""
    for seed in range(20):
        scans, x, P = scene(seed, K=6)
        mean, cov, whose, first = x.reshape(-1), P, [], 0
        for k, n in enumerate(scans.number.tolist()):
            rows, step = slice(first, first + n), slice(k, k + 1)
            one = scans._replace(
                z=scans.z[rows],
                number=scans.number[step],
                F=scans.F[step],
                Q=scans.Q[step],
                unlike=scans.unlike[rows],
            )
            ways = list(permutations(range(2), n))
            each = [posterior(one, mean.reshape(2, 4), cov, [way]) for way in ways]
            worth = np.array([e[0] for e in each])
            whose += ways[int(worth.argmax())]
            p = np.exp(worth - worth.max())
            if rule == "jpda-star" and n == 2:
                p = (p == p.max()).astype(float)
            p /= p.sum()
            mean = sum(w * e[1] for w, e in zip(p, each, strict=True))
            cov = sum(w * (e[2] + np.outer(e[1] - mean, e[1] - mean)) for w, e in zip(p, each, strict=True))
            first += n
        assert assign_jointly(scans, x, P, RULES[rule]).tolist() == whose
