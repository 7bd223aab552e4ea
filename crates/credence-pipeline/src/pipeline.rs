use std::time::Instant;

use credence_map::{InsertReport, ObjectId, SemanticMap, SemanticMapConfig};
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
        let map = SemanticMap::new(SemanticMapConfig {
            resolution_m: config.map.resolution_m,
            max_range_m: Some(config.map.max_range_m),
            ..SemanticMapConfig::default()
        })?;
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
    /// object of the category that the map gives object `id`. The map's voxels of the object take
    /// the confidences of the test points in them.
    ///
    /// # Errors
    /// An id that is not tracked, training points of fewer than two classes, points that are not
    /// finite, a covariance that cannot be factorised.
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
        let fitted = Fitted::new(training, model, &self.config.gp)?;
        self.note("fit", Some(model), start);
        let start = Instant::now();
        let classification = fitted.predict(test_points, category, score)?;
        self.note("posterior", Some(model), start);
        let confidences: Vec<f64> = classification
            .predictions
            .points
            .iter()
            .map(|point| point.confidence)
            .collect();
        self.map.set_confidences(id, test_points, &confidences)?;
        Ok(classification)
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
