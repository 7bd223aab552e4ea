//! The command and its data, on pictures of squares.

use std::{fs, path::Path};

use burn::tensor::Device;
use clap::Parser as _;
use credence_nn::rgbd::{HEIGHT, WIDTH};
use credence_nn::{Provenance, read, seed_parameters};
use credence_segment::maskrcnn::{Anchors, CLASSES, Detection, Input, MaskRcnn, MaskRcnnNetwork};
use credence_types::stream;

use super::{
    losses::losses,
    pictures::{PictureSet, tests::write},
    task::SegmentTask,
    truth::region_mask,
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
    assert_eq!(provenance.data["pictures_count"], "3");
    assert_eq!(provenance.data["validation_pictures_seed"], "7");
    assert_eq!(provenance.data["pictures_meshes_sha256"], "ab12");
    assert_eq!(provenance.data["pictures"], pictures.display().to_string());
    let told = provenance.figures["temperature_colour"];
    // In half precision.
    assert!((temperature(Input::Colour) - told).abs() < 1e-3 * told);
    assert!(provenance.figures.values().all(|value| value.is_finite()));
    let curve = fs::read_to_string(weights.with_extension("loss.csv")).unwrap();
    let header = "step,lr,loss,objectness,proposal,class,box,mask\n2,";
    assert!(curve.starts_with(header), "{curve}");

    // The finished run's checkpoint gives the same file to the byte.
    let before = fs::read(&weights).unwrap();
    command(&pictures, folder.path(), "2").unwrap();
    assert_eq!(fs::read(&weights).unwrap(), before);
}

/// Of one picture shown again and again, the loss falls, and steps are repeatable. It falls in every
/// part but the boxes', of which better proposals ask more.
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
    for part in [0, 1, 2, 3, 5] {
        assert!(after[part] < before[part], "{before:?} {after:?}");
    }
    assert!(after[0] < before[0] / 2.0, "{before:?} {after:?}");
}

/// What is learned of a region is what is pasted back: to the pixel, where a region has no more
/// pixels than its mask has values.
#[test]
fn the_mask_of_a_region_is_the_object_again() {
    for (left, top, width, height) in [(10, 20, 12, 9), (200, 3, 20, 25), (0, 230, 5, 10)] {
        let inside = |pixel: usize| {
            let (column, row) = (pixel % WIDTH, pixel / WIDTH);
            (left..left + width).contains(&column) && (top..top + height).contains(&row)
        };
        let owners: Vec<u8> = (0..WIDTH * HEIGHT).map(|p| u8::from(inside(p))).collect();
        for (right_of, below) in [(0.5, 0.5), (3.3, -1.2), (-2.0, 1.9)] {
            let edges = [
                left as f32 - 3.5 + right_of,
                top as f32 - 2.0 + below,
                (left + width) as f32 + 2.0 + right_of,
                (top + height) as f32 + 1.0 + below,
            ];
            let covered = |pixel: usize| {
                let (column, row) = ((pixel % WIDTH) as f32, (pixel / WIDTH) as f32);
                edges[0] < column && column <= edges[2] && edges[1] < row && row <= edges[3]
            };
            let mask = region_mask(&owners, 1, edges).into_iter();
            let detection = Detection {
                edges,
                classes: [0.0; CLASSES],
                mask: mask.map(|inside| f32::from(u8::from(inside))).collect(),
            };
            let pasted = detection.image_mask();
            let expected = (0..WIDTH * HEIGHT).map(|pixel| inside(pixel) && covered(pixel));
            let differ = pasted.iter().zip(expected).filter(|(a, b)| **a != *b);
            assert_eq!(differ.count(), 0, "{edges:?}");
        }
    }
}
