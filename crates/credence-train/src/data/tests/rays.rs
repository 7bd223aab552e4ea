//! The depth buffer against parry's ray caster.

use std::f64::consts::TAU;

use credence_types::Category;
use parry3d_f64::{
    math::Vector,
    query::{Ray, RayCast as _},
    shape::TriMesh,
};

use super::super::{
    camera::{Camera, HEIGHT, WIDTH},
    mesh_set::Mesh,
    ply::Triangles,
    raster::{Owner, Raster, Window},
    stage::Placed,
};

/// A ring that hides parts of itself.
fn ring() -> Mesh {
    let (around, across) = (60_u32, 24_u32);
    let corner = |i: u32, j: u32| (i % around) * across + j % across;
    let vertices = (0..around * across)
        .map(|index| {
            let [a, b] = [
                f64::from(index / across) / f64::from(around) * TAU,
                f64::from(index % across) / f64::from(across) * TAU,
            ];
            let tube = 0.02 + 0.005 * (5.0 * a).sin();
            let radius = 0.06 + tube * b.cos();
            [radius * a.cos(), radius * a.sin(), tube * b.sin()].map(|c| c as f32)
        })
        .collect();
    let faces = (0..around)
        .flat_map(|i| (0..across).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b] = [corner(i, j), corner(i + 1, j + 1)];
            [[a, corner(i + 1, j), b], [a, b, corner(i, j + 1)]]
        })
        .collect();
    Mesh::new(Triangles { vertices, faces }, Category::Mug).unwrap()
}

#[test]
fn depth_is_what_rays_through_the_pixel_centres_hit() {
    let mesh = ring();
    let placed = Placed::new(&mesh, 1.1, 0.7, [0.02, -0.01]);
    let eye = Vector::new(0.25, -0.2, 0.22);
    let camera = Camera::looking(eye, Vector::new(0.02, 0.0, 0.02));
    let window = Window {
        left: 150,
        top: 90,
        width: 330,
        height: 290,
    };
    let mut raster = Raster::table(&camera, window);
    assert!(raster.draw(&camera, &placed, 0));

    let vertices = mesh
        .vertices
        .iter()
        .map(|v| placed.world_point(*v))
        .collect();
    let oracle = TriMesh::new(vertices, mesh.faces.clone()).unwrap();
    let (mut on_object, mut differ) = (0, 0);
    for pixel in 0..window.width * window.height {
        let [u, v] = raster.image_pixel(pixel);
        let ray = Ray::new(eye, camera.ray(u as f64, v as f64));
        let table = eye.z / -ray.dir.z;
        let hit = oracle.cast_local_ray(&ray, table, false);
        let is_object = raster.owners[pixel] != Owner::TABLE;
        on_object += usize::from(is_object);
        if is_object == hit.is_some() {
            let expected = hit.unwrap_or(table);
            let depth = raster.depth(pixel);
            assert!(
                (depth - expected).abs() < 1e-6,
                "{pixel}: {depth} {expected}"
            );
        } else {
            // Rounding decides whether a ray passes beside an outline.
            differ += 1;
        }
        let at = camera.ray(u as f64, v as f64) * 0.3 + eye;
        assert_eq!(
            raster.pixel_at(Camera::project(camera.camera_point(at))),
            Some(pixel)
        );
    }
    assert!(on_object > 10_000 && differ <= 2, "{on_object} {differ}");
}

#[test]
fn what_is_too_near_the_lens_spoils_the_view() {
    let mesh = ring();
    let placed = Placed::new(&mesh, 1.0, 0.0, [0.0; 2]);
    let near = Camera::looking(Vector::new(0.1, 0.0, 0.1), Vector::ZERO);
    let window = Window::around(&near, [Vector::ZERO].into_iter());
    assert!(!Raster::table(&near, window).draw(&near, &placed, 0));
}

#[test]
fn a_window_holds_the_box_and_stays_in_the_image() {
    let camera = Camera::looking(Vector::new(0.5, 0.0, 0.5), Vector::ZERO);
    let corners = [Vector::new(0.0, -0.1, 0.0), Vector::new(0.0, 0.1, 0.05)];
    let window = Window::around(&camera, corners.into_iter());
    for corner in corners {
        let [u, v] = Camera::project(camera.camera_point(corner));
        assert!(u >= window.left as f64 && u <= (window.left + window.width) as f64);
        assert!(v >= window.top as f64 && v <= (window.top + window.height) as f64);
    }
    let far = [
        Vector::splat(-9.0),
        Vector::splat(9.0),
        Vector::new(9.0, -9.0, 0.0),
    ];
    let window = Window::around(&camera, far.into_iter());
    assert!(window.left + window.width <= WIDTH && window.top + window.height <= HEIGHT);
    let aside = [Vector::new(0.0, 3.0, 0.0)];
    assert_eq!(Window::around(&camera, aside.into_iter()).width, 0);
}
