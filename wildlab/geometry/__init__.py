"""Geometry of a flying camera: frames, camera, mount, pixel <-> ground with uncertainty, and calibration.

Stands on the ground: imports nothing else of wildlab but its errors. Sections and equations are those of the
theses: H is Helgesen (2019), who tracks vessels with the camera of an unmanned aircraft; F is Flodell and
Christensson (2016), who look for animals with one. Where a print has a slip, the function says so.

Arrays in, arrays out, one row per item, SI units and radians, pixels for what is in the image; a single value
may stand for all rows. What cannot be had (a ray over the horizon, a point behind the camera) is NaN in its
row. Frames as in H 5.2.2: ``n`` north-east-down with a fixed origin, ``b`` body (x forward, y right, z down),
``m`` mount, ``c`` camera (x right in the image, y down in the image, z out of the lens), ``e`` ECEF. ``R_nb``
takes a vector from b to n; ``p_nc`` is the position of c relative to n, in n.

`CameraPoses` brings a camera, its mount and N poses of the airframe together, and most else takes it:

>>> import numpy as np
>>> from wildlab.geometry import Camera, CameraPoses, Mount, euler_to_matrix, georeference_pixels
>>> camera = Camera(640, 512, fx=1000.0, fy=1000.0, cx=320.0, cy=256.0)
>>> R_nb = euler_to_matrix(0.0, np.radians([-45.0, -30.0]), 0.0)
>>> poses = CameraPoses(camera, Mount("forward"), np.array([0.0, 0.0, -100.0]), R_nb)
>>> print(np.round(georeference_pixels(poses, np.tile([320.0, 256.0], (2, 1)), plane_down=0.0), 1))
[[100.    0.    0. ]
 [173.2   0.    0. ]]
"""

from typing import TYPE_CHECKING

from wildlab.lazy import offer

if TYPE_CHECKING:
    from wildlab.geometry.attitude_uncertainty import (
        attitude_covariance,
        level_axes,
        pose_covariance,
        tilt_and_heading,
        tilt_from_roll_pitch,
    )
    from wildlab.geometry.calibration import (
        Fit,
        Mounting,
        calibrate,
        fit_points,
        mounting_from_points,
        undetermined_parameter,
        with_covariance,
    )
    from wildlab.geometry.camera import (
        NO_DISTORTION,
        Camera,
        camera_from_data_sheet,
        distort,
        distortion_jacobian,
        in_image,
        normalise,
        normalise_jacobian,
        project,
        undistort,
        undistort_approximately,
    )
    from wildlab.geometry.camera_poses import CameraPoses
    from wildlab.geometry.corrections import (
        BORESIGHT,
        BOUNDS,
        PARAMETERS,
        Calibration,
        PosesAt,
        apply_calibration,
        calibrated_camera,
        calibrated_poses,
        calibration_jacobian,
        georeference_calibrated,
    )
    from wildlab.geometry.covariances import ellipse_axes, inside_ellipse
    from wildlab.geometry.flodell import geodetic_to_enu_linear, linear_enu_error, metres_per_degree
    from wildlab.geometry.flow import (
        CameraMotion,
        Twist,
        camera_flow,
        camera_rates,
        camera_twist,
        flow_between,
        flow_matrix,
        gimbal_axes,
        lens_velocity,
        motion_between,
        target_velocity,
    )
    from wildlab.geometry.flow_uncertainty import (
        FlowErrors,
        FlowJacobians,
        Velocity,
        flow_jacobians,
        mean_velocity,
        velocity_covariance,
    )
    from wildlab.geometry.frames import (
        Array,
        Origin,
        ecef_to_geodetic,
        enu_to_ned,
        euler_to_matrix,
        geodetic_to_ecef,
        geodetic_to_ned,
        matrix_to_euler,
        matrix_to_quaternion,
        matrix_to_rotation_vector,
        ned_to_enu,
        ned_to_geodetic,
        quaternion_to_matrix,
        rotation_vector_to_matrix,
        skew,
        wrap,
    )
    from wildlab.geometry.georeference import (
        RAY_STATUS,
        georeference_pixels,
        ground_to_pixel,
        intersect_plane,
        pixel_rays,
        pixel_to_plane,
    )
    from wildlab.geometry.gravity import (
        EARTH_RATE,
        Earth,
        attraction,
        flat_earth,
        local_earth,
        normal_gravity,
    )
    from wildlab.geometry.intrinsics import (
        LENSES,
        PINHOLE,
        Intrinsics,
        LensChoice,
        Views,
        calibrate_camera,
        choose_lens,
        parameters_of,
        project_board,
        view_errors,
    )
    from wildlab.geometry.line_of_sight import (
        Looked,
        cast_rays,
        compare_angles,
        field_of_view,
        in_field_of_view,
    )
    from wildlab.geometry.mount import (
        Mount,
        camera_pose,
        camera_rotation,
        helgesen_misalignment,
        mount_rotation,
    )
    from wildlab.geometry.robust import (
        fit_linear,
        student_cost,
        student_scale,
    )
    from wildlab.geometry.terrain import (
        Met,
        Terrain,
        intersect_terrain,
        pixels_to_terrain,
    )
    from wildlab.geometry.uncertainty import (
        GroundCovariance,
        GroundJacobians,
        PoseErrors,
        arc_bend,
        ground_covariance,
        ground_jacobians,
        ray_flatness,
        ray_heading_sd,
        sample_ground,
        sample_rays,
        sample_terrain,
        terrain_covariance,
        terrain_jacobians,
    )
    from wildlab.geometry.viewsheds import (
        Footprint,
        footprint,
        image_border,
        lines_clear,
        widest_view,
    )
else:
    __getattr__, __dir__ = offer(__name__)

__all__ = [
    "BORESIGHT",
    "BOUNDS",
    "EARTH_RATE",
    "LENSES",
    "NO_DISTORTION",
    "PARAMETERS",
    "PINHOLE",
    "RAY_STATUS",
    "Array",
    "Calibration",
    "Camera",
    "CameraMotion",
    "CameraPoses",
    "Earth",
    "Fit",
    "FlowErrors",
    "FlowJacobians",
    "Footprint",
    "GroundCovariance",
    "GroundJacobians",
    "Intrinsics",
    "LensChoice",
    "Looked",
    "Met",
    "Mount",
    "Mounting",
    "Origin",
    "PoseErrors",
    "PosesAt",
    "Terrain",
    "Twist",
    "Velocity",
    "Views",
    "apply_calibration",
    "arc_bend",
    "attitude_covariance",
    "attraction",
    "calibrate",
    "calibrate_camera",
    "calibrated_camera",
    "calibrated_poses",
    "calibration_jacobian",
    "camera_flow",
    "camera_from_data_sheet",
    "camera_pose",
    "camera_rates",
    "camera_rotation",
    "camera_twist",
    "cast_rays",
    "choose_lens",
    "compare_angles",
    "distort",
    "distortion_jacobian",
    "ecef_to_geodetic",
    "ellipse_axes",
    "enu_to_ned",
    "euler_to_matrix",
    "field_of_view",
    "fit_linear",
    "fit_points",
    "flat_earth",
    "flow_between",
    "flow_jacobians",
    "flow_matrix",
    "footprint",
    "geodetic_to_ecef",
    "geodetic_to_enu_linear",
    "geodetic_to_ned",
    "georeference_calibrated",
    "georeference_pixels",
    "gimbal_axes",
    "ground_covariance",
    "ground_jacobians",
    "ground_to_pixel",
    "helgesen_misalignment",
    "image_border",
    "in_field_of_view",
    "in_image",
    "inside_ellipse",
    "intersect_plane",
    "intersect_terrain",
    "lens_velocity",
    "level_axes",
    "linear_enu_error",
    "lines_clear",
    "local_earth",
    "matrix_to_euler",
    "matrix_to_quaternion",
    "matrix_to_rotation_vector",
    "mean_velocity",
    "metres_per_degree",
    "motion_between",
    "mount_rotation",
    "mounting_from_points",
    "ned_to_enu",
    "ned_to_geodetic",
    "normal_gravity",
    "normalise",
    "normalise_jacobian",
    "parameters_of",
    "pixel_rays",
    "pixel_to_plane",
    "pixels_to_terrain",
    "pose_covariance",
    "project",
    "project_board",
    "quaternion_to_matrix",
    "ray_flatness",
    "ray_heading_sd",
    "rotation_vector_to_matrix",
    "sample_ground",
    "sample_rays",
    "sample_terrain",
    "skew",
    "student_cost",
    "student_scale",
    "target_velocity",
    "terrain_covariance",
    "terrain_jacobians",
    "tilt_and_heading",
    "tilt_from_roll_pitch",
    "undetermined_parameter",
    "undistort",
    "undistort_approximately",
    "velocity_covariance",
    "view_errors",
    "widest_view",
    "with_covariance",
    "wrap",
]
