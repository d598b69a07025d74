"""A flight over areas, planned: way points for the pilot, and a page about it."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wildlab.commands import shared
from wildlab.commands.shared import (
    FILE,
    FOLDER,
    pair,
    print_json,
    shown,
    terminal_console,
    terrain_of,
    terrain_options,
)
from wildlab.errors import WildlabError
from wildlab.paths import DATA

if TYPE_CHECKING:
    from wildlab.geometry.camera import Camera


def _numbers(command: Callable[..., Any]) -> Callable[..., Any]:
    for one in reversed(tomllib.loads((DATA / "plan.toml").read_text("utf-8"))["number"]):
        value = one.get("default")
        option = click.option(
            one["option"], one["field"], type=float, default=value, show_default=bool(value), help=one["help"]
        )
        command = option(command)
    return command


@click.command()
@click.argument("area", type=FILE)
@shared.out(FOLDER, "Folder for way points, maps and the page.", required=True)
@click.option("--camera", type=FILE, help="What `wildlab camera` wrote.")
@click.option("--image", type=pair(int, "xX×", "640x512"), metavar="CxR", help="Without it: columns x rows.")
@click.option("--focal", type=float, help="With --image: focal length, px.")
@click.option("--view", type=float, help="Or field of view across, deg.")
@click.option("--terrain", type=FILE, help="Map of heights: they follow it, and it hides.")
@terrain_options("--terrain-", "crs", "unit", "nodata", "cell", "corner")
@_numbers
@click.option(
    "--gimbal",
    type=click.Choice(["fixed", "yaw", "roll", "adaptive"]),
    default="fixed",
    show_default=True,
    help="How the camera swings; adaptive keeps to the areas (F 5.4).",
)
@click.option(
    "--home", type=pair(float, ",; ", "58.66,16.46"), metavar="LAT,LON", help="Take-off.  [default: row 1]"
)
@click.option(
    "--above",
    "heights",
    type=click.Choice(["take-off", "ground"]),
    default="take-off",
    show_default=True,
    help="What heights count from; ground needs the autopilot's own map.",
)
@click.option("--names", is_flag=True, help="Let the page tell the names of areas and of the map.")
@click.option("--exact", is_flag=True, help="Let the page tell where on the Earth this is.")
@shared.overwrite
@shared.as_json
def plan(
    area: Path,
    out: Path,
    camera: Path | None,
    image: tuple[int, int] | None,
    focal: float | None,
    view: float | None,
    terrain: Path | None,
    names: bool,
    exact: bool,
    overwrite: bool,
    as_json: bool,
    **asked: Any,
) -> None:
    """Plan a search flight over AREA, in rows.

    AREA is a GeoJSON or KML file of polygons. Leaves for each flight a .waypoints (Mission Planner) and a
    .plan (QGroundControl), for all of them plan.geojson and plan.kml, and report.html. All but the page hold
    exact positions: keep them to the pilot.

    \b
    Examples:
      wildlab plan fence.geojson --camera camera.toml --out flight
      wildlab plan fence.geojson --image 640x512 --view 32 --height 60 --battery 25 --out flight
      wildlab plan fence.geojson --camera camera.toml --terrain dem.tif --animals 5 --out flight
      wildlab plan fence.kml --camera camera.toml --turn-radius 40 --wind 6 --wind-from 270 --out flight
    """
    from wildlab.analysis.plan_request import PlanRequest
    from wildlab.analysis.plan_result import PAGE, RESULT, plan_flight
    from wildlab.files import write_atomic, write_json

    stated = {name: asked.pop(name) for name in list(asked) if name.startswith("terrain_")}
    says = terrain_of(terrain, stated, "--terrain-")
    of = lens(camera, image, focal, view)
    request = PlanRequest(area, of, says, names=names or exact, **asked)
    made, covered, result = plan_flight(request, out, terminal_console(), overwrite=overwrite)
    # What makes pages takes seconds to be imported: what is wrong has been said by now.
    from wildlab.reporting.plan import plan_page, with_words

    result = with_words(result)
    write_json(out / RESULT, result)

    write_atomic(out / PAGE, plan_page(made, covered, result, exact=exact))
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
    click.echo(shown(out / PAGE))


def lens(
    camera: Path | None, image: tuple[int, int] | None, focal: float | None, view: float | None
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
    from wildlab.flight.calibration_files import read_camera
    from wildlab.geometry.camera import Camera

    if camera is not None:
        if image is not None or focal is not None or view is not None:
            raise WildlabError(
                "the camera is described twice", "give --camera, or --image and a focal length"
            )
        c = read_camera(camera).camera
        refuse_view(c.width_px, c.fx_px, camera, "fx_px")
        bends = (c.k1, c.k2, c.p1, c.p2, c.k3)
        return Camera(c.width_px, c.height_px, c.fx_px, c.fy_px, c.cx_px, c.cy_px, c.skew_px, bends)
    if image is None or (focal is None) == (view is None):
        raise WildlabError(
            "nothing says what the camera sees",
            "give --camera FILE, or --image COLUMNSxROWS with either --focal or --view",
        )
    columns, rows = image
    if not (2 <= columns <= 100_000 and 2 <= rows <= 100_000):
        problem = f"an image of {columns} x {rows} pixels"
        raise WildlabError(problem, "give it as 640x512", field="--image")
    if focal is None:
        if not LEAST_VIEW <= (view or 0) <= MOST_VIEW:
            problem = f"a field of view of {view:g} degrees"
            raise WildlabError(problem, f"give one from {LEAST_VIEW} to {MOST_VIEW}", field="--view")
        focal = columns / 2 / math.tan(math.radians(view or 0) / 2)
    refuse_view(columns, focal, None, "--focal")
    return Camera(columns, rows, focal, focal, columns / 2, rows / 2)


#: Degrees across an image.
LEAST_VIEW, MOST_VIEW = 1, 150


def refuse_view(columns: float, focal: float, file: Path | None, field: str) -> None:
    """Refuse a focal length that no lens has: it is in another unit, or of another image."""
    across = math.degrees(2 * math.atan2(columns / 2, focal))
    if not 0.999 * LEAST_VIEW <= across <= 1.001 * MOST_VIEW:
        raise WildlabError(
            f"a focal length of {focal:g} px sees {across:.3g} degrees across {columns:g} px",
            "give it in pixels: that in mm, times the columns, over the width of the sensor in mm",
            file=file,
            field=field,
        )
