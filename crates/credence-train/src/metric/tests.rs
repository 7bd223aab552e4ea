//! The commands, on scenes of boxes.

use std::{collections::BTreeSet, fs, path::Path};

use clap::Parser as _;
use credence_embed::MetricEmbedder;
use credence_nn::Provenance;

use super::task::MetricTask;
use crate::{
    TrainError,
    cli::Cli,
    data::{SceneCache, tests::boxes},
    run::Task as _,
};

fn run(words: &[&str], paths: &[(&str, &Path)]) -> Result<(), TrainError> {
    let mut line = vec!["credence-train".to_owned()];
    line.extend(words.iter().map(|word| (*word).to_owned()));
    for (option, path) in paths {
        line.extend([(*option).to_owned(), path.display().to_string()]);
    }
    Cli::try_parse_from(line).unwrap().run()
}

#[test]
fn the_commands_leave_weights_with_provenance_and_a_table() {
    let (meshes, _) = boxes();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (weights, cache, checkpoints) = (path("m.safetensors"), path("cache"), path("runs"));
    let paths = [
        ("--meshes", meshes.path()),
        ("--validation", meshes.path()),
        ("--out", &weights),
        ("--cache", &cache),
        ("--checkpoints", &checkpoints),
    ];
    let words = ["embed", "--quick", "--scenes", "9"];
    run(&words, &paths).unwrap();
    let provenance = Provenance::load(&weights).unwrap();
    assert_eq!((provenance.steps, provenance.seed), (10, 0));
    assert_eq!(provenance.parameters, 1_017_800);
    assert!(provenance.figures.values().all(|value| value.is_finite()));
    let curve = fs::read_to_string(path(&provenance.loss_curve)).unwrap();
    assert!(
        curve.starts_with("step,lr,loss,cross_entropy,sphere\n"),
        "{curve}"
    );
    MetricEmbedder::from_file(&weights).unwrap();

    let table = path("sphere.csv");
    let paths = [
        ("--validation", meshes.path()),
        ("--weights", &weights),
        ("--out", &table),
        ("--cache", &cache),
    ];
    run(&["sphere", "--scenes", "3", "--points", "7"], &paths).unwrap();
    let table = fs::read_to_string(table).unwrap();
    let lines_of = |kind: &str| table.lines().filter(|line| line.starts_with(kind)).count();
    assert_eq!(lines_of("direction,"), 6);
    assert!((1..=3 * 7 + 7).contains(&lines_of("point,")), "{table}");
}

#[test]
fn every_scene_is_seen_once_before_any_is_seen_again() {
    let (_folder, meshes) = boxes();
    let cache = tempfile::tempdir().unwrap();
    let scenes =
        |count| SceneCache::open_or_generate(cache.path(), &meshes, count, 0, &|_| ()).unwrap();
    let task = MetricTask {
        scenes: scenes(6),
        validation: scenes(1),
        seed: 0,
        clouds: 2,
        scored: 4,
    };
    // Turning about the vertical keeps the heights, which tell the scenes apart.
    let heights = |step: u64| -> Vec<Vec<u32>> {
        let clouds = task.prepare(step).unwrap();
        clouds
            .iter()
            .map(|(points, _)| points.iter().map(|p| p[2].to_bits()).collect())
            .collect()
    };
    let once: BTreeSet<Vec<u32>> = (1..=3).flat_map(heights).collect();
    assert_eq!(once.len(), 6);
    assert_eq!(heights(4), heights(1));
    assert_eq!(task.prepare(2).unwrap(), task.prepare(2).unwrap());
}

#[test]
fn what_cannot_be_used_is_refused() {
    let (meshes, _) = boxes();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (out, none) = (path("out"), path("none"));
    let message =
        |words: &[&str], paths: &[(&str, &Path)]| run(words, paths).unwrap_err().to_string();
    let training = [
        ("--meshes", meshes.path()),
        ("--validation", meshes.path()),
        ("--out", out.as_path()),
    ];
    assert_eq!(
        message(&["embed", "--steps", "0"], &training),
        "--steps is 0; it must be at least 1"
    );
    let sphere = [
        ("--validation", meshes.path()),
        ("--out", &out),
        ("--weights", &none),
    ];
    let text = message(&["sphere"], &sphere);
    assert!(
        text.starts_with("cannot read ") && text.contains("none"),
        "{text}"
    );
}
