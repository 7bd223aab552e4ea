//! The command and its data, on scenes of boxes.

use std::{fs, path::Path};

use clap::Parser as _;
use credence_embed::QueryEmbedder;
use credence_nn::Provenance;
use credence_types::stream;

use super::augment::{training_example, validation_example};
use crate::{
    cli::Cli,
    data::{MeshSet, Scene, tests::boxes},
};

const STEPS: [&str; 2] = ["--steps", "4"];

fn command(meshes: &Path, folder: &Path, more: &[&str]) -> Result<(), String> {
    let path = |name: &str| folder.join(name).display().to_string();
    let meshes = meshes.display().to_string();
    let mut words = ["credence-train", "query", "--quick", "--scenes", "6"]
        .map(str::to_owned)
        .to_vec();
    for (option, value) in [
        ("--meshes", meshes.clone()),
        ("--validation", meshes),
        ("--out", path("query.safetensors")),
        ("--checkpoints", path("checkpoints")),
    ] {
        words.extend([option.to_owned(), value]);
    }
    if !more.contains(&"--cache") {
        words.extend(["--cache".to_owned(), path("cache")]);
    }
    words.extend(more.iter().map(|word| (*word).to_owned()));
    let cli = Cli::try_parse_from(words).map_err(|e| e.to_string())?;
    cli.run().map_err(|e| e.to_string())
}

#[test]
fn the_command_leaves_weights_provenance_and_curve() {
    let (meshes, _) = boxes();
    let folder = tempfile::tempdir().unwrap();
    command(meshes.path(), folder.path(), &STEPS).unwrap();
    let weights = folder.path().join("query.safetensors");
    QueryEmbedder::from_file(&weights).unwrap();
    let provenance = Provenance::load(&weights).unwrap();
    assert_eq!((provenance.seed, provenance.steps), (0, 4));
    assert_eq!(provenance.data["scenes"], "6");
    assert!(provenance.parameters > 150_000);
    assert!(provenance.figures.values().all(|value| value.is_finite()));
    let curve = fs::read_to_string(folder.path().join(&provenance.loss_curve)).unwrap();
    assert!(
        curve.starts_with("step,lr,loss,surface,direction,class\n4,"),
        "{curve}"
    );

    // The finished run's checkpoint gives the same file to the byte; another seed is another run.
    let before = fs::read(&weights).unwrap();
    command(meshes.path(), folder.path(), &STEPS).unwrap();
    assert_eq!(fs::read(&weights).unwrap(), before);
    let cache = folder.path().join("other").display().to_string();
    let message = command(
        meshes.path(),
        folder.path(),
        &[&STEPS[..], &["--seed", "1", "--cache", &cache]].concat(),
    );
    let message = message.unwrap_err();
    assert!(
        message.contains("belongs to another run (query, seed 0, 4 steps"),
        "{message}"
    );
}

#[test]
fn what_cannot_be_trained_on_is_refused() {
    let (meshes, _) = boxes();
    let folder = tempfile::tempdir().unwrap();
    let refused = |more: &[&str]| command(meshes.path(), folder.path(), more).unwrap_err();
    assert_eq!(
        refused(&["--steps", "0"]),
        "--steps is 0; it must be at least 1"
    );
    let none = Path::new("no-such-folder");
    let message = command(none, folder.path(), &STEPS).unwrap_err();
    assert!(message.contains("no-such-folder"), "{message}");
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let message = command(meshes.path(), &file, &STEPS).unwrap_err();
    assert!(message.starts_with("cannot write "), "{message}");
    assert!(refused(&["--seed=-1"]).contains("--seed"));
}

#[test]
fn an_example_is_a_function_of_its_stream_and_asks_for_support_points_too() {
    let (_folder, meshes) = boxes();
    let scene = Scene::generate(&meshes, 3, 0).unwrap();
    let example = |purpose: &str| training_example(&scene, 256, &mut stream(1, purpose)).unwrap();
    let (one, same, other) = (example("a"), example("a"), example("b"));
    assert_eq!(
        (&one.labels, &one.distances_m),
        (&same.labels, &same.distances_m)
    );
    assert_ne!(one.distances_m, other.distances_m);
    assert_eq!(one.labels.len(), 256);
    assert_eq!(one.labels[224..240], [1.0; 16]);
    assert_eq!(one.labels[240..], [0.0; 16]);
    let on = one.labels.iter().sum::<f32>();
    assert!((40.0..216.0).contains(&on), "{on} of 256 on the surface");
}

#[test]
fn validation_asks_for_every_query_as_it_is() {
    let (_folder, meshes): (_, MeshSet) = boxes();
    let scene = Scene::generate(&meshes, 3, 1).unwrap();
    let example = validation_example(&scene).unwrap();
    assert_eq!(example.distances_m, scene.distances_m);
    assert_eq!(example.category, usize::from(scene.category.class()) - 1);
    for (label, distance_m) in example.labels.iter().zip(&example.distances_m) {
        assert_eq!(*label > 0.5, *distance_m <= 0.005);
    }
}
