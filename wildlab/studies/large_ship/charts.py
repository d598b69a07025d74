"""Figures of the study of the large ship: counterparts of H figures 6.2 to 6.4."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

from wildlab.reporting.figures import BLUE, GREEN, INK, ORANGE, VERMILLION, map_axes, new_figure
from wildlab.studies.large_ship.trial import START_S, WITH, WITHOUT, Photographs, Tracked, errors_of

#: What `Report.figures` takes: figure, name, alternative text, caption.
Shown = tuple[Figure, str, str, str]
_COLOURS = {WITH: BLUE, WITHOUT: VERMILLION}
_LABELS = {WITH: "adjusted", WITHOUT: "not adjusted"}


def images_shown(taken: Photographs) -> Shown:
    """An image that shows much of the ship, and one that shows about half of it (H figures 6.2, 4.8)."""
    plain, moved = taken.marks(np.nan), taken.marks()
    whole = int(np.argmax(np.where(plain.found, plain.share, -1.0)))
    cut = moved.moved if moved.moved.any() else plain.found
    part = int(np.argmin(np.where(cut, np.abs(plain.share - 0.5), 2.0)))
    height, width = taken.shape
    beyond = [max(float((-at).max()), *(at - [width, height])) for at in plain.centre[[whole, part]]]
    reach = max(0.0, *beyond) + 25
    fig, axes = new_figure(5.9, 3.1, columns=2)
    said = []
    for ax, row, name in zip(axes, (whole, part), ("Most in view", "Nearest to half"), strict=True):
        _, counts = taken.camera.image(int(plain.exposure[row]))
        low, high = np.quantile(counts, [0.01, 0.99])
        ax.imshow(counts, cmap="gray", vmin=low, vmax=high, interpolation="nearest")
        shot = taken.shots[row]
        one = shot.detections.select(shot.judged.found[1][:1])
        angle = float(np.degrees(one.orientation[0]))
        ax.add_patch(
            Ellipse(tuple(one.uv[0]), *one.axes[0], angle=angle, fill=False, ec=VERMILLION, lw=1.6)
        )  # fmt: skip
        ax.plot(*plain.uv[row], "x", color=VERMILLION, ms=8, mew=2, label="found")
        ax.plot(*moved.uv[row], "+", color=BLUE, ms=10, mew=2, label="adjusted")
        ax.plot(*plain.centre[row], "o", mfc="none", mec=ORANGE, ms=9, mew=1.6, label="true")
        ax.set(xlim=(-reach, width + reach), ylim=(height + reach, -reach), xticks=[], yticks=[])
        ax.set_facecolor("0.92")
        ax.grid(False)
        ax.set_title(f"{name}: {100 * plain.share[row]:.0f} %")
        off = [float(np.hypot(*(uv - plain.centre[row]))) for uv in (plain.uv[row], moved.uv[row])]
        said.append(
            f"{100 * plain.share[row]:.0f} % in view, {off[0]:.0f} px off as found, {off[1]:.0f} px adjusted"
        )
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return (
        fig, "fig-6-2", f"Two rendered thermal images of the ship with the ellipse found: {'; '.join(said)}.",
        f"Rendered images: {'; '.join(said)}. Counterpart of H figures 6.2 and 4.8.",
    )  # fmt: skip


def positions_shown(tracked: dict[str, Tracked]) -> Shown:
    """Georeferenced positions about the ship's receiver, with and without (H figure 6.3)."""
    fig, axes = new_figure(5.9, 3.7, columns=2)
    errors = {who: -errors_of(one)[0][one.seen.seen] for who, one in tracked.items()}
    spreads = {who: float(np.hypot(*e.std(axis=0, ddof=1))) for who, e in errors.items()}
    for ax, (who, e) in zip(axes, errors.items(), strict=True):
        ax.plot(e[:, 1], e[:, 0], "o", color=_COLOURS[who], ms=4, alpha=0.6, mew=0)
        ax.plot(*e.mean(axis=0)[::-1], "+", color=INK, ms=12, mew=2)
        ax.plot(0, 0, "o", mfc="none", mec=GREEN, ms=9, mew=2)
        ax.set_title(f"{_LABELS[who].capitalize()}: SD {spreads[who]:.1f} m")
    reach = 1.08 * max(float(np.abs(e).max()) for e in errors.values())
    for ax in axes:
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach))
        map_axes(ax, scale_bar=False)
    axes[1].set_ylabel("")
    less = WITH if spreads[WITH] < spreads[WITHOUT] else WITHOUT
    said = f"They scatter less where they are {_LABELS[less]}"
    return (
        fig, "fig-6-3", f"Positions of the ship on the sea from single images, adjusted and not. {said}.",
        f"Green ring: the ship's receiver. Cross: mean. {said}. Counterpart of H figure 6.3.",
    )  # fmt: skip


def track_shown(tracked: dict[str, Tracked]) -> Shown:
    """Distance from the receiver and estimated speed over the joined segments (H figure 6.4)."""
    fig, axes = new_figure(5.9, 4.6, rows=2, sharex=True)
    late = {}
    for who, one in tracked.items():
        times = one.seen.times
        distance, speed = np.hypot(*errors_of(one)[1].T), np.hypot(*one.track.x[:, 2:4].T)
        late[who] = float(np.nanmean(distance[times >= START_S]))
        axes[0].plot(times, distance, color=_COLOURS[who], label=_LABELS[who])
        axes[1].plot(times, speed, color=_COLOURS[who])
    for ax in axes:
        ax.axvline(START_S, color=INK, lw=0.8, ls=":")
        ax.set_ylim(bottom=0)
    axes[0].set_ylabel("distance (m)")
    axes[1].set_ylabel("speed (m/s)")
    axes[1].set_xlabel("time, segments joined (s)")
    better = min(late, key=lambda who: late[who])
    axes[0].set_title(f"After {START_S:.0f} s nearer: {_LABELS[better]}, {late[better]:.1f} m")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    said = "; ".join(f"{_LABELS[who]} {value:.1f} m after {START_S:.0f} s" for who, value in late.items())
    return (
        fig, "fig-6-4", f"Distance of the estimates from the receiver, and their speed, over time: {said}.",
        f"Mean distance: {said}. Dotted: the end of what the thesis leaves out. Counterpart of H figure 6.4.",
    )  # fmt: skip
