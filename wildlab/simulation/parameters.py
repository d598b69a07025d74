"""The parameters of a twin: one TOML file, in which every number says where it comes from.

What several twins have in common (a payload, a receiver) is written once in ``data/twins/parts`` and named by
the twin (``parts = ["cruiser-mini"]``); what the twin itself says goes before what its parts say.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
from pydantic import field_validator, model_validator

from wildlab.errors import WildlabError
from wildlab.flight.files import Strict, check_model, did_you_mean, is_safe_name, read_toml
from wildlab.paths import DATA
from wildlab.simulation.models import (
    Assumed,
    Autopilot,
    Boresight,
    Gnss,
    Imu,
    LoiterFlight,
    OnboardClock,
    Place,
    StaticTarget,
    TruePose,
    TwinCamera,
    TwinMount,
)
from wildlab.simulation.quantities import Parameter

TWINS = DATA / "twins"
PARTS = TWINS / "parts"


class TwinParameters(Strict):
    """The whole of a twin's file."""

    name: str
    section: str
    description: str
    parts: tuple[str, ...] = ()
    place: Place
    flight: LoiterFlight
    target: StaticTarget
    camera: TwinCamera
    mount: TwinMount
    onboard_clock: OnboardClock
    autopilot: Autopilot
    boresight: Boresight
    imu: Imu
    gnss: Gnss
    truth: TruePose
    assumed: Assumed

    @field_validator("name")
    @classmethod
    def _safe_name(cls, value: str) -> str:
        if not is_safe_name(f"{value}-{2**63}"):  # the flight's name has the seed behind it
            raise ValueError(
                f"{value!r:.80} cannot be the name of a twin; use letters, digits, - and _ only, 80 at most"
            )
        return value

    @model_validator(mode="after")
    def _recorded_in_flight(self) -> TwinParameters:
        end = self.camera.recording_start.si + (self.camera.images.si - 1) / self.camera.frame_rate.si
        if end > self.flight.duration.si:
            raise ValueError(
                f"the camera would record until {end:.0f} s, after the flight's end; lower camera.images or "
                "camera.recording_start"
            )
        return self


def twin_names() -> list[str]:
    """Names of the twins that come with wildlab."""
    return sorted(path.stem for path in TWINS.glob("*.toml"))


def load_twin(name_or_path: str | Path) -> TwinParameters:
    """Parameters of a twin, by its name among those that come with wildlab, or from a file.

    Raises
    ------
    WildlabError
        Where there is no such twin or file, or a parameter is unknown, missing, without source or reason, in
        another unit, or out of range.
    """
    text = str(name_or_path)
    if isinstance(name_or_path, str) and is_safe_name(text):
        if text not in twin_names():
            raise WildlabError(f"there is no twin {text!r}", did_you_mean(text, twin_names()), field="twin")
        path = TWINS / f"{text}.toml"
    else:
        path = Path(name_or_path)
    return check_model(TwinParameters, _with_parts(read_toml(path, "the parameters of a twin"), path), path)


def part_names() -> list[str]:
    """Names of the parts that twins can be put together from."""
    return sorted(path.stem for path in PARTS.glob("*.toml"))


def _with_parts(data: dict[str, Any], path: Path) -> dict[str, Any]:
    """A twin's file with what its parts say filled in where it says nothing itself."""
    wanted = data.get("parts", [])
    if not isinstance(wanted, list) or not all(isinstance(name, str) for name in wanted):
        raise WildlabError(
            f"{wanted!r:.80} is not a list of names", 'write parts = ["name"]', file=path, field="parts"
        )
    known = part_names()
    for name in wanted:
        if name not in known:
            raise WildlabError(
                f"there is no part {name!r:.80}", did_you_mean(name, known), file=path, field="parts"
            )
    filled: dict[str, Any] = {}
    for layer in [*(read_toml(PARTS / f"{name}.toml", "a part of twins") for name in wanted), data]:
        for group, content in layer.items():
            before = filled.get(group)
            if isinstance(before, dict) and isinstance(content, dict):
                filled[group] = {**before, **content}
            else:
                filled[group] = content
    return filled


def each_parameter(twin: TwinParameters) -> Iterator[tuple[str, str, Parameter]]:
    """Group, name and parameter, in the order of the model."""
    for group in type(twin).model_fields:
        part = getattr(twin, group)
        if isinstance(part, Strict):
            for name in type(part).model_fields:
                yield group, name, getattr(part, name)


def parameters_table(twin: TwinParameters | str | Path) -> pd.DataFrame:
    """Every parameter of a twin, for a report.

    Columns, all of them text: ``parameter``, ``value``, ``unit``, ``status`` (published or chosen) and
    ``because`` (the source, and the reason where there is one).
    """
    parameters = twin if isinstance(twin, TwinParameters) else load_twin(twin)
    return pd.DataFrame(
        [
            {
                "parameter": f"{group}: {name}".replace("_", " "),
                "value": p.value if isinstance(p.value, str) else f"{p.value:.10g}",
                "unit": "" if p.unit == "1" else p.unit,
                "status": p.status,
                "because": "; ".join(part for part in (p.source, p.reason) if part),
            }
            for group, name, p in each_parameter(parameters)
        ],
        columns=["parameter", "value", "unit", "status", "because"],
    )
