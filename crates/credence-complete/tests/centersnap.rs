//! The shipped `CenterSnap` on a can that is drawn by hand, and on what is none.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{fs, path::Path};

use credence_complete::{Completer as _, Uncompleted, centersnap::CenterSnap};
use credence_types::{Category, Frame, Instance, Intrinsics, Point, Pose};
use nalgebra::Vector3;

const WIDTH: usize = 640;
const HEIGHT: usize = 480;
/// The can's radius and height, metres.
const RADIUS: f64 = 0.033;
const TALL: f64 = 0.12;

/// A picture of a table, seen from 45 degrees above, with cans on it.
struct Scene {
    /// Where cans stand, metres right of and behind the point that the camera looks at.
    cans: Vec<[f64; 2]>,
}

impl Scene {
    fn up() -> Vector3<f64> {
        Vector3::new(0.0, -1.0, -1.0).normalize()
    }

    fn base(can: [f64; 2]) -> Vector3<f64> {
        let behind = Vector3::new(0.0, -1.0, 1.0).normalize();
        Vector3::new(can[0], 0.0, 0.5) + can[1] * behind
    }

    /// Depth, outward normal and number of the can that a ray of depth 1 hits first; `None` for
    /// the table.
    fn hit(&self, ray: Vector3<f64>) -> (f64, Vector3<f64>, Option<usize>) {
        let up = Self::up();
        let table = Self::base([0.0; 2]).dot(&up) / ray.dot(&up);
        let mut nearest = (table, up, None);
        for (number, can) in self.cans.iter().enumerate() {
            let base = Self::base(*can);
            let cap = (base + TALL * up).dot(&up) / ray.dot(&up);
            let across = cap * ray - base - TALL * up;
            if across.norm() <= RADIUS && cap < nearest.0 {
                nearest = (cap, up, Some(number));
            }
            // |level(t ray - base)|^2 = r^2.
            let level = |v: Vector3<f64>| v - up * up.dot(&v);
            let (d, o) = (level(ray), level(-base));
            let (a, b, c) = (d.dot(&d), o.dot(&d), o.dot(&o) - RADIUS * RADIUS);
            let root = b * b - a * c;
            let side = (-b - root.max(0.0).sqrt()) / a;
            let height = (side * ray - base).dot(&up);
            if root >= 0.0 && (0.0..=TALL).contains(&height) && side < nearest.0 {
                nearest = (side, level(side * ray - base).normalize(), Some(number));
            }
        }
        nearest
    }

    fn frame(&self) -> (Frame, Vec<Option<usize>>) {
        let camera = Intrinsics::new([WIDTH, HEIGHT], [616.0; 2], [319.5, 239.5]).unwrap();
        let light = Vector3::new(0.4, -0.8, -0.6).normalize();
        let (mut rgb, mut depth_m, mut owners) = (Vec::new(), Vec::new(), Vec::new());
        for pixel in 0..WIDTH * HEIGHT {
            let ray = camera.ray((pixel % WIDTH) as f64, (pixel / WIDTH) as f64);
            let (depth, normal, owner) = self.hit(ray);
            let colour = if owner.is_some() {
                [200.0, 60.0, 50.0]
            } else {
                [170.0, 160.0, 150.0]
            };
            let bright = 0.5 + 0.5 * normal.dot(&light).max(0.0);
            rgb.push(colour.map(|c: f64| (c * bright) as u8));
            depth_m.push(depth as f32);
            owners.push(owner);
        }
        let frame = Frame::new(rgb, depth_m, camera, Pose::identity(), None).unwrap();
        (frame, owners)
    }

    fn instances(&self, owners: &[Option<usize>]) -> Vec<Instance> {
        (0..self.cans.len())
            .map(|can| {
                let mask = owners.iter().map(|owner| *owner == Some(can)).collect();
                Instance::certain(can, mask, Category::Can).unwrap()
            })
            .collect()
    }

    /// Distance of a camera-frame point from a can's surface.
    fn distance(&self, can: usize, point: &Point) -> f64 {
        let up = Self::up();
        let from_base = point.coords - Self::base(self.cans[can]);
        let height = from_base.dot(&up);
        let across = (from_base - up * height).norm();
        let beside = across - RADIUS;
        let above = (height - TALL).max(-height);
        if beside > 0.0 || above > 0.0 {
            beside.max(0.0).hypot(above.max(0.0))
        } else {
            -beside.max(above)
        }
    }
}

fn completer() -> CenterSnap {
    CenterSnap::embedded().unwrap()
}

#[test]
fn an_empty_table_has_no_objects() {
    let (frame, _) = Scene { cans: vec![] }.frame();
    let centersnap = completer();
    assert_eq!(centersnap.detect(&frame).unwrap(), []);
    assert_eq!(centersnap.complete(&frame, &[]).unwrap(), []);
    let mask = (0..WIDTH * HEIGHT)
        .map(|pixel| pixel % WIDTH < 99)
        .collect();
    let table = Instance::certain(0, mask, Category::Mug).unwrap();
    let found = centersnap.complete(&frame, &[table]).unwrap();
    assert_eq!(found, [Err(Uncompleted::NotDetected)]);
}

#[test]
fn two_cans_are_found_named_and_completed_each_with_its_mask() {
    let scene = Scene {
        cans: vec![[-0.08, 0.0], [0.08, 0.03]],
    };
    let (frame, owners) = scene.frame();
    let centersnap = completer();
    let instances = scene.instances(&owners);
    let found = centersnap.complete(&frame, &instances).unwrap();
    for (can, completion) in found.iter().enumerate() {
        let completion = completion.as_ref().unwrap();
        assert_eq!(completion.category, Category::Can);
        assert!(
            (0.3..=1.0).contains(&completion.score),
            "{}",
            completion.score
        );
        assert_eq!(completion.points_camera.len(), 2048);
        let distances = completion
            .points_camera
            .iter()
            .map(|p| scene.distance(can, p));
        let mean = distances.sum::<f64>() / 2048.0;
        assert!(mean < 0.015, "{mean} m off on average");
        assert!(completion.spread_m.iter().all(|s| (1e-4..0.05).contains(s)));
    }
    // The other way round, and again: each keeps its own, to the bit.
    let swapped = [instances[1].clone(), instances[0].clone()];
    let again = centersnap.complete(&frame, &swapped).unwrap();
    assert_eq!((&again[0], &again[1]), (&found[1], &found[0]));
}

#[test]
fn any_cameras_frame_is_looked_at() {
    let (frame, owners) = Scene {
        cans: vec![[0.0, 0.0]],
    }
    .frame();
    // The same picture, its upper rows cut off, at the same focal length.
    let cut = 100;
    let camera = Intrinsics::new(
        [WIDTH, HEIGHT - cut],
        [616.0; 2],
        [319.5, 239.5 - cut as f64],
    );
    let from = cut * WIDTH;
    let other = Frame::new(
        frame.rgb()[from..].to_vec(),
        frame.depth_m()[from..].to_vec(),
        camera.unwrap(),
        Pose::identity(),
        None,
    )
    .unwrap();
    let mask = owners[from..].iter().map(Option::is_some).collect();
    let instance = Instance::certain(0, mask, Category::Can).unwrap();
    let found = completer().complete(&other, &[instance]).unwrap();
    assert!(found[0].is_ok(), "{found:?}");
}

#[test]
fn an_object_cut_by_the_border_is_completed_or_left_out_with_its_reason() {
    let centersnap = completer();
    for aside in [0.2, 0.24, 0.26, 0.28] {
        let scene = Scene {
            cans: vec![[aside, 0.0]],
        };
        let (frame, owners) = scene.frame();
        let found = centersnap
            .complete(&frame, &scene.instances(&owners))
            .unwrap();
        match &found[0] {
            Ok(completion) => {
                let points = completion.points_camera.iter();
                let mean = points.map(|p| scene.distance(0, p)).sum::<f64>() / 2048.0;
                assert!(mean < 0.06, "{mean} m off at {aside}");
            }
            Err(reason) => assert_eq!(*reason, Uncompleted::NotDetected),
        }
    }
}

#[test]
fn an_object_without_depth_has_no_completion_and_says_why() {
    let scene = Scene {
        cans: vec![[0.0, 0.0]],
    };
    let (frame, owners) = scene.frame();
    let mut depth_m = frame.depth_m().to_vec();
    for (depth, owner) in depth_m.iter_mut().zip(&owners) {
        if owner.is_some() {
            *depth = f32::NAN;
        }
    }
    let camera = *frame.intrinsics();
    let blind = Frame::new(
        frame.rgb().to_vec(),
        depth_m,
        camera,
        Pose::identity(),
        None,
    )
    .unwrap();
    let found = completer()
        .complete(&blind, &scene.instances(&owners))
        .unwrap();
    let reason = Uncompleted::TooFewPoints {
        found: 0,
        least: 50,
    };
    assert_eq!(found, [Err(reason.clone())]);
    assert!(
        reason
            .to_string()
            .contains("0 of its pixels have a valid depth")
    );
}

#[test]
fn a_mask_of_another_size_is_refused() {
    let (frame, _) = Scene { cans: vec![] }.frame();
    let instance = Instance::certain(0, vec![true; 9], Category::Can).unwrap();
    let message = completer()
        .complete(&frame, &[instance])
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("mask") && message.contains('9'),
        "{message}"
    );
}

#[test]
fn weights_that_are_missing_cut_or_anothers_are_refused_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/weights");
    let refused = || {
        CenterSnap::from_file(&path("centersnap.safetensors"))
            .unwrap_err()
            .to_string()
    };
    let message = refused();
    assert!(message.contains("centersnap.safetensors"), "{message}");
    assert!(message.contains("credence-train"), "{message}");

    for name in ["centersnap", "autoencoder"] {
        for extension in ["safetensors", "json"] {
            let file = format!("{name}.{extension}");
            fs::copy(shipped.join(&file), path(&file)).unwrap();
        }
    }
    CenterSnap::from_file(&path("centersnap.safetensors")).unwrap();

    // With their provenance beside them: hashes and the command.
    let whole = fs::read(path("centersnap.safetensors")).unwrap();
    let hostile = [
        whole[..whole.len() / 2].to_vec(),
        Vec::new(),
        vec![0xff; 64],
        // A header that claims more than there is.
        u64::MAX.to_le_bytes().to_vec(),
    ];
    for bytes in &hostile {
        fs::write(path("centersnap.safetensors"), bytes).unwrap();
        let message = refused();
        assert!(
            message.contains("is expected") && message.contains("git checkout"),
            "{message}"
        );
    }
    fs::remove_file(path("centersnap.safetensors")).unwrap();
    assert!(refused().contains("are missing"));
    // Without: what is wrong with the bytes.
    fs::remove_file(path("centersnap.json")).unwrap();
    for bytes in &hostile {
        fs::write(path("centersnap.safetensors"), bytes).unwrap();
        assert!(refused().contains("is not a whole safetensors file"));
    }
    fs::copy(
        path("autoencoder.safetensors"),
        path("centersnap.safetensors"),
    )
    .unwrap();
    assert!(refused().contains("another network"));
}
