mod completing;
mod mapped_frame;
mod reconfigured;
#[cfg(test)]
mod tests;

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use credence_complete::Completer;
use credence_embed::QueryEmbedding;
use credence_map::{InsertReport, ObjectId, SemanticMap};
use credence_segment::Segmenter;
use credence_types::{Frame, Instance, InvalidInput, Point};
use mapped_frame::MappedFrame;

use crate::{
    ChosenSegmenter, Classification, Config, ModelChoice, PipelineError, TrainingSet,
    classify::Evidence,
    completers::Completers,
    completion::Completions,
    embedders::Embedders,
    models::{Question, Stopwatch, answer, embed_from},
    training::Viewpoints,
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

/// Stages from outside, in place of those that the configuration names.
#[derive(Default)]
pub struct Foreign {
    /// What finds the objects in a frame.
    pub segmenter: Option<Box<dyn Segmenter>>,
    /// What imagines their whole shapes.
    pub completer: Option<Box<dyn Completer>>,
}

/// From frames to a semantic map to classified points.
pub struct Pipeline {
    config: Config,
    /// Shared with the pipelines made of this one by [`reconfigured`](Self::reconfigured).
    segmenter: Arc<ChosenSegmenter>,
    completers: Completers,
    map: SemanticMap,
    viewpoints: Viewpoints,
    completions: Completions,
    frames: Vec<MappedFrame>,
    /// Of how many frames, from the first on, `completions` holds what the completer made: of all
    /// but in a pipeline that was reconfigured.
    completed_frames: usize,
    embedders: Embedders,
    times: Vec<StageTime>,
}

impl Pipeline {
    /// An empty map and the stages that the configuration names.
    ///
    /// # Errors
    /// A setting outside its range, a file of weights that cannot be read, a stage in Python.
    pub fn new(config: Config) -> Result<Self, PipelineError> {
        Self::with(config, Foreign::default())
    }

    /// A pipeline with stages from outside.
    ///
    /// # Errors
    /// A setting outside its range, a file of weights that cannot be read, a stage in Python for
    /// which there is none from outside.
    pub fn with(config: Config, foreign: Foreign) -> Result<Self, PipelineError> {
        config.check()?;
        Ok(Self {
            segmenter: Arc::new(ChosenSegmenter::new(&config, foreign.segmenter)?),
            completers: Completers::new(&config, foreign.completer)?,
            map: SemanticMap::new(config.map.settings())?,
            viewpoints: Viewpoints::default(),
            completions: Completions::default(),
            frames: Vec::new(),
            completed_frames: 0,
            embedders: Embedders::new(&config.metric)?,
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

    /// Segments a frame, completes the objects in it and inserts it into the map.
    ///
    /// # Errors
    /// A frame that the segmenter, the completer or the map refuses, earlier frames that are not
    /// [completed again](Self::complete_frame); nothing is changed then.
    pub fn add_frame(&mut self, frame: &Frame) -> Result<InsertReport, PipelineError> {
        self.check_completed()?;
        let start = Instant::now();
        let instances = self.segmenter.segment(frame)?;
        self.note("segment", None, start.elapsed());
        self.insert(frame, &instances)
    }

    /// [`add_frame`](Self::add_frame) with these instances in place of those that the segmenter
    /// would find: its own, kept, give the same bits.
    ///
    /// # Errors
    /// Those of [`add_frame`](Self::add_frame), a mask of another size than the frame's.
    pub fn add_segmented(
        &mut self,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<InsertReport, PipelineError> {
        self.check_completed()?;
        for instance in instances {
            instance.check_fits(frame.intrinsics())?;
        }
        self.insert(frame, instances)
    }

    fn insert(
        &mut self,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<InsertReport, PipelineError> {
        let views = self.complete(frame, instances)?;
        let start = Instant::now();
        let report = self.map.insert(frame, instances)?;
        for id in &report.deleted {
            self.viewpoints.forget(*id);
        }
        let camera_world = frame.world_from_camera().origin();
        for id in report.objects.iter().flatten() {
            self.viewpoints.note(*id, &camera_world);
        }
        let mapped = MappedFrame::new(frame, &report);
        let points = self.config.completion.points;
        mapped.note(&mut self.completions, views, frame, points);
        self.frames.push(mapped);
        self.completed_frames += 1;
        self.note("map", None, start.elapsed());
        Ok(report)
    }

    /// Draws the training points of an object.
    ///
    /// # Errors
    /// An id that is not tracked, an object without free space around it.
    pub fn training_set(&mut self, id: ObjectId, seed: u64) -> Result<TrainingSet, PipelineError> {
        let start = Instant::now();
        let training =
            TrainingSet::draw(&self.map, &self.viewpoints, id, &self.config.training, seed)?;
        self.note("training points", None, start.elapsed());
        Ok(training)
    }

    /// Fits a model to training points and asks it about test points: whether they lie on an
    /// object of the category that the map gives object `id`. The map stays as it is: see
    /// [`annotate`](Self::annotate).
    ///
    /// A point's confidence is the model's probability of that category, recalibrated by the
    /// configuration, times the segmenter's score of the object, times the completer's of the
    /// point where there is one. The three stages judge by different data, and are taken as
    /// independent.
    ///
    /// # Arguments
    ///
    /// * `completion_confidence`: how sure the completer is that each test point exists, in
    ///   \[0, 1\]; `None` for points that no completer made.
    ///
    /// # Errors
    /// An id that is not tracked, training points of fewer than two classes or none of the
    /// object's category, points that are not finite, a covariance that cannot be factorised,
    /// training points that a network cannot embed: too few, none free, or seen from nowhere.
    pub fn classify(
        &mut self,
        id: ObjectId,
        training: &TrainingSet,
        test_points: &[Point],
        completion_confidence: Option<&[f64]>,
        model: ModelChoice,
    ) -> Result<Classification, PipelineError> {
        let object = self.map.object(id)?;
        let evidence = Evidence {
            recalibration: self.config.recalibration.of(model),
            segmenter_score: object.score(),
            completion: completion_confidence,
        };
        evidence.check(test_points.len())?;
        check_finite("test points", test_points)?;
        let question = Question::new(training, test_points, object.category(), model)?;
        let mut watch = Stopwatch::default();
        let answer = answer(
            model,
            &question,
            &self.config,
            &mut self.embedders,
            &mut watch,
        )?;
        for (stage, time) in watch.0 {
            self.note(stage, Some(model), time);
        }
        Ok(Classification::new(question, answer, &evidence))
    }

    /// What the query network says of points, given what a training set holds of object `id`: the
    /// raw logit and direction of each, for research.
    ///
    /// # Errors
    /// An id that is not tracked, a training set of another category or without viewpoint, points
    /// that are not finite, an object or free space of which the set holds no point.
    pub fn query_embedding(
        &mut self,
        id: ObjectId,
        training: &TrainingSet,
        points: &[Point],
    ) -> Result<Vec<QueryEmbedding>, PipelineError> {
        let category = self.map.object(id)?.category();
        let observed = training.observed(category)?;
        let own = observed
            .first()
            .ok_or(PipelineError::CategoryNotTrained { category })?;
        let table_height_m = self.config.metric.table_height_m;
        embed_from(self.embedders.query()?, own, table_height_m, points)
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

    fn note(&mut self, stage: &'static str, model: Option<ModelChoice>, time: Duration) {
        let seconds = time.as_secs_f64();
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

fn check_finite(name: &'static str, points: &[Point]) -> Result<(), PipelineError> {
    match points.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        None => Ok(()),
        Some(index) => Err(InvalidInput::NonFinitePoint { name, index }.into()),
    }
}
