"""The parameters of a twin: one TOML file, in which every number says where it comes from.

What several twins have in common (a payload, a receiver) is written once in ``data/twins/parts`` and named by
the twin (``parts = ["cruiser-mini"]``); what the twin itself says goes before what its parts say.

What of a twin is not published may be moved, to see what hangs on it: `varied` holds for every twin that is
loaded within it, so a trial that asks for its twin by name gets it moved, wherever it asks. Nothing that
filters are told (the group ``assumed``, tunings in the code) is moved. A moved twin need not show its target
as often as is printed: see `TwinParameters.as_moved_from`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from datetime import datetime
from functools import partial
from pathlib import Path
from types import GenericAlias
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import pandas as pd
from pydantic import AfterValidator, Field, PrivateAttr, create_model, field_validator, model_validator

from wildlab.errors import WildlabError
from wildlab.flight.files import Strict, check_model, did_you_mean, is_safe_name, read_toml
from wildlab.geometry.frames import STANDARD_GRAVITY
from wildlab.paths import DATA

TWINS = DATA / "twins"
PARTS = TWINS / "parts"

#: Units a twin may use, and what one of each is in SI and radians.
UNITS = {
    "": 1.0,
    "1": 1.0,
    "deg": math.pi / 180,
    "m": 1.0,
    "m/s": 1.0,
    "m/s^2": 1.0,
    "s": 1.0,
    "ms": 1e-3,
    "Hz": 1.0,
    "ppm": 1e-6,
    "px": 1.0,
    "deg/s": math.pi / 180,
    "deg/h": math.pi / 180 / 3600,
    "deg/sqrt(h)": math.pi / 180 / 60,
    "m/s/sqrt(h)": 1 / 60,
    "mrad": 1e-3,
    "g": STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "ug": 1e-6 * STANDARD_GRAVITY,
}


_TABLE = re.compile(r"[HF] table [A-Z\d]+\.\d+")


class Parameter(Strict):
    """One parameter of a twin: its value, and on whose word.

    ``fitted_to`` names tables as the published numbers name theirs (``H table 5.4``), so that the two can be
    held against each other.
    """

    value: float | str
    unit: str
    status: Literal["published", "chosen", "fitted"]
    source: str = ""
    reason: str = ""
    fitted_to: tuple[str, ...] = ()

    @field_validator("value", mode="before")
    @classmethod
    def _number_or_text(cls, value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(f"{value!r:.80} is neither a number nor a text; give one or the other")
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{value} is not a finite number; give one that is")
        return value

    @model_validator(mode="after")
    def _accounted_for(self) -> Parameter:
        if self.status == "published" and not self.source.strip():
            raise ValueError("the value is called published but names no source; add the section or table")
        if self.status != "published" and not self.reason.strip():
            raise ValueError(f"the value is called {self.status} but gives no reason; add a reason")
        if self.status == "fitted" and not self.fitted_to:
            raise ValueError('the value is called fitted but not to what; add fitted_to = ["H table 5.4"]')
        if self.status != "fitted" and self.fitted_to:
            raise ValueError(
                f"the value is called {self.status} and has fitted_to; take that out, or call it fitted"
            )
        if wrong := [name for name in self.fitted_to if not _TABLE.fullmatch(name)]:
            raise ValueError(f"{wrong[0]!r:.80} names no table; write it as 'H table 5.4'")
        return self

    @property
    def because(self) -> str:
        """Where the value comes from, in words: source, what it was fitted to, reason."""
        fitted = f"fitted to {', '.join(self.fitted_to)}" if self.fitted_to else ""
        return "; ".join(part for part in (self.source, fitted, self.reason) if part)

    @property
    def number(self) -> float:
        """The value in the unit of the file."""
        if isinstance(self.value, str):
            raise TypeError(f"{self.value!r} is not a number")
        return self.value

    @property
    def si(self) -> float:
        """The value in SI units and radians."""
        return self.number * UNITS[self.unit]

    @property
    def text(self) -> str:
        """The value as text."""
        return str(self.value)


def _fit(kind: Mapping[str, Any], parameter: Parameter) -> Parameter:
    """Refuse a value that is not of a kind."""
    value, unit = parameter.value, kind.get("unit")
    if unit is None:
        if not isinstance(value, str) or not value.strip() or parameter.unit:
            raise ValueError("this parameter is not a text; give a text and unit = ''")
        if kind["words"] and value not in kind["words"]:
            raise ValueError(f"{value!r} is not known; use one of {', '.join(kind['words'])}")
        if "moment" in kind:
            with suppress(ValueError):
                if datetime.fromisoformat(value).tzinfo is not None:
                    return parameter
            raise ValueError(f"{value!r:.80} is not a time; write it as 2018-06-01T10:00:00Z")
        return parameter
    if isinstance(value, str):
        raise ValueError(f"{value!r} is not a number; give the value in {unit or 'no unit'}")
    if parameter.unit != unit:
        raise ValueError(f"the unit is {parameter.unit!r}; convert the value and write unit = {unit!r}")
    low, above, high = (float(kind.get(name, -math.inf)) for name in ("low", "above", "high"))
    if not (low <= value <= high and value > above):
        least = f"above {above:g}" if above > low else f"from {low:g}"
        raise ValueError(f"{value:g} is out of range; give a value {least} to {high:g}")
    if kind.get("whole") and value != int(value):
        raise ValueError(f"{value:g} is not a whole number; give one")
    return parameter


class Group(Strict):
    """Parameters that belong together, as ``data/twin_parameters.toml`` has them."""

    ordered: ClassVar[Sequence[Any]] = ()
    together: ClassVar[Sequence[Any]] = ()

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    @model_validator(mode="after")
    def _agree(self) -> Group:
        for low, high, *share in self.ordered:
            if getattr(self, low).number > math.prod(share) * getattr(self, high).number:
                part = "".join(f"{one:g} of " for one in share)
                raise ValueError(f"{low} is more than {part}{high}; lower {low} or raise {high}")
        for names in self.together:
            if len({getattr(self, name) is None for name in names}) > 1:
                raise ValueError(f"{', '.join(names)} belong together; give all or none")
        return self


def _models() -> Any:
    """What a twin's file may say: a model of all groups."""
    table, groups = read_toml(DATA / "twin_parameters.toml", "the parameters of twins"), dict[str, Any]()

    def field(kind: Any) -> Any:
        named = isinstance(kind, str)
        one = groups.get(kind.rstrip("?*")) or table["kinds"][kind.rstrip("?*")] if named else kind
        if named and kind.endswith("*"):
            return GenericAlias(dict, (str, one)), Field(default_factory=dict)
        optional = kind.endswith("?") if named else "optional" in one
        model = Annotated[Parameter, AfterValidator(partial(_fit, one))] if isinstance(one, dict) else one
        return (model | None, None) if optional else (model, ...)

    for name, fields in (*table["groups"].items(), ("twin", table["twin"])):
        rules = {key.lower(): fields.pop(key, ()) for key in ("ORDERED", "TOGETHER")}
        own = {key: field(kind) for key, kind in fields.items()}
        groups[name] = create_model(name, __base__=Group, **own)
        for key, rule in rules.items():
            setattr(groups[name], key, rule)
    return groups["twin"]


_Twin = _models()

#: What happens to every twin that is loaded: `wildlab.simulation.parameters.varied` moves some parameters.
CHANGE: ContextVar[Callable[[TwinParameters], TwinParameters] | None] = ContextVar("change", default=None)


class TwinParameters(_Twin):  # type: ignore[misc, valid-type]
    """The whole of a twin's file; its groups are those of the table."""

    name: str
    section: str
    description: str
    parts: tuple[str, ...] = ()
    _moved_from: TwinParameters | None = PrivateAttr(default=None)

    @property
    def moved_from(self) -> TwinParameters | None:
        """The twin as its file has it, where this one was moved from it in memory: see `as_moved_from`."""
        return self._moved_from

    def as_moved_from(self, written: TwinParameters) -> TwinParameters:
        """The same parameters, known to be those of another twin with some of them moved.

        A course is laid, and recording begins, so that what is printed of the detections comes out with the
        other parameters as they are written. Of a flight with others that cannot be asked: it is where it was
        on its lap when recording begins, and shows its target in as many images as it does, at most in as
        many as are printed.
        """
        moved = self.model_copy()
        moved._moved_from = written.moved_from or written
        return moved

    @field_validator("enclosures")
    @classmethod
    def _safe_enclosures(cls, value: dict[str, Group]) -> dict[str, Group]:
        for name in value:
            if not is_safe_name(name):
                raise ValueError(f"{name!r:.80} cannot name an enclosure; use letters, digits, - and _ only")
        return value

    @field_validator("name")
    @classmethod
    def _safe_name(cls, value: str) -> str:
        if not is_safe_name(f"{value}-{2**63}"):  # the flight's name has the seed behind it
            raise ValueError(
                f"{value!r:.80} cannot be the name of a twin; use letters, digits, - and _ only, 80 at most"
            )
        return value

    @property
    def targets(self) -> list[Group]:
        """All targets with a description of their own, in their order; animals are in `animal_motion`."""
        return [target for target in (self.target, self.second_target) if target is not None]

    @model_validator(mode="after")
    def _possible(self) -> TwinParameters:
        for mistake in self._mistakes():
            raise ValueError(mistake)
        return self

    def _mistakes(self) -> Iterator[str]:
        """What does not go together, one after the other."""
        courses = {"loiter": self.loiter, "route": self.route, "survey": self.survey}
        if len([name for name, course in courses.items() if course is not None]) != 1:
            yield "a twin flies one course; describe one of loiter, route and survey"
        if self.loiter is not None and (self.target is None or self.target.motion is not None):
            yield "a loiter stands beside a target that never moves; describe a route"
        if self.route is None and (self.climb is not None or self.cable is not None):
            yield ("only a route changes its altitude; describe a route, or take out climb and cable")
        if self.climb is not None and self.cable is not None:
            yield "a cable has its own heights; take out climb or cable"
        if self.survey is not None and not self.enclosures:
            yield "a survey goes over enclosures, and there are none; add enclosures"
        if (self.target is None) == (self.animals is None):
            yield "a twin looks for targets or for animals; describe either target or animals"
        if self.animals is not None and not self.enclosures:
            yield "animals live in enclosures, and there are none; add enclosures"
        others = (self.second_target, self.pair, self.subset, self.segments)
        if self.target is None and any(part is not None for part in others):
            yield "second_target, pair, subset and segments go with a target; add target"
        if self.land is not None and self.animals is None:
            yield "land lies under animals; take out land, or describe animals"
        if self.land is not None and self.loiter is not None:
            yield "a loiter does not follow the ground; describe a survey or a route"
        for target in self.targets:
            if (target.motion is None) != (target.gps is None):
                yield (
                    "a target that moves needs both motion and gps, one that never moves neither; add the "
                    "one or take out the other"
                )
            if target.outline is not None and target.motion is None:
                yield "an outline needs a motion, whose course is where the bow points; add motion"
            if (target.choice.text == "largest") != (target.outline is not None):
                yield (
                    'what has an outline is marked where most of it shows; write choice = "largest" with an '
                    "outline, and only then"
                )
        names = [target.identifier.text for target in self.targets]
        if len(set(names)) < len(names):
            yield "two targets have the same identifier; give each its own"
        if (self.second_target is None) != (self.pair is None):
            yield "two targets need pair.both, one does not; add the one or take out the other"
        if self.pair and self.pair.both.number > min(target.observations.number for target in self.targets):
            yield "pair.both is more than the observations of a target; lower pair.both"
        wanted = sum(int(target.observations.number) for target in self.targets)
        if self.subset and self.subset.first.number + self.subset.observations.number - 1 > wanted:
            yield (
                f"the subset ends behind the last of {wanted} detections; lower subset.first or "
                "subset.observations"
            )
        outlined = self.target is not None and self.target.outline is not None
        if self.pair is not None and any(target.outline is not None for target in self.targets):
            yield "of two targets none can have an outline; take out the outline"
        if (self.segments is not None) != outlined:
            yield "a target with an outline needs segments, any other none; add or take out one"
        if self.segments and self.target and self.segments.images.number < self.target.observations.number:
            yield (
                "there are fewer images in the segments than observations of the target; "
                "lower target.observations"
            )
        if outlined and self.camera.k1 is not None:
            yield "an outline stays straight only in a camera without k1; take out camera.k1"
        if len({part is None for part in (self.imu, self.gnss, self.boresight)}) > 1:
            yield "imu, gnss and boresight describe one payload; give all or none"
        by_computer = self.camera.stamped_by is not None and self.camera.stamped_by.text == "computer"
        if by_computer and self.onboard_clock is None:
            yield "the computer stamps the images, and its clock is missing; add onboard_clock"
        end = self.camera.recording_start.si + (self.camera.images.si - 1) / self.camera.frame_rate.si
        if end > self.flight.duration.si:
            yield (
                f"the camera would record until {end:.0f} s, after the flight's end; lower camera.images or "
                "camera.recording_start"
            )


def twin_names() -> list[str]:
    """Names of the twins that come with wildlab.

    Returns
    -------
    list of str
        In alphabetical order.
    """
    return sorted(path.stem for path in TWINS.glob("*.toml"))


def load_twin(name_or_path: str | Path) -> TwinParameters:
    """Parameters of a twin, by its name among those that come with wildlab, or from a file.

    Parameters
    ----------
    name_or_path
        A text of at most 100 letters, digits, ``-`` and ``_`` that begins with a letter or a digit is a name;
        any other text, and every ``Path``, is a TOML file like those in ``data/twins``.

    Returns
    -------
    TwinParameters

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
    twin = check_model(TwinParameters, _with_parts(read_toml(path, "the parameters of a twin"), path), path)
    change = CHANGE.get()
    return twin if change is None else change(twin)


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
            filled[group] = _merged(filled.get(group), content)
    return filled


def _merged(below: Any, above: Any) -> Any:
    """Groups within groups are filled in; a parameter is taken as a whole, never half and half."""
    if not (isinstance(below, dict) and isinstance(above, dict)) or "value" in above:
        return above
    return {**below, **{name: _merged(below.get(name), content) for name, content in above.items()}}


def each_parameter(twin: TwinParameters) -> Iterator[tuple[str, str, Parameter]]:
    """Group (``"target.motion"`` within another), name and parameter, in the order of the model."""
    for group in type(twin).model_fields:
        part = getattr(twin, group)
        if isinstance(part, Strict):
            yield from _each(group, part)
        elif isinstance(part, dict):
            for name, content in part.items():
                yield from _each(f"{group}.{name}", content)


def _each(group: str, part: Strict) -> Iterator[tuple[str, str, Parameter]]:
    for name in type(part).model_fields:
        value = getattr(part, name)
        if isinstance(value, Parameter):
            yield group, name, value
        elif isinstance(value, Strict):
            yield from _each(f"{group}.{name}", value)


def parameters_table(twin: TwinParameters | str | Path) -> pd.DataFrame:
    """Every parameter of a twin, for a report.

    Parameters
    ----------
    twin
        Its parameters, or its name or file as for :func:`load_twin`.

    Returns
    -------
    pandas.DataFrame
        One row per parameter. Columns, all of them text: ``parameter``, ``value``, ``unit``, ``status``
        (published, chosen or fitted) and ``because`` (the source, what it was fitted to, and the reason,
        where there are any).

    Raises
    ------
    WildlabError
        As :func:`load_twin`, where it is given a name or a file.
    """
    parameters = twin if isinstance(twin, TwinParameters) else load_twin(twin)
    return pd.DataFrame(
        [
            {
                "parameter": f"{group}: {name}".replace("_", " ").replace(".", ", "),
                "value": p.value if isinstance(p.value, str) else f"{p.value:.10g}",
                "unit": "" if p.unit == "1" else p.unit,
                "status": p.status,
                "because": p.because,
            }
            for group, name, p in each_parameter(parameters)
        ],
        columns=["parameter", "value", "unit", "status", "because"],
    )


def status_words(table: pd.DataFrame) -> str:
    """What of a twin's parameters was published, chosen and fitted, in words.

    Parameters
    ----------
    table
        As :func:`parameters_table` gives it.

    Returns
    -------
    str

    Examples
    --------
    >>> status_words(pd.DataFrame({"status": ["chosen", "published", "chosen"]}))
    '3 parameters: 1 published, 2 chosen'
    """
    counts = table["status"].value_counts()
    said = [f"{counts[status]} {status}" for status in ("published", "chosen", "fitted") if status in counts]
    return f"{len(table)} parameters: {', '.join(said)}"


def fitted_to(twin: TwinParameters | str | Path) -> tuple[str, ...]:
    """The published tables that any parameter of a twin was fitted to, sorted: they do not test the twin.

    Parameters
    ----------
    twin
        Its parameters, or its name or file as for :func:`load_twin`.

    Returns
    -------
    tuple of str
        As published numbers name their sources: ``"H table 5.4"``.

    Raises
    ------
    WildlabError
        As :func:`load_twin`, where it is given a name or a file.
    """
    parameters = twin if isinstance(twin, TwinParameters) else load_twin(twin)
    return tuple(sorted({table for *_, p in each_parameter(parameters) for table in p.fitted_to}))


#: What filters are told of a twin's sensors: their tuning, not the flight.
TOLD = ("assumed",)
#: Kinds of parameters that mean something at half or twice their size, by how their names end.
_KINDS = (
    ("errors", re.compile(r"(\w+_)?(sd|noise|bias|latency)")),
    ("durations", re.compile(r"\w+_(period|time)")),
    ("share", re.compile(r"(\w+_)?share")),
    ("{name}", re.compile(r"(\w+_)?(speed|airspeed|radius)")),
)


def groups_of(twin: TwinParameters) -> dict[str, tuple[str, ...]]:
    """Parameters of a twin that are not published and can be moved, those of one kind in a part together.

    Parameters
    ----------
    twin
        As `load_twin` gives it.

    Returns
    -------
    dict
        By the group's name (``"boresight: errors"``) the parameters' names (``"boresight.roll_sd"``).

    Examples
    --------
    >>> from wildlab.simulation.parameters import load_twin
    >>> groups_of(load_twin("fast-vessel"))["flight: wind speed"]
    ('flight.wind_speed',)
    """
    found: dict[str, tuple[str, ...]] = {}
    for part, name, parameter in each_parameter(twin):
        if parameter.status == "published" or part in TOLD or isinstance(parameter.value, str):
            continue
        kind = next((word for word, pattern in _KINDS if pattern.fullmatch(name)), None)
        if kind is None or parameter.value == 0:
            continue
        group = f"{part}: {kind.format(name=name)}".replace("_", " ").replace(".", ", ")
        found[group] = (*found.get(group, ()), f"{part}.{name}")
    return found


@contextmanager
def varied(factors: Mapping[str, float]) -> Iterator[None]:
    """Within it, every twin that is loaded has these parameters multiplied.

    Parameters
    ----------
    factors
        By the parameter's name, ``"flight.wind_speed"``; one that a twin has not is left out there.

    Raises
    ------
    WildlabError
        Where a parameter is published, no number, or none that can be moved; when a twin is loaded.
    """
    token = CHANGE.set(partial(apply, factors=dict(factors)) if factors else None)
    try:
        yield
    finally:
        CHANGE.reset(token)


def apply(twin: TwinParameters, factors: Mapping[str, float]) -> TwinParameters:
    """A twin with some of its parameters multiplied.

    Parameters
    ----------
    factors
        As for `varied`.

    Returns
    -------
    TwinParameters
        Checked anew: what the moved parameters do not allow is an error.

    Raises
    ------
    WildlabError
        As `varied`, or where the twin is not possible any more.
    """
    movable = {name for names in groups_of(twin).values() for name in names}
    there = {f"{part}.{name}" for part, name, _ in each_parameter(twin)}
    for path in factors:
        if path in there and path not in movable:
            raise WildlabError(
                f"the parameter {path!r} of the twin {twin.name!r} is published, or cannot be scaled",
                f"move one of: {', '.join(sorted(movable))}",
            )
    return scaled(twin, {path: factor for path, factor in factors.items() if path in there})


def scaled(twin: TwinParameters, factors: Mapping[str, float]) -> TwinParameters:
    """A twin with some of its numbers multiplied, published ones as well: to see what its flight stands.

    Parameters
    ----------
    factors
        As for `varied`; every parameter must be there.

    Returns
    -------
    TwinParameters
        Checked anew, and known to be moved: see `TwinParameters.as_moved_from`.

    Raises
    ------
    WildlabError
        Where the twin is not possible any more.
    KeyError
        Where it has no such parameter.
    """
    if not factors:
        return twin
    content = twin.model_dump(exclude_unset=True)
    for path, factor in factors.items():
        part = content
        *parts, name = path.split(".")
        for one in parts:
            part = part[one]
        part[name]["value"] *= factor
    try:
        return type(twin).model_validate(content).as_moved_from(twin)
    except ValueError as error:
        raise WildlabError(
            f"with {', '.join(f'{path} x {factor:g}' for path, factor in factors.items())} the twin "
            f"{twin.name!r} is not possible ({str(error).splitlines()[-2].strip()})",
            "move it less",
        ) from error
