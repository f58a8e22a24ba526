import numpy as np
import pytest
from pyproj import Transformer
from scipy.spatial.transform import Rotation

from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.geodesy import MapDatum, earth_from_map
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.geometry.transforms import (
    SENSOR_FROM_OPTICAL,
    apply,
    inverse,
    matrices_from_xyz_quaternion,
    matrices_from_xyz_rpy,
    quaternion_from_rpy,
    rotations_from_rpy,
    rpy_from_rotation,
)

RPY = np.random.default_rng(0).uniform([-3, -1.5, -3], [3, 1.5, 3], (200, 3))


def test_rotations_equal_scipys_fixed_axes_convention() -> None:
    expected = Rotation.from_euler("xyz", RPY).as_matrix()
    assert np.allclose(rotations_from_rpy(RPY), expected, atol=1e-12)
    assert np.allclose(rpy_from_rotation(expected), RPY, atol=1e-9)


def test_quaternions_equal_scipys_up_to_sign() -> None:
    dots = np.einsum("ni,ni->n", quaternion_from_rpy(RPY), Rotation.from_euler("xyz", RPY).as_quat())
    assert np.allclose(np.abs(dots), 1, atol=1e-12)


def test_transforms_from_quaternions_equal_those_from_their_angles() -> None:
    positions_m = RPY * 7.0
    from_quaternions = matrices_from_xyz_quaternion(positions_m, quaternion_from_rpy(RPY))
    assert np.allclose(from_quaternions, matrices_from_xyz_rpy(positions_m, RPY), atol=1e-12)
    assert np.allclose(from_quaternions[3], matrices_from_xyz_quaternion(positions_m[3], quaternion_from_rpy(RPY[3])))


def test_inverse_undoes_a_transform() -> None:
    transform = matrices_from_xyz_rpy(np.array([1.0, -2.0, 3.0]), np.array([0.1, 0.2, -0.7]))
    points = np.array([[4.0, 5.0, 6.0], [-1.0, 0.5, 2.0]])
    assert np.allclose(apply(inverse(transform), apply(transform, points)), points)


def test_a_point_ahead_of_the_sensor_is_on_the_optical_z_axis_and_left_is_minus_x() -> None:
    optical_from_sensor = inverse(SENSOR_FROM_OPTICAL)
    assert np.allclose(
        apply(optical_from_sensor, np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])), [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    )


def test_field_of_view_spans_the_image_from_edge_to_edge() -> None:
    camera = PinholeCamera.from_field_of_view(800, 450, np.radians(80))
    edges = camera.rays(np.array([[-0.5, 224.5], [799.5, 224.5]]))
    angles = np.degrees(np.arctan2(edges[:, 0], edges[:, 2]))
    assert angles == pytest.approx([-40, 40])


def test_projection_inverts_rays() -> None:
    camera = PinholeCamera(640, 480, 500.0, 510.0, 300.0, 250.0)
    pixels = np.array([[0.0, 0.0], [639.0, 100.0], [12.5, 479.0]])
    assert np.allclose(camera.project(camera.rays(pixels) * 7.0), pixels)


def test_grid_has_row_0_ahead_and_column_0_left() -> None:
    grid = BevGrid(4, 6, 0.5)
    assert grid.centers_ego[0, 0] == pytest.approx([0.75, 1.25])
    assert grid.centers_ego[3, 5] == pytest.approx([-0.75, -1.25])
    assert grid.cells_from_ego(np.array([[0.75, 1.25], [-0.75, 0.25]])) == pytest.approx(np.array([[0, 0], [3, 2]]))


def test_geodesy_round_trip_and_scale() -> None:
    datum = MapDatum(48.1, 11.5, 500.0)
    assert datum.map_from_geodetic(*datum.geodetic_from_map(np.array([812.0, -355.0, 12.0]))) == pytest.approx(
        (812, -355, 12), abs=1e-6
    )
    north = datum.geodetic_from_map(np.array([0.0, 1000.0, 0.0]))
    assert (north[0] - 48.1) * 111_200 == pytest.approx(1000, rel=2e-3)
    assert north[1] == pytest.approx(11.5, abs=1e-9)


@pytest.mark.parametrize("turned_rad", [0.0, 0.9])
def test_the_map_in_the_frame_of_the_earth_is_where_its_geodetic_positions_are(turned_rad: float) -> None:
    plain = MapDatum(48.1, 11.6, 519.0)
    datum = MapDatum(48.1, 11.6, 519.0, plain.proj_string, heading_rad=turned_rad)
    assert datum.map_from_east_rad == pytest.approx(turned_rad)
    pose = earth_from_map(48.1, 11.6, 519.0, datum.map_from_east_rad)
    geocentric = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    for point_m in ([0.0, 0.0, 0.0], [30.0, -40.0, 5.0], [-20.0, 10.0, 60.0]):
        latitude_deg, longitude_deg, altitude_m = datum.geodetic_from_map(point_m)
        expected_m = geocentric.transform(longitude_deg, latitude_deg, altitude_m)
        assert apply(pose, np.array(point_m)) == pytest.approx(expected_m, abs=0.01)


def test_map_x_points_exactly_east_unless_the_map_is_turned() -> None:
    assert MapDatum(45.5, -122.7, 15.0).map_from_east_rad == 0.0
