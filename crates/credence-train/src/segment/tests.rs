//! The command and its data, on pictures of squares.

use std::{fs, path::Path};

use burn::tensor::Device;
use clap::Parser as _;
use credence_nn::{Provenance, read, seed_parameters};
use credence_segment::maskrcnn::{Anchors, Input, MaskRcnn, MaskRcnnNetwork};
use credence_types::stream;

use super::{
    losses::losses,
    pictures::{PictureSet, tests::write},
    task::SegmentTask,
};
use crate::{cli::Cli, run::Task as _};

fn command(pictures: &Path, folder: &Path, steps: &str) -> Result<(), String> {
    let path = |name: &str| folder.join(name).display().to_string();
    let pictures = pictures.display().to_string();
    let mut words = ["credence-train", "segment", "--quick"]
        .map(str::to_owned)
        .to_vec();
    for (option, value) in [
        ("--steps", steps.to_owned()),
        ("--pictures", pictures.clone()),
        ("--validation", pictures),
        ("--out", path("weights/maskrcnn.safetensors")),
        ("--checkpoints", path("checkpoints")),
    ] {
        words.extend([option.to_owned(), value]);
    }
    let cli = Cli::try_parse_from(words).map_err(|e| e.to_string())?;
    cli.run().map_err(|e| e.to_string())
}

#[test]
fn the_command_leaves_weights_that_work_with_provenance_and_curve() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = folder.path().join("pictures");
    let message = command(&pictures, folder.path(), "2").unwrap_err();
    assert!(message.contains("harness training-pictures"), "{message}");
    fs::create_dir(&pictures).unwrap();
    write(&pictures, 3);
    let message = command(&pictures, folder.path(), "0").unwrap_err();
    assert!(message.contains("--steps is 0"), "{message}");

    command(&pictures, folder.path(), "2").unwrap();
    let weights = folder.path().join("weights/maskrcnn.safetensors");
    let temperature = |input| MaskRcnn::from_file(&weights, input).unwrap().temperature();
    let provenance = Provenance::load(&weights).unwrap();
    assert_eq!((provenance.seed, provenance.steps), (0, 2));
    assert_eq!(provenance.data["picture_count"], "3");
    assert_eq!(provenance.data["pictures"], pictures.display().to_string());
    let told = provenance.figures["temperature_colour"];
    assert!((temperature(Input::Colour) - told).abs() < 2e-3 * told);
    assert!(provenance.figures.values().all(|value| value.is_finite()));
    let curve = fs::read_to_string(weights.with_extension("loss.csv")).unwrap();
    let header = "step,lr,loss,objectness,proposal,class,box,mask\n2,";
    assert!(curve.starts_with(header), "{curve}");

    // The finished run's checkpoint gives the same file to the byte.
    let before = fs::read(&weights).unwrap();
    command(&pictures, folder.path(), "2").unwrap();
    assert_eq!(fs::read(&weights).unwrap(), before);
}

/// Of one picture shown again and again, the loss falls in every part, and steps are repeatable.
#[test]
fn a_network_learns_what_it_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), 1);
    let open = || PictureSet::open(folder.path()).unwrap();
    let device = Device::flex().autodiff();
    let task = SegmentTask {
        pictures: open(),
        validation: open(),
        seed: 0,
        batch: 2,
        trials: 1,
        anchors: Anchors::new(),
        device: device.clone(),
    };
    let examples = task.prepare(1).unwrap();
    assert_eq!(examples.len(), 2);
    assert_eq!(examples[0].truths.len(), 1);
    let network = MaskRcnnNetwork::new(&device);
    let network = seed_parameters(network, &mut stream(0, "test/segment"));
    let parts = |network: &MaskRcnnNetwork| {
        let all = losses(network, &task.anchors, examples.clone(), (0, 1), &device).unwrap();
        all.map(|part| read(part.reshape([1, 1])).unwrap()[0])
    };
    let before = parts(&network);
    assert_eq!(before, parts(&network));
    assert!((before[0] - before[1..].iter().sum::<f32>()).abs() < 1e-4);
    let optimizer = burn::optim::AdamWConfig::new().init();
    let (mut network, mut optimizer) = (network, optimizer);
    for _ in 0..12 {
        let [loss, ..] =
            losses(&network, &task.anchors, examples.clone(), (0, 1), &device).unwrap();
        let gradients = burn::optim::GradientsParams::from_grads(loss.backward(), &network);
        network = burn::optim::ModuleOptimizer::step(&mut optimizer, 2e-3, network, gradients);
    }
    let after = parts(&network);
    let better = before
        .iter()
        .zip(after)
        .map(|(before, after)| after < *before);
    assert!(better.clone().all(|better| better), "{before:?} {after:?}");
}
