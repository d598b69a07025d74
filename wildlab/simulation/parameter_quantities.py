"""Numbers that say where they come from: a value, its unit, and on whose word.

A parameter is a table with a value, a unit and a status: ``published`` with its source, ``chosen`` with the
reason, or ``fitted`` with the reason and the published tables that it was fitted to. What those tables say
is then no test of the twin. The unit is part of the check: a length in feet is an error, not a surprise.
"""

from __future__ import annotations

import math
import re
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, field_validator, model_validator

from wildlab.flight.files import Strict
from wildlab.geometry.gravity import STANDARD_GRAVITY

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


def quantity(
    unit: str,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: float = -math.inf,
    whole: bool = False,
) -> AfterValidator:
    """A parameter that is a number in that unit, between ``low`` and ``high`` and greater than ``above``."""

    def check(parameter: Parameter) -> Parameter:
        if isinstance(parameter.value, str):
            raise ValueError(f"{parameter.value!r} is not a number; give the value in {unit or 'no unit'}")
        if parameter.unit != unit:
            raise ValueError(f"the unit is {parameter.unit!r}; convert the value and write unit = {unit!r}")
        if not (low <= parameter.value <= high and parameter.value > above):
            least = f"above {above:g}" if above > low else f"from {low:g}"
            raise ValueError(f"{parameter.value:g} is out of range; give a value {least} to {high:g}")
        if whole and parameter.value != int(parameter.value):
            raise ValueError(f"{parameter.value:g} is not a whole number; give one")
        return parameter

    return AfterValidator(check)


def word(*allowed: str) -> AfterValidator:
    """A parameter that is a text, one of those allowed where any are named."""

    def check(parameter: Parameter) -> Parameter:
        if not isinstance(parameter.value, str) or not parameter.value.strip() or parameter.unit:
            raise ValueError("this parameter is not a text; give a text and unit = ''")
        if allowed and parameter.value not in allowed:
            raise ValueError(f"{parameter.value!r} is not known; use one of {', '.join(allowed)}")
        return parameter

    return AfterValidator(check)


def moment() -> AfterValidator:
    """A parameter that is a time with its zone, as text."""

    def check(parameter: Parameter) -> Parameter:
        try:
            zone = datetime.fromisoformat(parameter.text).tzinfo
        except ValueError:
            zone = None
        if zone is None or parameter.unit:
            raise ValueError(
                f"{parameter.text!r:.80} is not a time; write it as 2018-06-01T10:00:00Z, with unit = ''"
            )
        return parameter

    return AfterValidator(check)


# Upper bounds keep a mistyped file from asking for a flight of days.
Text = Annotated[Parameter, word()]
Angle = Annotated[Parameter, quantity("deg", -360, 360)]
AngleSpread = Annotated[Parameter, quantity("deg", 0, 45)]
Length = Annotated[Parameter, quantity("m", high=1e5, above=0)]
LengthSpread = Annotated[Parameter, quantity("m", 0, 1e4)]
Speed = Annotated[Parameter, quantity("m/s", 0, 100)]
Duration = Annotated[Parameter, quantity("s", high=7200, above=0)]
Rate = Annotated[Parameter, quantity("Hz", high=500, above=0)]
Pixels = Annotated[Parameter, quantity("px", 0, 1e6)]
PixelCount = Annotated[Parameter, quantity("px", high=1e5, above=0, whole=True)]
FocalLength = Annotated[Parameter, quantity("px", high=1e6, above=0)]
Count = Annotated[Parameter, quantity("1", 1, 1e6, whole=True)]
