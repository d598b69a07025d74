"""A flight over areas, planned: way points for the pilot, and a page about it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from wildlab.commands.shared import FILE, FOLDER, terminal_console
from wildlab.commands.terrain import says_of, terrain_options
from wildlab.errors import WildlabError
from wildlab.terminal import print_json, shown

if TYPE_CHECKING:
    from wildlab.analysis.plans.wanted import Gimbal
    from wildlab.geometry.camera import Camera


class TwoNumbers(click.ParamType[tuple[float, float]]):
    """Two numbers with something between them: 640x512, or 58.66,16.46."""

    name = "A,B"

    def __init__(self, between: str, example: str) -> None:
        self.between, self.example = between, example

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        parts = re.split(rf"\s*[{self.between}]\s*", str(value).strip())
        try:
            one, other = (float(part) for part in parts)
        except ValueError:
            self.fail(f"{value!r} is not two numbers: write {self.example}.")
        return one, other


@click.command(short_help="Plan a search flight: way points, times, and what speaks against it.")
@click.argument("area", type=FILE)
@click.option("--camera", type=FILE, help="What `wildlab camera` wrote.")
@click.option(
    "--image", type=TwoNumbers("xX×", "640x512"), help="Without --camera: columns x rows of the image."
)
@click.option("--focal", type=float, help="With --image: focal length, px.")
@click.option("--view", type=float, help="With --image, in place of --focal: field of view across, deg.")
@click.option("--terrain", type=FILE, help="Map of heights (GeoTIFF): heights follow it, and it hides.")
@terrain_options("--terrain-", "crs", "unit", "nodata", "cell", "corner")
@click.option("--trees", type=float, default=0.0, help="Height of the tallest trees, m: fly above them.")
@click.option("--into", type=FOLDER, required=True, help="Folder for way points, maps and the page.")
@click.option("--height", type=float, help="Above the ground, m.  [default: from --animal and --pixels]")
@click.option("--animal", type=float, default=1.5, show_default=True, help="Length of what is looked for, m.")
@click.option("--pixels", type=float, default=10.0, show_default=True, help="Across how many it shall be.")
@click.option(
    "--speed",
    type=float,
    default=10.0,
    show_default=True,
    help="Over ground; with --turn-radius through air, m/s.",
)
@click.option("--max-airspeed", type=float, help="What a multicopter can do through the air, m/s.")
@click.option("--overlap", type=float, default=0.2, show_default=True, help="Of neighbouring rows, a share.")
@click.option(
    "--tilt", type=float, default=90.0, show_default=True, help="Camera below the horizon, deg; 90 is down."
)
@click.option(
    "--gimbal",
    type=click.Choice(["fixed", "yaw", "roll", "adaptive"]),
    default="fixed",
    show_default=True,
    help="How the camera swings to either side; adaptive keeps to the areas (F 5.4).",
)
@click.option("--swing", type=float, default=0.0, help="How far to either side, deg.")
@click.option("--rate", type=float, help="How fast, deg/s.  [default: no faster than leaves nothing out]")
@click.option("--exposure", type=float, default=10.0, show_default=True, help="Of an image, ms.")
@click.option(
    "--direction", type=float, help="Of the rows, deg clockwise from north.  [default: quickest edge]"
)
@click.option("--wind", type=float, default=0.0, help="Its speed, m/s.")
@click.option("--wind-from", type=float, help="From where, deg clockwise from north.")
@click.option(
    "--turn-radius", type=float, default=0.0, help="Of an aircraft that cannot stop, m.  [default: it can]"
)
@click.option("--turn-time", type=float, default=3.0, show_default=True, help="Of one that stops to turn, s.")
@click.option("--climb", type=float, default=3.0, show_default=True, help="Climbing or sinking at most, m/s.")
@click.option(
    "--battery", type=float, help="How long it lasts, minutes: longer plans become several flights."
)
@click.option("--reserve", type=float, default=0.2, show_default=True, help="Share left at landing.")
@click.option(
    "--max-height", type=float, default=120.0, show_default=True, help="Above the ground by the rules, m."
)
@click.option(
    "--home", type=TwoNumbers(",; ", "58.66,16.46"), help="Take-off: latitude,longitude.  [default: row 1]"
)
@click.option("--animals", type=float, help="How many live in each area that does not say itself.")
@click.option("--density", type=float, help="Or how many on a square kilometre.")
@click.option(
    "--detection", type=float, default=1.0, show_default=True, help="Share of animals in view that are found."
)
@click.option("--photo-every", type=float, default=0.0, help="Trigger the camera each so many metres.")
@click.option(
    "--above",
    type=click.Choice(["take-off", "ground"]),
    default="take-off",
    show_default=True,
    help="Above what the autopilot keeps its heights; ground needs its own map.",
)
@click.option("--names", is_flag=True, help="Let the page tell the names of areas and of the map.")
@click.option("--exact", is_flag=True, help="Let the page tell where on the Earth this is.")
@click.option("--overwrite", is_flag=True, help="Replace the plan that is there.")
@click.option("--json", "as_json", is_flag=True, help="What came out, as JSON.")
def plan(
    area: Path,
    camera: Path | None,
    image: tuple[float, float] | None,
    focal: float | None,
    view: float | None,
    terrain: Path | None,
    trees: float,
    into: Path,
    height: float | None,
    animal: float,
    pixels: float,
    speed: float,
    max_airspeed: float | None,
    overlap: float,
    tilt: float,
    gimbal: Gimbal,
    swing: float,
    rate: float | None,
    exposure: float,
    direction: float | None,
    wind: float,
    wind_from: float | None,
    turn_radius: float,
    turn_time: float,
    climb: float,
    battery: float | None,
    reserve: float,
    max_height: float,
    animals: float | None,
    density: float | None,
    detection: float,
    home: tuple[float, float] | None,
    photo_every: float,
    above: Literal["take-off", "ground"],
    names: bool,
    exact: bool,
    overwrite: bool,
    as_json: bool,
    **stated: Any,
) -> None:
    """Plan a flight that searches AREA, a GeoJSON or KML file of polygons, in rows.

    Leaves for each flight a .waypoints (Mission Planner) and a .plan (QGroundControl), for all of them
    plan.geojson and plan.kml, and report.html. All but the page hold exact positions: keep them to the pilot.

    \b
    Examples:
      wildlab plan fence.geojson --camera camera.toml --into flight
      wildlab plan fence.geojson --image 640x512 --view 32 --height 60 --battery 25 --into flight
      wildlab plan fence.geojson --camera camera.toml --terrain dem.tif --animals 5 --into flight
      wildlab plan fence.kml --camera camera.toml --turn-radius 40 --wind 6 --wind-from 270 --into flight
    """
    from wildlab.analysis.plans.command import PAGE, plan_flight
    from wildlab.analysis.plans.wanted import Wanted
    from wildlab.files import write_atomic

    wanted = Wanted(
        area,
        lens(camera, image, focal, view),
        says_of(terrain, stated, "--terrain-"),
        trees,
        height_m=height,
        animal_m=animal,
        pixels=pixels,
        speed_m_s=speed,
        max_air_m_s=max_airspeed,
        overlap=overlap,
        tilt_deg=tilt,
        gimbal=gimbal,
        swing_deg=swing,
        rate_deg_s=rate,
        exposure_s=exposure / 1000,
        wind_m_s=wind,
        wind_from_deg=wind_from,
        turn_radius_m=turn_radius,
        turn_s=turn_time,
        climb_m_s=climb,
        battery_min=battery,
        reserve=reserve,
        max_height_m=max_height,
        direction_deg=direction,
        home=home,
        animals=animals,
        density_km2=density,
        detection=detection,
        heights=above,
        photo_m=photo_every,
        names=names or exact,
    )
    made, covered, result = plan_flight(wanted, into, terminal_console(), overwrite=overwrite)
    # What makes pages takes seconds to be imported: what is wrong has been said by now.
    from wildlab.reporting.plan import plan_page

    write_atomic(into / PAGE, plan_page(made, covered, result, exact=exact))
    if as_json:
        print_json(result)
        return
    for line in result["sentences"]:
        click.echo(line)
    for line in result["warnings"]:
        click.echo(f"warning: {line}", err=True)
    places = [*result["places"], *([PAGE] if exact else [])]
    click.echo(f"Exact positions are in {', '.join(places)}: keep these to the pilot.", err=True)
    if not exact:
        told = "metres, and the names that you let it tell" if names else "metres only"
        click.echo(f"{PAGE} has {told}, and no position.", err=True)
    click.echo(shown(into / PAGE))


def lens(
    camera: Path | None, image: tuple[float, float] | None, focal: float | None, view: float | None
) -> Camera:
    """The camera, from its file or from what its sheet says.

    Parameters
    ----------
    camera
        What `wildlab camera` wrote.
    image
        Columns and rows, px.
    focal, view
        Focal length in px, or field of view across the image in degrees.

    Returns
    -------
    Camera

    Raises
    ------
    WildlabError
        Where nothing or too much is said, or it is no camera.
    """
    import math

    from wildlab.flight.calibration_files import read_camera
    from wildlab.geometry.camera import Camera

    if camera is not None:
        if image is not None or focal is not None or view is not None:
            raise WildlabError(
                "the camera is described twice", "give --camera alone, or --image with --focal or --view"
            )
        found = read_camera(camera).camera
        return Camera(
            found.width_px,
            found.height_px,
            found.fx_px,
            found.fy_px,
            found.cx_px,
            found.cy_px,
            found.skew_px,
            (found.k1, found.k2, found.p1, found.p2, found.k3),
        )
    if image is None or (focal is None) == (view is None):
        raise WildlabError(
            "nothing says what the camera sees",
            "give --camera FILE, or --image COLUMNSxROWS with either --focal or --view",
        )
    columns, rows = image
    if not (2 <= columns <= 100_000 and 2 <= rows <= 100_000 and columns % 1 == 0 and rows % 1 == 0):
        raise WildlabError(
            f"an image of {columns:g} x {rows:g} pixels", "give whole numbers, as 640x512", field="--image"
        )
    if view is not None:
        if not 1 <= view <= 170:
            raise WildlabError(
                f"a field of view of {view:g} degrees", "give one from 1 to 170", field="--view"
            )
        length = columns / 2 / math.tan(math.radians(view) / 2)
    else:
        length = math.nan if focal is None else focal
    if not 1 <= length <= 1e6:
        raise WildlabError(f"a focal length of {length:g} px", "give pixels above 1", field="--focal")
    return Camera(int(columns), int(rows), length, length, columns / 2, rows / 2)
