use std::time::Instant;

use credence_map::{InsertReport, ObjectId, SemanticMap};
use credence_types::{Frame, Point};

use crate::{
    Classification, Config, ModelChoice, PipelineError, Segmenter, TrainingSet, classify::Fitted,
};

/// How long a stage took.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StageTime {
    /// Which stage.
    pub stage: &'static str,
    /// The classifier it belongs to; `None` where all share it.
    pub model: Option<ModelChoice>,
    /// Wall time in seconds, over all calls.
    pub seconds: f64,
}

/// From frames to a semantic map to classified points.
pub struct Pipeline {
    config: Config,
    segmenter: Box<dyn Segmenter>,
    map: SemanticMap,
    times: Vec<StageTime>,
}

impl Pipeline {
    /// An empty map and the stages that the configuration names.
    ///
    /// # Errors
    /// A setting outside its range.
    pub fn new(config: Config) -> Result<Self, PipelineError> {
        config.check()?;
        let map = SemanticMap::new(config.map.settings())?;
        Ok(Self {
            segmenter: config.segmenter.build(),
            map,
            times: Vec::new(),
            config,
        })
    }

    /// The configuration.
    pub const fn config(&self) -> &Config {
        &self.config
    }

    /// The map as it stands.
    pub const fn map(&self) -> &SemanticMap {
        &self.map
    }

    /// Time per stage and model since the pipeline was made, in order of first use.
    pub fn times(&self) -> &[StageTime] {
        &self.times
    }

    /// Segments a frame and inserts it into the map.
    ///
    /// # Errors
    /// A frame that the segmenter or the map refuses; the map is unchanged then.
    pub fn add_frame(&mut self, frame: &Frame) -> Result<InsertReport, PipelineError> {
        let start = Instant::now();
        let instances = self.segmenter.segment(frame)?;
        self.note("segment", None, start);
        let start = Instant::now();
        let report = self.map.insert(frame, &instances)?;
        self.note("map", None, start);
        Ok(report)
    }

    /// Draws the training points of an object.
    ///
    /// # Errors
    /// An id that is not tracked, an object without free space around it.
    pub fn training_set(&mut self, id: ObjectId, seed: u64) -> Result<TrainingSet, PipelineError> {
        let start = Instant::now();
        let training = TrainingSet::draw(&self.map, id, &self.config.training, seed)?;
        self.note("training points", None, start);
        Ok(training)
    }

    /// Fits a model to training points and asks it about test points: whether they lie on an
    /// object of the category that the map gives object `id`. The map stays as it is: see
    /// [`annotate`](Self::annotate).
    ///
    /// # Errors
    /// An id that is not tracked, training points of fewer than two classes or none of the
    /// object's category, points that are not finite, a covariance that cannot be factorised.
    pub fn classify(
        &mut self,
        id: ObjectId,
        training: &TrainingSet,
        test_points: &[Point],
        model: ModelChoice,
    ) -> Result<Classification, PipelineError> {
        let object = self.map.object(id)?;
        let (category, score) = (object.category(), object.score());
        let start = Instant::now();
        let fitted = Fitted::new(training, category, model, &self.config.gp)?;
        self.note("fit", Some(model), start);
        let start = Instant::now();
        let classification = fitted.predict(test_points, score)?;
        self.note("posterior", Some(model), start);
        Ok(classification)
    }

    /// Writes the confidences of test points into the map: each voxel of object `id` that holds
    /// any of them takes their mean, and what the object's voxels held before is gone. Returns the
    /// number of voxels set.
    ///
    /// # Errors
    /// An id that is not tracked, a classification of another number of test points.
    pub fn annotate(
        &mut self,
        id: ObjectId,
        test_points: &[Point],
        classification: &Classification,
    ) -> Result<usize, PipelineError> {
        let predictions = &classification.predictions.points;
        let confidences: Vec<f64> = predictions.iter().map(|point| point.confidence).collect();
        Ok(self.map.set_confidences(id, test_points, &confidences)?)
    }

    fn note(&mut self, stage: &'static str, model: Option<ModelChoice>, start: Instant) {
        let seconds = start.elapsed().as_secs_f64();
        let known = self
            .times
            .iter_mut()
            .find(|time| (time.stage, time.model) == (stage, model));
        match known {
            Some(time) => time.seconds += seconds,
            None => self.times.push(StageTime {
                stage,
                model,
                seconds,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use credence_map::{Association, TrackedObject};
    use credence_types::{Category, FREE_CLASS};

    use super::*;
    use crate::scene::{Solid, view};

    const SETTINGS: &str = r#"{"training": {"points": 600}, "gp": {"fit_points": 300}}"#;

    fn mug() -> Solid {
        Solid::cube(Category::Mug, [0.0, 0.0])
    }

    fn mapped() -> Pipeline {
        let mut pipeline = Pipeline::new(Config::from_json(SETTINGS).unwrap()).unwrap();
        for azimuth_deg in [-60.0, 20.0] {
            pipeline.add_frame(&view(&[mug()], azimuth_deg)).unwrap();
        }
        pipeline
    }

    fn only_object(pipeline: &Pipeline) -> ObjectId {
        let objects: Vec<&TrackedObject> = pipeline.map().objects().collect();
        assert_eq!(objects.len(), 1);
        objects[0].id()
    }

    /// Points on the top, and on the sides x = 0.04 and y = -0.04, which both views see.
    fn on_surface() -> Vec<Point> {
        let inner = [-0.025, 0.0, 0.025];
        let pairs = || inner.into_iter().flat_map(|a| inner.map(|b| (a, b)));
        let top = pairs().map(|(a, b)| Point::new(a, b, 0.08));
        let front = pairs().map(|(a, b)| Point::new(0.04, a, 0.04 + b));
        let side = pairs().map(|(a, b)| Point::new(a, -0.04, 0.04 + b));
        top.chain(front).chain(side).collect()
    }

    /// Points 2.5 cm before the same places.
    fn in_free_space() -> Vec<Point> {
        let out = |p: Point| {
            let push = |value: f64, face: f64| if value == face { face * 1.625 } else { value };
            let z = if p.z == 0.08 { 0.105 } else { p.z };
            Point::new(push(p.x, 0.04), push(p.y, -0.04), z)
        };
        on_surface().into_iter().map(out).collect()
    }

    #[test]
    fn the_surface_is_the_object_and_seen_space_is_free() {
        let mut pipeline = mapped();
        let id = only_object(&pipeline);
        assert_eq!(pipeline.map().object(id).unwrap().category(), Category::Mug);
        let training = pipeline.training_set(id, 1).unwrap();
        let test = [on_surface(), in_free_space()].concat();
        let result = pipeline
            .classify(id, &training, &test, ModelChoice::Classic)
            .unwrap();

        let predictions = &result.predictions;
        assert_eq!(predictions.classes, [FREE_CLASS, Category::Mug.class()]);
        assert_eq!(result.fits.len(), 2);
        assert!(result.fits.iter().all(|fit| fit.converged && !fit.at_bound));
        assert_eq!(predictions.clamped_share, 0.0);
        let (surface, free) = predictions.points.split_at(27);
        for (point, prediction) in test.iter().zip(surface) {
            assert_eq!(prediction.class, Category::Mug.class(), "{point}");
            assert!(prediction.confidence > 0.5 && prediction.confidence <= 1.0);
        }
        for (point, prediction) in test[27..].iter().zip(free) {
            assert_eq!(prediction.class, FREE_CLASS, "{point}");
            assert!(prediction.confidence < 0.5 && prediction.confidence >= 0.0);
        }
        let scores = || predictions.points.iter().map(|p| p.score);
        assert_eq!(scores().fold(f64::INFINITY, f64::min), 0.0);
        assert_eq!(scores().fold(0.0, f64::max), 1.0);
    }

    #[test]
    fn annotating_gives_the_voxels_the_confidences_of_the_points_in_them() {
        let mut pipeline = mapped();
        let id = only_object(&pipeline);
        assert_eq!(pipeline.map().object_confidence(id).unwrap(), None);
        let training = pipeline.training_set(id, 1).unwrap();
        // Two observed points of one voxel, which takes their mean; a point in the air; no more.
        let cloud = &pipeline.map().object(id).unwrap().cloud().points_world;
        let shared = cloud
            .iter()
            .enumerate()
            .find_map(|(i, a)| {
                let near = |b: &&Point| {
                    let centre = |p: &Point| pipeline.map().voxel_at(p).map(|v| v.centre);
                    centre(a).is_some() && centre(a) == centre(b)
                };
                cloud[i + 1..].iter().find(near).map(|b| [*a, *b])
            })
            .unwrap();
        let test = [shared[0], shared[1], Point::new(0.0, 0.0, 0.15)];
        let result = pipeline
            .classify(id, &training, &test, ModelChoice::Classic)
            .unwrap();
        assert_eq!(pipeline.map().object_confidence(id).unwrap(), None);
        assert_eq!(pipeline.annotate(id, &test, &result).unwrap(), 1);
        let points = &result.predictions.points;
        let mean = f64::midpoint(points[0].confidence, points[1].confidence);
        assert_eq!(
            pipeline.map().voxel_at(&shared[0]).unwrap().confidence,
            Some(mean)
        );
        let set = pipeline.map().voxels().filter(|v| v.confidence.is_some());
        assert_eq!(set.count(), 1);
        assert_eq!(pipeline.map().object_confidence(id).unwrap(), Some(mean));

        let refused = pipeline.annotate(id, &test[..2], &result).unwrap_err();
        assert_eq!(
            refused.to_string(),
            "confidences holds 3 values; 2 points need one each"
        );
        assert_eq!(pipeline.map().object_confidence(id).unwrap(), Some(mean));
        let elsewhere = [Point::new(0.0, 0.0, 0.15); 3];
        assert_eq!(pipeline.annotate(id, &elsewhere, &result).unwrap(), 0);
        assert_eq!(pipeline.map().object_confidence(id).unwrap(), None);
    }

    #[test]
    fn a_configuration_is_checked_however_it_was_made() {
        for (points, message) in [(0, "training.points is 0"), (1, "training.points is 1")] {
            let mut config = Config::default();
            config.training.points = points;
            let refused = Pipeline::new(config).err().unwrap().to_string();
            assert!(refused.contains(message), "{refused}");
        }
        let mut config = Config::default();
        config.gp.models.clear();
        assert!(Pipeline::new(config).is_err());
    }

    #[test]
    fn the_seeds_tracker_can_be_chosen() {
        let text = r#"{"map": {"association": "centroid", "association_gate_m": 0.06}}"#;
        let pipeline = Pipeline::new(Config::from_json(text).unwrap()).unwrap();
        assert_eq!(
            pipeline.map().config().tracker.association,
            Association::Centroid { gate_m: 0.06 }
        );
    }

    #[test]
    fn the_same_frames_and_seed_give_the_same_bits() {
        let run = || {
            let mut pipeline = mapped();
            let id = only_object(&pipeline);
            let training = pipeline.training_set(id, 5).unwrap();
            pipeline
                .classify(id, &training, &on_surface(), ModelChoice::Classic)
                .unwrap()
        };
        assert_eq!(run(), run());
    }

    #[test]
    fn every_stage_notes_its_time() {
        let mut pipeline = mapped();
        let stages = |pipeline: &Pipeline| -> Vec<(&str, Option<ModelChoice>)> {
            pipeline
                .times()
                .iter()
                .map(|time| (time.stage, time.model))
                .collect()
        };
        assert_eq!(stages(&pipeline), [("segment", None), ("map", None)]);
        let mapping = pipeline.times()[1].seconds;
        pipeline.add_frame(&view(&[mug()], 0.0)).unwrap();
        assert!(
            pipeline.times()[1].seconds > mapping,
            "calls of one stage add up"
        );
        let id = only_object(&pipeline);
        let training = pipeline.training_set(id, 1).unwrap();
        pipeline
            .classify(id, &training, &on_surface(), ModelChoice::Classic)
            .unwrap();
        assert_eq!(
            stages(&pipeline)[2..],
            [
                ("training points", None),
                ("fit", Some(ModelChoice::Classic)),
                ("posterior", Some(ModelChoice::Classic)),
            ]
        );
        assert!(pipeline.times().iter().all(|time| time.seconds > 0.0));
    }

    #[test]
    fn a_refused_input_changes_nothing() {
        let mut pipeline = mapped();
        let id = only_object(&pipeline);
        let voxels = |pipeline: &Pipeline| pipeline.map().voxels().count();
        let before = voxels(&pipeline);
        let seen = view(&[mug()], 90.0);
        let blind = Frame::new(
            seen.rgb().to_vec(),
            seen.depth_m().to_vec(),
            *seen.intrinsics(),
            *seen.world_from_camera(),
            None,
        );
        let refusal = pipeline.add_frame(&blind.unwrap()).unwrap_err().to_string();
        assert!(refusal.contains("needs true masks"));
        assert_eq!(voxels(&pipeline), before);

        let training = pipeline.training_set(id, 1).unwrap();
        let mut message = |training: &TrainingSet, points: &[Point]| {
            let refused = pipeline.classify(id, training, points, ModelChoice::Classic);
            refused.unwrap_err().to_string()
        };
        let mugs = TrainingSet::new(on_surface(), vec![Category::Mug.class(); 27]).unwrap();
        assert!(message(&mugs, &on_surface()).contains("use at least 2 classes"));
        let nan = Point::new(f64::NAN, 0.0, 0.0);
        assert!(message(&training, &[nan]).contains("test points[0]"));
        assert_eq!(pipeline.map().object_confidence(id).unwrap(), None);
        let stray = pipeline.classify(ObjectId(99), &training, &[], ModelChoice::Classic);
        assert!(
            stray
                .unwrap_err()
                .to_string()
                .contains("there is no object 99")
        );
    }
}
