//! The commands and their data, on pictures of boxes.

use std::{collections::BTreeSet, fs, path::Path};

use clap::Parser as _;
use credence_complete::centersnap::{
    AutoEncoder, CELLS, CenterSnap, ObjectPose, StatisticValues, has_front,
};
use credence_nn::Provenance;
use credence_types::stream;

use super::{
    super::autoencoder::canonical_cloud,
    example::{CATEGORIES, Example},
    truth::{Shapes, is_told, pose},
};
use crate::{
    cli::Cli,
    data::{MeshSet, Picture, tests::boxes},
};

fn command(meshes: &Path, folder: &Path, part: &str, steps: &str) -> Result<(), String> {
    let path = |name: &str| folder.join(name).display().to_string();
    let meshes = meshes.display().to_string();
    let mut words = ["credence-train", "complete", "--quick"]
        .map(str::to_owned)
        .to_vec();
    for (option, value) in [
        ("--part", part.to_owned()),
        ("--steps", steps.to_owned()),
        ("--meshes", meshes.clone()),
        ("--validation", meshes),
        ("--out", path("weights")),
        ("--checkpoints", path("checkpoints")),
        ("--cache", path("cache")),
    ] {
        words.extend([option.to_owned(), value]);
    }
    let cli = Cli::try_parse_from(words).map_err(|e| e.to_string())?;
    cli.run().map_err(|e| e.to_string())
}

#[test]
fn the_commands_leave_weights_that_work_with_provenance_and_curves() {
    let (meshes, _) = boxes();
    let folder = tempfile::tempdir().unwrap();
    let train = |part, steps| command(meshes.path(), folder.path(), part, steps);
    let message = train("centersnap", "2").unwrap_err();
    assert!(message.contains("autoencoder.safetensors"), "{message}");

    train("autoencoder", "3").unwrap();
    train("centersnap", "2").unwrap();
    let weights = folder.path().join("weights/centersnap.safetensors");
    CenterSnap::from_file(&weights).unwrap();
    let provenance = Provenance::load(&weights).unwrap();
    assert_eq!((provenance.seed, provenance.steps), (0, 2));
    assert_eq!(provenance.data["mesh_count"], "12");
    assert!(provenance.figures.values().all(|value| value.is_finite()));
    assert!(provenance.sha256.is_some());
    let curve = fs::read_to_string(weights.with_extension("loss.csv")).unwrap();
    let header = "step,lr,loss,heat,latent,pose,depth,segments\n2,";
    assert!(curve.starts_with(header), "{curve}");
    let autoencoder = weights.with_file_name("autoencoder.safetensors");
    let bytes = fs::metadata(&autoencoder).unwrap().len();
    assert!(bytes < 20_000_000, "{bytes}");

    // The finished run's checkpoint gives the same file to the byte.
    let before = fs::read(&weights).unwrap();
    train("centersnap", "2").unwrap();
    assert_eq!(fs::read(&weights).unwrap(), before);

    // What is shipped is checked when it is read: the decoder too.
    let mut damaged = fs::read(&autoencoder).unwrap();
    let last = damaged.len() - 1;
    damaged[last] ^= 1;
    fs::write(&autoencoder, damaged).unwrap();
    let message = CenterSnap::from_file(&weights).unwrap_err().to_string();
    let restore = format!("git checkout -- {}", autoencoder.display());
    assert!(
        message.contains("is found") && message.contains(&restore),
        "{message}"
    );
}

fn pictures(meshes: &MeshSet) -> impl Iterator<Item = Picture<'_>> {
    (0..8).map(|number| {
        Picture::draw(meshes, &mut stream(number, "test/centersnap/picture")).unwrap()
    })
}

/// The normalised cloud, placed by the pose that the network is to tell, lies on the object, with
/// or without a front, and a category without one faces the camera.
#[test]
fn pose_and_turned_cloud_together_are_the_object() {
    let (_folder, meshes) = boxes();
    let mut seen = BTreeSet::new();
    for picture in pictures(&meshes) {
        for object in &picture.objects {
            let (pose, turn): (ObjectPose, _) = pose(object);
            let mut rng = stream(0, "test/centersnap/cloud");
            let cloud = canonical_cloud(object.mesh, turn, 50, &mut rng);
            let off = cloud.iter().map(|p| object.distance_m(&pose.place(*p)));
            assert!(off.fold(0.0, f64::max) < 1e-6);
            if !has_front(object.mesh.category) {
                let across = pose.rotation.column(1).dot(&pose.centre_m);
                assert!(across.abs() < 1e-9, "the camera lies in the xz plane");
                assert!(pose.rotation.column(0).dot(&pose.centre_m) < 0.0);
            }
            seen.insert(has_front(object.mesh.category));
        }
    }
    assert_eq!(seen.len(), 2, "both kinds were looked at");
}

#[test]
fn heat_peaks_where_objects_are_and_cells_around_tell_of_them() {
    let (_folder, meshes) = boxes();
    let statistics = StatisticValues::default();
    let autoencoder = AutoEncoder::new(&burn::tensor::Device::flex());
    let shapes = Shapes {
        autoencoder,
        statistics,
    };
    for picture in pictures(&meshes) {
        let told: Vec<_> = picture.objects.iter().copied().filter(is_told).collect();
        let poses: Vec<ObjectPose> = told.iter().map(|object| pose(object).0).collect();
        let rng = &mut stream(0, "test/centersnap/example");
        let example = Example::new(picture, &shapes, rng);
        assert_eq!(example.latents.len(), told.len());
        assert_eq!(example.heat.len(), CELLS[0] * CELLS[1] * CATEGORIES);
        for (number, (object, pose)) in told.iter().zip(&poses).enumerate() {
            let [column, row] = pose.pixel().map(|at| (at / 8.0).floor() as usize);
            let cell = row.min(CELLS[1] - 1) * CELLS[0] + column.min(CELLS[0] - 1);
            let class = usize::from(object.mesh.category.class());
            let heat = example.heat[cell * CATEGORIES + class - 1];
            // Half a cell's diagonal off at most, at a spread of one cell.
            assert!(heat > 0.75, "{heat}");
            let tells = |(at, of, _): &(usize, usize, _)| (*at, *of) == (cell, number);
            let hidden_by_nearer = poses.iter().enumerate().any(|(other, p)| {
                let [a, b] = [p.pixel(), pose.pixel()];
                other != number && (a[0] - b[0]).hypot(a[1] - b[1]) < 16.0
            });
            assert!(hidden_by_nearer || example.warm.iter().any(tells));
        }
    }
}

#[test]
fn a_picture_is_a_function_of_its_stream_and_its_depth_is_the_objects() {
    let (_folder, meshes) = boxes();
    let draw = |seed| Picture::draw(&meshes, &mut stream(seed, "test/picture")).unwrap();
    let (one, same, other) = (draw(1), draw(1), draw(2));
    assert_eq!(one.rgb, same.rgb);
    assert_ne!(one.rgb, other.rgb);
    let bits = |p: &Picture<'_>| p.depth_m.iter().map(|d| d.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&one), bits(&same));
    for picture in [one, other] {
        let [width, _] = Picture::SIZE;
        for (pixel, owner) in picture.owners.iter().enumerate() {
            let (depth, truth) = (picture.depth_m[pixel], picture.true_depth_m[pixel]);
            // Twelve standard deviations of the sensor.
            assert!(depth.is_nan() || (depth - truth).abs() < 0.1 * truth * truth);
            let Some(owner) = owner else { continue };
            let z = f64::from(truth);
            let x = ((pixel % width) as f64 - 159.75) / 308.0 * z;
            let y = ((pixel / width) as f64 - 119.75) / 308.0 * z;
            let off = picture.objects[usize::from(*owner)].distance_m(&[x, y, z].into());
            assert!(off < 1e-6, "{off}");
        }
        for (number, object) in (0..).zip(&picture.objects) {
            let own = picture
                .owners
                .iter()
                .filter(|owner| **owner == Some(number));
            assert_eq!(own.count(), object.pixels);
        }
    }
}
