from __future__ import annotations

import numpy as np
import trimesh

from sim_scenes import Intrinsics
from sim_scenes.silhouette import silhouette

CAMERA = Intrinsics(8, 6, 1.0, 1.0, 0.0, 0.0)


def test_a_triangle_covers_the_centres_it_holds() -> None:
    # At z = 1 with f = 1, coordinates are pixels.
    vertices = np.array([[0.0, 0, 1], [4, 0, 1], [0, 4, 1]])
    expected = np.zeros((6, 8), dtype=bool)
    for row in range(5):
        expected[row, : 5 - row] = True
    for faces in ([[0, 1, 2]], [[0, 2, 1]]):
        np.testing.assert_array_equal(
            silhouette(vertices, np.array(faces), intrinsics=CAMERA), expected
        )


def test_between_pixel_centres_nothing_is_covered() -> None:
    vertices = np.array([[1.2, 1.2, 1], [1.8, 1.2, 1], [1.2, 1.8, 1]])
    assert not silhouette(vertices, np.array([[0, 1, 2]]), intrinsics=CAMERA).any()


def test_what_leaves_the_image_is_cut_and_what_is_behind_left_out() -> None:
    vertices = np.array([[-50.0, -50, 1], [50, -50, 1], [0, 90, 1], [1, 1, -1]])
    assert silhouette(vertices, np.array([[0, 1, 2]]), intrinsics=CAMERA).all()
    assert not silhouette(vertices, np.array([[0, 1, 3]]), intrinsics=CAMERA).any()


def test_a_fine_sphere_covers_its_disc() -> None:
    camera = Intrinsics(160, 120, 200.0, 200.0, 79.5, 59.5)
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    vertices = np.asarray(sphere.vertices) + np.array([0.02, -0.01, 0.5])
    covered = silhouette(vertices, np.asarray(sphere.faces), intrinsics=camera)
    x, y = camera.ray_slopes()
    middle = np.array([0.02, -0.01, 0.5])
    length = np.sqrt(x**2 + y**2 + 1)
    along = (x * middle[0] + y * middle[1] + middle[2]) / length
    from_axis = np.sqrt(np.maximum(middle @ middle - along**2, 0))
    # Chords of a mesh of 20,480 faces stay within 0.1 mm of the sphere.
    assert not covered[from_axis > 0.1].any()
    assert covered[from_axis < 0.0999].all()
